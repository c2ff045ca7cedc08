//! Corrections of velocity in bodies with damping, at steps that are long beside its times of decay.

use super::{Anything, Row};
use contact_dynamics::corrector::ContactStabilized;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    Corrector, Error, GeneralizedAlpha, LinearRows, LinearSystem, Newmark, PersistencyCorrection, Simulation,
    TimeIntegrator,
};

const N: usize = 11;
const SPRING: f64 = 100.0;
const GRAVITY: f64 = 0.5;

/// Eleven masses on springs that fall on a floor, C = β K with h β ω² = `x`: highest energy over that of the start.
fn highest(
    scheme: impl TimeIntegrator + 'static,
    corrector: impl Corrector<f64> + 'static,
    x: f64,
) -> Result<f64, Error> {
    let (h, height) = (0.05, 0.503);
    let entries = (0..N - 1).flat_map(|i| [(i, i, 1.0), (i + 1, i + 1, 1.0), (i, i + 1, -1.0), (i + 1, i, -1.0)]);
    let entries: Vec<_> = entries.map(|(i, j, k)| Triplet::new(i, j, SPRING * k)).collect();
    let stiffness = SparseColMat::try_new_from_triplets(N, N, &entries).expect("indices are inside");
    let mass: Vec<f64> = (0..N).map(|i| if i == 0 || i == N - 1 { 0.5 } else { 1.0 }).collect();
    let weights = mass.clone();
    let system = LinearSystem::lumped(mass.clone(), stiffness)?
        .rayleigh(0.0, x / (h * 4.0 * SPRING))?
        .load(move |_, f| f.iter_mut().zip(&weights).for_each(|(f, m)| *f = -GRAVITY * m));
    let mut run = Simulation::builder(system, scheme, h)
        .velocity(vec![-1.0; N])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], height))
        .corrector(corrector)
        .build()?;
    let energy = |run: &mut Simulation<'_, f64>| {
        let heights = mass.iter().zip(run.state().displacement()).map(|(m, u)| m * (u + height)).sum::<f64>();
        run.energy().total() + GRAVITY * heights
    };
    let start = energy(&mut run);
    let mut highest = 1.0_f64;
    for _ in 0..300 {
        run.step()?;
        highest = highest.max(energy(&mut run) / start);
    }
    Ok(highest)
}

pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let case = |what: &str, x: f64| format!("{what}, h β ω² = {x:e}: highest energy over that of the start");
    let correction = PersistencyCorrection::with_history_projection;
    let alpha = || GeneralizedAlpha::chung_hulbert(0.5);
    let now = |energy: f64| if energy < 1e4 { format!("{energy:.2}") } else { format!("{energy:.0e}") };
    Ok(vec![
        Row {
            case: case("Chung–Hulbert(0.5), λ_v/λ_a + history", 1e3),
            before: "2.31",
            now: now(highest(alpha()?, correction(), 1e3)?),
        },
        Row {
            case: case("Chung–Hulbert(0.5), λ_v/λ_a + history", 1e6),
            before: "2e6",
            now: now(highest(alpha()?, correction(), 1e6)?),
        },
        Row {
            case: case("trapezoidal rule, contact-stabilized", 1e3),
            before: "1584.18",
            now: match highest(Newmark::trapezoidal(), ContactStabilized::new(), 1e3) {
                Err(Error::Incompatible { .. }) => "refused at build".into(),
                other => now(other?),
            },
        },
    ])
}
