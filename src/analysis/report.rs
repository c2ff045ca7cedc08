//! The properties of a scheme that papers tabulate.

use super::{
    Order, ZeroStability, critical_omega, order, overshoot_growth, period_and_damping, radius_at_infinity,
    spectral_radius, zero_stability,
};
use crate::error::Result;
use crate::rounding::{ONLY_ROUNDING, half_digits};
use crate::tableau::{ContactLevel, StartUp, Tableau};
use std::fmt;

/// The properties of a scheme; computed by [`report`], printed by its `Display`.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Orders, and times of stored values.
    pub order: Order,
    /// Number of solves (explicit: force evaluations) per step.
    pub stages: usize,
    /// Number of vectors that a step reads from earlier ones.
    pub stored: usize,
    /// Spectral radius at infinite frequency; `None` for explicit schemes.
    pub radius_at_infinity: Option<f64>,
    /// Largest stable Ω without damping; `None` if there is no limit.
    pub critical_omega: Option<f64>,
    /// Relative period error and damping ratio at h/T = 0.1, if the mode still oscillates.
    pub period_and_damping: Option<(f64, f64)>,
    /// Behavior as h → 0.
    pub zero_stability: ZeroStability,
    /// Whether every mode in the range of stability keeps its amplitude without damping.
    pub keeps_amplitudes: bool,
    /// Exponents of the growth with Ω of displacement and velocity in the first steps; `None` for explicit schemes.
    pub overshoot_growth: Option<[f64; 2]>,
    /// The conserved momentum, as coefficients of (u/h, v, h a) of the states, newest first.
    pub momentum: Vec<[f64; 3]>,
    /// The condition imposed by contact; `None` if no multiplier can impose it.
    pub contact: Option<ContactLevel>,
}

/// All properties of a tableau, including user-defined ones.
///
/// # Errors
///
/// [`Error::Tableau`](crate::Error::Tableau) if it defines no step.
///
/// ```
/// use contact_dynamics::analysis::report;
/// use contact_dynamics::tableau::{Rows, Stage, Tableau, U, V, Z};
/// // Backward Euler.
/// let v = Z - U[0];
/// let scheme = Tableau::single(Stage::new(Rows { u: Z, v, a: v - V[0] }));
/// let report = report(&scheme)?;
/// assert_eq!(report.order.displacement, 1);
/// assert_eq!(report.radius_at_infinity, Some(0.0));
/// assert!(report.to_string().contains("unconditional"));
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
pub fn report(tableau: &Tableau) -> Result<Report> {
    tableau.check("the scheme reported on")?;
    let radius_at_infinity = radius_at_infinity(tableau);
    let critical_omega = critical_omega(tableau, 0.0);
    let range = critical_omega.unwrap_or(100.0);
    let keeps = |fraction: f64| (spectral_radius(tableau, fraction * range, 0.0) - 1.0).abs() < half_digits();
    let read = tableau.read_after(tableau.stages.len().saturating_sub(1))?;
    let contact = tableau.stages.last().map(|stage| stage.contact);
    let multipliers = tableau.stages.iter().all(|stage| stage.contact_row().z != 0.0);
    Ok(Report {
        order: order(tableau),
        stages: tableau.stages.len(),
        stored: read.iter().flatten().filter(|&&read| read).count(),
        radius_at_infinity,
        critical_omega,
        period_and_damping: period_and_damping(tableau, 0.1, 0.0),
        zero_stability: zero_stability(tableau),
        keeps_amplitudes: [0.01, 0.1, 0.3, 0.7, 0.95].into_iter().all(keeps),
        overshoot_growth: radius_at_infinity.map(|_| overshoot_growth(tableau, StartUp::Trapezoidal)),
        momentum: tableau.momentum().after_step(),
        contact: contact.filter(|_| multipliers),
    })
}

impl Report {
    /// The conserved momentum as a text, such as `v + 0.5 h a`.
    pub fn momentum_in_words(&self) -> String {
        let terms = self.momentum.iter().enumerate().flat_map(|(k, coefficients)| {
            let age = "₋".repeat(k);
            let quantities = [format!("u{age}/h"), format!("v{age}"), format!("h a{age}")];
            coefficients.iter().copied().zip(quantities)
        });
        let mut words = String::new();
        for (c, quantity) in terms.filter(|(c, _)| c.abs() > ONLY_ROUNDING) {
            words += match (words.is_empty(), c < 0.0) {
                (true, false) => "",
                (true, true) => "−",
                (false, false) => " + ",
                (false, true) => " − ",
            };
            // At most four digits, none for 1.
            let factor = (c.abs() * 1e4).round() / 1e4;
            if (factor - 1.0).abs() > ONLY_ROUNDING {
                words += &factor.to_string();
                words.push(' ');
            }
            words += &quantity;
        }
        words
    }

    /// The condition imposed by contact, as a text.
    pub fn contact_in_words(&self) -> &'static str {
        match self.contact {
            None => "compliant laws only",
            Some(ContactLevel::POSITION) => "gap at the end of the step",
            Some(ContactLevel::Position { .. }) => "gap ahead of the state",
            Some(ContactLevel::Velocity { lead: 0.0, .. }) => "gap rate at the end of the step",
            Some(ContactLevel::Velocity { .. }) => "gap rate ahead of the state",
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Order { displacement, velocity, acceleration, velocity_shift, acceleration_shift, .. } = self.order;
        let mut line = |name: &str, value: String| writeln!(f, "{name:<26} {value}");
        line("order of u, v, a", format!("{displacement}, {velocity}, {acceleration}"))?;
        for (name, shift) in [("stored v lives at", velocity_shift), ("stored a lives at", acceleration_shift)] {
            if shift != 0.0 {
                line(name, format!("t {shift:+.4} h"))?;
            }
        }
        line("solves a step", self.stages.to_string())?;
        line("vectors carried", self.stored.to_string())?;
        line("ρ∞", self.radius_at_infinity.map_or("explicit".into(), |radius| format!("{radius:.4}")))?;
        line("stable for Ω", self.critical_omega.map_or("unconditional".into(), |omega| format!("< {omega:.4}")))?;
        let figures = self.period_and_damping;
        // Rounded first, so that a zero has no minus sign.
        let percent = |value: f64| format!("{:.3} %", (1e5 * value).round() / 1e3 + 0.0);
        line("period error, h/T = 0.1", figures.map_or("no oscillation".into(), |(period, _)| percent(period)))?;
        line("damping, h/T = 0.1", figures.map_or("no oscillation".into(), |(_, damping)| percent(damping)))?;
        line("zero-stability", format!("{:?}", self.zero_stability).to_lowercase())?;
        let growth = |[u, v]: [f64; 2]| format!("u: Ω^{u:.0}, v: Ω^{v:.0}");
        line("overshoot, Ω → ∞", self.overshoot_growth.map_or("explicit".into(), growth))?;
        line("momentum conserved", self.momentum_in_words())?;
        line("contact", self.contact_in_words().into())
    }
}
