//! Bipenalty over many impacts: the plain form, and the stabilized one.

use super::{Anything, Row};
use contact_dynamics::{CentralDifference, ContactLaw, Simulation, mass};
use contact_dynamics_scenes::wall_bar::WallBar;

/// Energy of the bouncing bar after twelve impacts over that of the start, k = 10 EA/h_e, Courant number ½.
fn kept(law: impl Fn(f64, f64) -> Result<ContactLaw, Anything>) -> Result<f64, Anything> {
    let bar = WallBar::bouncing(100);
    let h = 0.5 * bar.element_size() / bar.wave_speed();
    let law = law(10.0 * bar.young / bar.element_size(), h)?;
    let mut run = Simulation::builder(bar.system(), CentralDifference, h)
        .constraint(bar.contact_under(law))
        .uncorrected()
        .build()?;
    Ok(bar.bounces(&bar.mass(), &mut run, h, 1.0)?.energy[5])
}

pub(crate) fn cases(_: bool) -> Result<Vec<Row>, Anything> {
    let stabilized = |stiffness, _| Ok(ContactLaw::StabilizedBipenalty { stiffness });
    let plain = |stiffness, h| Ok(ContactLaw::Bipenalty { stiffness, mass: mass::bipenalty(stiffness, h)? });
    Ok(vec![Row {
        case: "bouncing bar, k = 10 EA/h_e, Courant number ½: energy left after 12 impacts".into(),
        before: "1.49 (the plain form)",
        now: format!("{:.2} stabilized, {:.2} in the plain form", kept(stabilized)?, kept(plain)?),
    }])
}
