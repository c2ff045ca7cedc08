//! The generalized-α family: HHT-α, WBZ-α and Chung–Hulbert.

use super::newmark::kinematics;
use super::{TimeIntegrator, within};
use crate::error::Result;
use crate::tableau::{A, Rows, Stage, Tableau, U, V, Z};

/// Generalized-α: Newmark's rows with the balance inside the step.
///
/// ```text
/// u' = u + h v + h² [ (½ − β) a + β a' ],     v' = v + h [ (1 − γ) a + γ a' ]
/// M ((1 − α_m) a' + α_m a) + C ((1 − α_f) v' + α_f v) + f_int((1 − α_f) u' + α_f u) = f(t + (1 − α_f) h) + Gᵀλ
/// ```
///
/// | constructor | α_m | α_f | paper |
/// | --- | --- | --- | --- |
/// | [`chung_hulbert`] | (2ρ∞ − 1)/(ρ∞ + 1) | ρ∞/(ρ∞ + 1) | Chung, Hulbert, J. Appl. Mech. 60, 1993 |
/// | [`hht`] | 0 | (1 − ρ∞)/(1 + ρ∞) | Hilber, Hughes, Taylor, Earthq. Eng. Struct. Dyn. 5, 1977 |
/// | [`wbz`] | (ρ∞ − 1)/(ρ∞ + 1) | 0 | Wood, Bossak, Zienkiewicz, Int. J. Numer. Meth. Eng. 15, 1980 |
///
/// [`chung_hulbert`]: Self::chung_hulbert
/// [`hht`]: Self::hht
/// [`wbz`]: Self::wbz
///
/// All three have γ = ½ − α_m + α_f and β = ¼ (1 − α_m + α_f)².
///
/// * Order 2 if γ = ½ − α_m + α_f. The stored a belongs to t + (α_m − α_f) h and is only of order 1 at the time of
///   the state; the acceleration of a [`State`](crate::State) is extrapolated to its time and of order 2.
/// * Unconditionally stable for α_m ≤ α_f ≤ ½ and β ≥ ¼ + ½ (α_f − α_m). Chung–Hulbert has the least low-frequency
///   damping for a given ρ∞; its spectrum with ρ∞ = 0 is Houbolt's.
/// * The internal force is evaluated at the mean displacement, f_int(ū), not as the mean of two forces.
/// * Conserves linear momentum in the form v + (1 − γ − α_m) h a.
/// * Contact is imposed on the displacements at the end of the step; the multiplier belongs to t + (1 − α_f) h. The
///   rows read a of the past: after an impact they need both parts of the correction.
///
/// ```
/// use contact_dynamics::{GeneralizedAlpha, TimeIntegrator, analysis};
/// let scheme = GeneralizedAlpha::chung_hulbert(0.8)?;
/// assert!((analysis::spectral_radius(&scheme.tableau(), 1e6, 0.0) - 0.8).abs() < 1e-4);
/// assert_eq!(scheme, GeneralizedAlpha::default());
/// # Ok::<(), contact_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeneralizedAlpha {
    kind: &'static str,
    /// ρ∞, if the member was chosen by it.
    rho: Option<f64>,
    alpha_m: f64,
    alpha_f: f64,
    beta: f64,
    gamma: f64,
}

impl Default for GeneralizedAlpha {
    /// The default of this crate: Chung and Hulbert's scheme with ρ∞ = 0.8.
    fn default() -> Self {
        Self::of_radius(0.8)
    }
}

impl GeneralizedAlpha {
    /// The scheme of Chung and Hulbert with spectral radius ρ∞ for the highest frequencies, in [0, 1].
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ∞ is outside its range.
    pub fn chung_hulbert(rho: f64) -> Result<Self> {
        within("ρ∞ of Chung and Hulbert's scheme", rho, 0.0..=1.0, "in [0, 1]").map(Self::of_radius)
    }

    /// The scheme of Chung and Hulbert for a checked radius.
    pub(crate) fn of_radius(rho: f64) -> Self {
        Self::optimal("Chung–Hulbert", rho, (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0))
    }

    /// HHT-α with spectral radius ρ∞ in [½, 1].
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ∞ is outside its range.
    pub fn hht(rho: f64) -> Result<Self> {
        let rho = within("ρ∞ of the HHT-α scheme", rho, 0.5..=1.0, "in [1/2, 1]")?;
        Ok(Self::optimal("HHT-α", rho, 0.0, (1.0 - rho) / (1.0 + rho)))
    }

    /// WBZ-α (also called Bossak's scheme) with spectral radius ρ∞ in [0, 1].
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) if ρ∞ is outside its range.
    pub fn wbz(rho: f64) -> Result<Self> {
        let rho = within("ρ∞ of the WBZ-α scheme", rho, 0.0..=1.0, "in [0, 1]")?;
        Ok(Self::optimal("WBZ-α", rho, (rho - 1.0) / (rho + 1.0), 0.0))
    }

    /// The member with these raw parameters.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`](crate::Error::Parameter) unless −1 ≤ α_m ≤ ½, 0 ≤ α_f ≤ ½, 0 < β ≤ 1 and ½ ≤ γ ≤ 3/2.
    pub fn new(alpha_m: f64, alpha_f: f64, beta: f64, gamma: f64) -> Result<Self> {
        Ok(Self {
            kind: "generalized-α",
            rho: None,
            alpha_m: within("α_m", alpha_m, -1.0..=0.5, "in [-1, 1/2]")?,
            alpha_f: within("α_f", alpha_f, 0.0..=0.5, "in [0, 1/2]")?,
            beta: within("β", beta, f64::MIN_POSITIVE..=1.0, "in (0, 1]")?,
            gamma: within("γ", gamma, 0.5..=1.5, "in [1/2, 3/2]")?,
        })
    }

    /// Order 2 and the most damping of high frequencies.
    fn optimal(kind: &'static str, rho: f64, alpha_m: f64, alpha_f: f64) -> Self {
        let shift = alpha_f - alpha_m;
        let (beta, gamma) = (0.25 * (1.0 + shift) * (1.0 + shift), 0.5 + shift);
        Self { kind, rho: Some(rho), alpha_m, alpha_f, beta, gamma }
    }

    /// α_m: weight of the old acceleration in the balance.
    pub fn alpha_m(&self) -> f64 {
        self.alpha_m
    }

    /// α_f: weight of the old displacement and velocity in the balance.
    pub fn alpha_f(&self) -> f64 {
        self.alpha_f
    }

    /// β.
    pub fn beta(&self) -> f64 {
        self.beta
    }

    /// γ.
    pub fn gamma(&self) -> f64 {
        self.gamma
    }
}

impl TimeIntegrator for GeneralizedAlpha {
    fn name(&self) -> String {
        let Self { kind, rho, alpha_m, alpha_f, beta, gamma } = self;
        match rho {
            Some(rho) => format!("{kind}({rho})"),
            None => format!("{kind}({alpha_m}, {alpha_f}, {beta}, {gamma})"),
        }
    }

    fn tableau(&self) -> Tableau {
        let Self { alpha_m: am, alpha_f: af, beta, gamma, .. } = *self;
        let Rows { v, a, .. } = kinematics(beta, gamma);
        let balance =
            Rows { u: (1.0 - af) * Z + af * U[0], v: (1.0 - af) * v + af * V[0], a: (1.0 - am) * a + am * A[0] };
        Tableau::single(Stage::new(Rows { u: Z, v, a }).balanced(balance, 1.0 - af))
    }
}
