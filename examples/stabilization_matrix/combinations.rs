//! What is combined: integrators, corrections, laws and masses, by rules.

use contact_dynamics::{
    Bathe, CdLagrange, CentralDifference, Composite, ContactLaw, GeneralizedAlpha, Gssss, MoreauJean, Newmark, Preset,
};
pub(crate) use contact_dynamics_scenes::combinations::{Combination, Correction};
use contact_dynamics_scenes::combinations::{Make, plain, preset};
use contact_dynamics_scenes::masses::{Takers, Treatment};

const COMPOSITE: Make = || Ok(Box::new(Composite));
const TRAPEZOIDAL: Make = || Ok(Box::new(Newmark::trapezoidal()));
const CHUNG_HULBERT_09: Make = || Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.9)?));
const CHUNG_HULBERT_08: Make = || Ok(Box::new(GeneralizedAlpha::chung_hulbert(0.8)?));
const BATHE: Make = || Ok(Box::new(Bathe::default()));
const BATHE_1: Make = || Ok(Box::new(Bathe::with_radius(1.0)?));
const MIDPOINT: Make = || Ok(Box::new(Gssss::new(1.0, 1.0, 1.0)?));
const MOREAU_JEAN: Make = || Ok(Box::new(MoreauJean::new(0.5)?));
const CENTRAL_DIFFERENCE: Make = || Ok(Box::new(CentralDifference));
const CD_LAGRANGE: Make = || Ok(Box::new(CdLagrange));

/// Those that impose contact on displacements, with one, two or any number of solves a step.
const IMPLICIT: [Make; 6] = [COMPOSITE, TRAPEZOIDAL, CHUNG_HULBERT_09, CHUNG_HULBERT_08, BATHE, BATHE_1];

/// All rows: presets, then those without correction, those with one, those on other masses.
pub(crate) fn all() -> Vec<Combination> {
    use Correction::{
        History, Implicit, LaursenLove, Persistency, Release, Splitting, Stabilized, StabilizedClosed,
        TaylorPapadopoulos, ZeroAcceleration,
    };
    let tapered = Treatment::RedistributedBlend(Takers::Tapered);
    let mut rows = vec![
        preset(CHUNG_HULBERT_09, tapered, Preset::smooth()),
        preset(BATHE_1, tapered, Preset::conservative()),
        preset(CD_LAGRANGE, Treatment::Redistributed(Takers::Tapered), Preset::explicit()),
        plain(CD_LAGRANGE),
    ];
    let mut add = |makes: &[Make], corrections: &[Correction], masses: &[Treatment]| {
        for &make in makes {
            for &correction in corrections {
                rows.extend(masses.iter().map(|&mass| Combination { correction, mass, ..plain(make) }));
            }
        }
    };
    let lumped = [Treatment::Lumped];
    add(&IMPLICIT, &[Correction::None], &lumped);
    // Schemes of one stage that read one state have no past to project.
    add(&[COMPOSITE, BATHE, BATHE_1], &[Persistency, History], &lumped);
    add(&[TRAPEZOIDAL, CHUNG_HULBERT_09, CHUNG_HULBERT_08], &[History], &lumped);
    add(&[MIDPOINT], &[Correction::None, Persistency, LaursenLove], &lumped);
    add(&[MOREAU_JEAN], &[Correction::None], &lumped);
    add(
        &[COMPOSITE, TRAPEZOIDAL, CHUNG_HULBERT_08, BATHE_1],
        &[Release, TaylorPapadopoulos, ZeroAcceleration],
        &lumped,
    );
    add(&[TRAPEZOIDAL, CHUNG_HULBERT_09, CHUNG_HULBERT_08], &[Splitting], &lumped);
    add(&[TRAPEZOIDAL, CHUNG_HULBERT_08], &[Implicit, Stabilized, StabilizedClosed], &lumped);
    add(&[COMPOSITE, TRAPEZOIDAL, CHUNG_HULBERT_08], &[History], &[Treatment::Consistent, Treatment::Blend]);
    let redistributed = [Takers::Neighbors, Takers::Uniform, Takers::LeastSquares].map(Treatment::Redistributed);
    let blended = [Takers::Uniform, Takers::Tapered].map(Treatment::RedistributedBlend);
    add(&IMPLICIT, &[Correction::None], &[&redistributed[..], &blended[..]].concat());
    rows.push(Combination { law: ContactLaw::RateCondition, ..plain(MIDPOINT) });
    rows.extend([MIDPOINT, COMPOSITE].map(|make| Combination { law: ContactLaw::PersistencySwitch, ..plain(make) }));
    let springs =
        |stiffness| [ContactLaw::Bipenalty { stiffness, mass: 0.0 }, ContactLaw::StabilizedBipenalty { stiffness }];
    rows.extend([1.0, 10.0].into_iter().flat_map(springs).map(|law| Combination { law, ..plain(CENTRAL_DIFFERENCE) }));
    rows
}

/// The scheme against which times are measured.
pub(crate) fn reference() -> Combination {
    plain(TRAPEZOIDAL)
}
