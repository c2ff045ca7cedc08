//! Friction that law, solver, scheme or correction cannot serve is refused with its reason, before the first step.

use super::{masses, run};
use contact_dynamics::contact::{ContactConstraint, ContactLaw, Contacts, GapRates, Rates};
use contact_dynamics::contact_solver::Pivoting;
use contact_dynamics::corrector::Release;
use contact_dynamics::{CentralDifference, Error, LinearRows, Newmark, Result, SimulationBuilder, TchamwaWielgosz};

/// A floor with this law and friction along one tangent.
fn floor(law: ContactLaw, friction: f64) -> LinearRows<'static, f64> {
    LinearRows::new().row(law, &[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)]])
}

fn scene() -> SimulationBuilder<'static, f64> {
    let block = masses(vec![1.0; 2], vec![0.0, -1.0]).unwrap();
    run(block, Box::new(Newmark::trapezoidal()), 0.1, vec![0.0; 2])
}

/// The sentence of the refusal.
fn refusal(builder: SimulationBuilder<'static, f64>) -> String {
    match builder.build() {
        Ok(_) => "taken".into(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn what_cannot_be_served_is_refused() {
    let rigid = || floor(ContactLaw::Rigid, 0.3);
    let explicit = || {
        let block = masses(vec![1.0; 2], vec![0.0, -1.0]).unwrap();
        run(block, Box::new(CentralDifference), 0.1, vec![0.0; 2])
    };
    let without = || {
        let block = masses(vec![1.0; 2], vec![0.0, -1.0]).unwrap();
        run(block, Box::new(TchamwaWielgosz::new(1.03).unwrap()), 0.1, vec![0.0; 2])
    };
    for (builder, says) in [
        (scene().constraint(rigid()), "taken"),
        (scene().constraint(floor(ContactLaw::Rigid, -0.1)), "a friction coefficient is -1e-1"),
        (scene().constraint(floor(ContactLaw::Rigid, f64::NAN)), "a friction coefficient is NaN"),
        (scene().constraint(floor(ContactLaw::Equality, 0.3)), "laws of one instant that only press"),
        (scene().constraint(floor(ContactLaw::RateCondition, 0.3)), "laws of one instant that only press"),
        (scene().constraint(LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(0.3, &[])), "no tangent"),
        (scene().constraint(rigid()).contact_solver(Pivoting::default()), "choose `ActiveSet`"),
        (scene().constraint(rigid()).corrector(Release), "does not support friction"),
        (explicit().constraint(rigid()), "taken"),
        (explicit().constraint(floor(ContactLaw::Penalty { stiffness: 10.0 }, 0.3)), "taken"),
        (without().constraint(floor(ContactLaw::Penalty { stiffness: 10.0 }, 0.3)), "choose another scheme"),
    ] {
        let found = refusal(builder);
        assert!(found.contains(says), "{found} / {says}");
    }
}

/// A host's constraint whose tangent or slip rates are not fit.
struct Host {
    tangent: (usize, f64),
    rates: Rates,
    rate: f64,
}

impl ContactConstraint<f64> for Host {
    fn dofs(&self) -> &[usize] {
        &[0, 1]
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        contacts.push((0, 0), ContactLaw::Rigid, &[(1, 1.0)]).tangent(&[self.tangent]).friction(0.5);
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = u[1];
        Ok(())
    }
    fn slip_rates(&mut self, _: f64, _: &[f64], _: &[f64], rates: &mut [GapRates<f64>]) -> Result<Rates> {
        rates[0].rate = self.rate;
        Ok(self.rates)
    }
}

#[test]
fn hosts_that_err_are_told() {
    let host = |tangent, rates, rate| scene().constraint(Host { tangent, rates, rate }).build().map(|_| ());
    assert!(host((0, 1.0), Rates::Given, 0.1).is_ok());
    assert!(matches!(host((7, 1.0), Rates::Given, 0.0), Err(Error::UnlistedPlace { place: 7, .. })));
    assert!(matches!(host((0, f64::NAN), Rates::Given, 0.0), Err(Error::NotFinite { index: 0, .. })));
    let silent = host((0, 1.0), Rates::Differences, 0.0).unwrap_err().to_string();
    assert!(silent.contains("give the rates of slip"), "{silent}");
    let infinite = host((0, 1.0), Rates::Given, f64::INFINITY).unwrap_err();
    assert!(matches!(infinite, Error::ContactNotFinite { what: "the slip rate", .. }), "{infinite}");
}
