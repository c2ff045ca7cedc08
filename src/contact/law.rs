//! Contact laws: the relation between force and gap of one row.

use crate::error::{Error, Result, positive};
use crate::real::Real;

/// The law of one contact row: its force λ ≥ 0 (compression) given its gap g.
///
/// Rigid laws determine λ by a condition on the gap, or on its rate where the scheme imposes contact on velocities
/// ([`ContactLevel`](crate::tableau::ContactLevel)). Compliant laws are springs. They act at the instant at which the
/// scheme evaluates all other forces, so that a smooth contact keeps the order of the scheme. Correctors leave them
/// unchanged, and schemes without multiplier contact accept them. In the contact problem a compliance is added to the
/// diagonal of the Delassus operator, and solved together with the rigid rows.
///
/// Parameters are `f64` in every run, in the units of the host: force/length for a stiffness.
///
/// ```
/// use contact_dynamics::ContactLaw;
/// // Two glass spheres of radius 0.01, E = 48 GPa, ν = 0.2.
/// let law = ContactLaw::hertz(48e9 / (2.0 * (1.0 - 0.04)), 0.005);
/// assert!(matches!(law, ContactLaw::PowerLaw { exponent: 1.5, .. }) && law.is_compliant());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ContactLaw {
    /// Unilateral and rigid: g ≥ 0, λ ≥ 0, λ g = 0. Impacts remove the approach velocity of the contact node.
    Rigid,
    /// Bilateral: g = 0, λ of either sign (ties, motions prescribed by multipliers).
    Equality,
    /// Newton's impact law (Moreau 1988): 0 ≤ ġ′ + e ġ ⊥ λ ≥ 0, with ġ the rate at the start of the stage, for
    /// schemes that impose contact on velocities. If contact is imposed on the displacements of the state,
    /// [`PersistencyCorrection`](crate::PersistencyCorrection) lets a contact that closes leave with e times the rate
    /// at which its gap reached zero. With several contacts at once it is the law of simultaneous impact, which for
    /// Newton's cradle differs from pairwise impacts in sequence. Schemes that impose contact ahead of the state do
    /// not accept it.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{ContactLaw, GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
    /// let ball = LinearSystem::lumped(vec![1.0], free)?.load(|_, f| f[0] = -9.81);
    /// let floor = LinearRows::new().row(ContactLaw::Restitution { coefficient: 0.5 }, &[(0, 1.0)], 1.0);
    /// let mut run = Simulation::builder(ball, GeneralizedAlpha::default(), 0.01).constraint(floor).build()?;
    /// run.run_until(0.6, &mut ())?;
    /// let (u, v) = (run.state().displacement()[0] + 1.0, run.state().velocity()[0]);
    /// assert!((9.81 * u + 0.5 * v * v - 0.25 * 9.81).abs() < 1e-12); // e² of the height
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    Restitution {
        /// e, from 0 (plastic, the same as `Rigid`) to 1 (elastic).
        coefficient: f64,
    },
    /// The rate condition of Laursen and Chawla (Int. J. Numer. Meth. Eng. 40, 1997): a row that is closed at the
    /// start of the stage, gₙ ≤ 0, has 0 ≤ (g′ − gₙ)/h ⊥ λ ≥ 0; an open one has no force. For schemes that impose
    /// contact on the displacements of the state.
    ///
    /// * λ (g′ − gₙ) = 0. With the balance in the middle of the step, and the mean of v as the change of u (the
    ///   midpoint rule, [`Gssss::new(1, 1, 1)`](crate::Gssss), and [`EnergyMomentum`](crate::EnergyMomentum)),
    ///   contact with fixed rows does no work, and energy is conserved. Linear momentum is conserved with every
    ///   scheme.
    /// * Known failures: bodies penetrate by up to one step's approach, and stay there while they are pressed (so a
    ///   run may start with penetration). Contact nodes rebound elastically, and contact chatters. With the balance
    ///   elsewhere contact does work: with the trapezoidal rule a mass leaves three times as fast as it came. Rows of
    ///   curved surfaces that are not followed drift by (h v)²/(2R) per step.
    /// * [`Works::contact`](crate::Works::contact) uses the mean of the forces of two steps and reports spurious
    ///   work; its remainder cancels it.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{ContactLaw, Gssss, LinearRows, LinearSystem, Simulation};
    ///
    /// // A ball flies with speed 2 at a wall 0.99 away, 0.02 a step.
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
    /// let wall = LinearRows::new().row(ContactLaw::RateCondition, &[(0, 1.0)], 0.99);
    /// let midpoint = Gssss::new(1.0, 1.0, 1.0)?;
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], free)?, midpoint, 0.01)
    ///     .velocity(vec![-2.0])
    ///     .constraint(wall)
    ///     .build()?;
    /// run.run_until(0.5, &mut ())?;
    /// assert!((run.gaps()[0] + 0.01).abs() < 1e-12); // half a step's approach inside
    /// run.run_until(1.0, &mut ())?;
    /// assert!((run.state().velocity()[0] - 2.0).abs() < 1e-12); // and out again, as fast as it came
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    RateCondition,
    /// The dynamic persistency switch (as in the mechanical contact of MOOSE): a row that is open at the start of the
    /// stage, gₙ > 0, has 0 ≤ g′ ⊥ λ ≥ 0, a closed one 0 ≤ ġ′ ⊥ λ ≥ 0, with ġ′ from the velocities that the scheme
    /// recovers. For schemes that impose contact on the displacements of the state, if their velocities contain the
    /// unknown.
    ///
    /// * From the second step on the rate of a pressed contact is zero: it persists. With the midpoint rule,
    ///   [`Gssss::new(1, 1, 1)`](crate::Gssss), and a fine mesh the force is smooth without a corrector (figures in
    ///   `docs/contact/laws.md`). Linear momentum is conserved.
    /// * Known failures: the force of the first step is that of `Rigid`, and on a coarse mesh contact may open after
    ///   it. The second step leaves a gap that stays while contact lasts. Where the change of u is the mean of v, it
    ///   is up to half a step's approach (so a run may start with penetration). Accelerations can alternate: with the
    ///   trapezoidal rule forces do, and energy may rise. Rows of curved surfaces that are not followed drift as
    ///   under `RateCondition`. [`LaursenLove`](crate::corrector::LaursenLove), with which contacts rebound, is
    ///   rejected.
    PersistencySwitch,
    /// λ = k ⟨−g⟩: a linear spring in compression.
    Penalty {
        /// k (force/length).
        stiffness: f64,
    },
    /// λ = k ⟨−g⟩^p, for instance Hertz' law with p = 3/2.
    PowerLaw {
        /// k (force/length^p).
        stiffness: f64,
        /// p ≥ 1.
        exponent: f64,
    },
    /// A spring and a dashpot in parallel (Kelvin and Voigt): with δ = −g > 0, λ = ⟨k δ + c δ̇⟩. The force never
    /// pulls: a contact ends at k δ + c δ̇ = 0, while the gap is still negative. Gap and rate are taken at the
    /// instant of the scheme's balance, so that in lasting compression the dashpot acts as a part of C.
    ///
    /// * The force jumps to c δ̇ where bodies touch at speed, at some time within a step: errors are of first order.
    ///   [`HuntCrossley`](Self::HuntCrossley) has no jump.
    /// * A mass m that impacts at the speed v leaves with e v, for any v. With ξ = c/(2 √(k m)) < 1 this is
    ///   e = exp(−ξ φ/√(1 − ξ²)), cos φ = 2 ξ² − 1.
    /// * [`Works::contact`](crate::Works::contact) has the work of the spring, −½ k δ²;
    ///   [`Works::damping`](crate::Works::damping) has the rest of the work of contact forces.
    ///
    /// ```
    /// use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
    /// use contact_dynamics::{ContactLaw, GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
    ///
    /// let free = SparseColMat::<usize, f64>::try_new_from_triplets(1, 1, &[Triplet::new(0, 0, 0.0)])?;
    /// let law = ContactLaw::KelvinVoigt { stiffness: 100.0, damping: 5.0 };
    /// let mut run = Simulation::builder(LinearSystem::lumped(vec![1.0], free)?, GeneralizedAlpha::default(), 1e-4)
    ///     .velocity(vec![-5.0])
    ///     .constraint(LinearRows::new().row(law, &[(0, 1.0)], 0.1))
    ///     .build()?;
    /// run.run_until(0.5, &mut ())?;
    /// let (xi, v) = (0.25_f64, run.state().velocity()[0]);
    /// let e = (-xi / (1.0 - xi * xi).sqrt() * (2.0 * xi * xi - 1.0).acos()).exp();
    /// assert!((v / (5.0 * e) - 1.0).abs() < 1e-3); // 2.836
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    KelvinVoigt {
        /// k (force/length).
        stiffness: f64,
        /// c (force·time/length), not negative.
        damping: f64,
    },
    /// A spring with a dissipation that grows with its compression (Hunt and Crossley, J. Appl. Mech. 42, 1975): with
    /// δ = −g > 0, λ = k δ^p ⟨1 + χ δ̇⟩. The force begins and ends at zero, so that errors are as for a spring. An
    /// impact at the speed v leaves with the speed w given by v − ln(1 + χ v)/χ = −w − ln(1 − χ w)/χ, for any mass, k
    /// and p: e = w/v is 1 − ⅔ χ v + … for small χ v. Works are booked as for [`KelvinVoigt`](Self::KelvinVoigt).
    ///
    /// ```
    /// use contact_dynamics::ContactLaw;
    /// let law = ContactLaw::HuntCrossley { stiffness: 1e5, exponent: 1.5, dissipation: 0.2 };
    /// assert!(law.is_compliant());
    /// ```
    HuntCrossley {
        /// k (force/length^p).
        stiffness: f64,
        /// p ≥ 1.
        exponent: f64,
        /// χ (time/length), not negative.
        dissipation: f64,
    },
    /// λ = ⟨−k g − m g̈⟩: a spring and a mass that contact couples in (Asano 1986; Hetherington, Rodríguez-Ferran,
    /// Askes 2012). With m ≥ k (h_c/2)², h_c the critical step of the mesh, explicit schemes keep their critical
    /// step. Switching the mass on at speed changes the kinetic energy, and over many impacts energy grows;
    /// [`StabilizedBipenalty`](Self::StabilizedBipenalty) avoids that.
    Bipenalty {
        /// k (force/length).
        stiffness: f64,
        /// m (mass).
        mass: f64,
    },
    /// The bipenalty with m = k h²/4 in a stabilized form, for [`CentralDifference`](crate::CentralDifference). The
    /// free motion predicts the gap of the next step. With ḡ₋ and ḡ₊ the means of the gap over the last and the
    /// coming step
    ///
    /// ```text
    /// λ = ½ k ⟨−ḡ₊ + ⟨−ḡ₋⟩⟩,      ḡ₊ = ĝ₊ + ½ h² G M⁻¹ Gᵀ λ
    /// ```
    ///
    /// with the predicted ĝ₊. While contact lasts it equals the plain form, k g + m g̈. The plain form also counts ḡ₋
    /// of open gaps, and its impacts create energy by the work of that term; here the mass acts only during contact.
    /// The mesh alone determines the critical step, for any k. Without loads, for linear gaps and an obstacle at
    /// rest, the energy
    ///
    /// ```text
    /// ½ v̂ᵀ M v̂ + ½ uₙᵀ K uₙ₊₁ + ½ k ⟨−ḡ⟩²,      v̂ = (uₙ₊₁ − uₙ)/h,      ḡ = ½ (gₙ + gₙ₊₁)
    /// ```
    ///
    /// never rises, and is constant while contact lasts (`docs/theory.md`, section 5.2). The idea of a predictor and
    /// a corrector is from Kolman, Kopačka, González, Cho, Park (Math. Comput. Simul. 189, 2021). Their formulas were
    /// not available to us; this form and its proof are ours.
    ///
    /// Known failures: penetration, as with a penalty; a very stiff spring rings.
    StabilizedBipenalty {
        /// k (force/length).
        stiffness: f64,
    },
    /// Augmented Lagrangian (Alart and Curnier 1991; Simo and Laursen 1992): λ = ⟨λ̂ − k g⟩ with λ̂ = 0 at first, as
    /// a penalty. Then λ̂ is replaced by λ, `augmentations` times within the stage. Every augmentation brings the
    /// solution closer to rigid contact, and more so with a stiffer spring. λ̂ is not carried to the next step: in
    /// dynamics that would integrate the gap over time and grow. If the gap does not depend on the force (explicit
    /// schemes), it is a penalty.
    AugmentedLagrangian {
        /// k (force/length).
        stiffness: f64,
        /// The number of replacements of λ̂ within a stage; at most 10 000.
        augmentations: usize,
    },
}

/// The quantity that a row constrains in a stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Measure {
    /// The quantity that the scheme constrains: the gap, or h times its rate.
    AsScheme,
    /// The change of the gap since the start of the stage.
    Increment,
    /// h times the rate of the gap, in a scheme that constrains the gap.
    Rate,
    /// Nothing: the row is open in this stage.
    Nothing,
    /// Decided once the motion of the stage without contact is known.
    Undecided,
}

/// The depth δ of a row and its rate δ̇ as functions of y, the quantity that the row constrains in a stage: [value at
/// y = 0, slope with respect to −y] of each. y is the gap, or h times its rate if the unknown changes only the rate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Course<T> {
    pub(crate) depth: [T; 2],
    pub(crate) approach: [T; 2],
}

impl<T: Real> Course<T> {
    /// y is the gap, and the rate is zero.
    pub(crate) fn at_rest() -> Self {
        Self { depth: [T::zero(), T::one()], approach: [T::zero(); 2] }
    }

    /// Whether y is the gap.
    fn moves(&self) -> bool {
        self.depth[1] != T::zero()
    }

    /// δ and δ̇ at −y = x.
    fn at(&self, x: T) -> [T; 2] {
        [self.depth, self.approach].map(|[start, slope]| start + slope * x)
    }

    /// The tangent of a damped law at −y = x, in the form 0 ≤ y + c λ + s.
    fn tangent(&self, law: &ContactLaw, x: T, [by_depth, by_rate]: [T; 2]) -> (T, T) {
        let [depth, approach] = self.at(x);
        let slope = (by_depth * self.depth[1] + by_rate * self.approach[1]).max(T::min_positive_value());
        (slope.recip(), x - law.pull(depth, approach) / slope)
    }
}

impl ContactLaw {
    /// Hertz' law for two elastic bodies: λ = 4/3 E* √R ⟨−g⟩^{3/2}, with 1/E* = Σ (1 − ν²)/E and 1/R = Σ 1/Rᵢ.
    pub fn hertz(modulus: f64, radius: f64) -> Self {
        Self::PowerLaw { stiffness: 4.0 / 3.0 * modulus * radius.sqrt(), exponent: 1.5 }
    }

    /// Whether the force is a function of the gap (and its derivatives): the gap may be negative.
    pub fn is_compliant(&self) -> bool {
        !matches!(
            self,
            Self::Rigid | Self::Equality | Self::Restitution { .. } | Self::RateCondition | Self::PersistencySwitch
        )
    }

    /// Whether the force depends on the rate of the gap.
    pub(crate) fn is_damped(&self) -> bool {
        match *self {
            Self::KelvinVoigt { damping: d, .. } | Self::HuntCrossley { dissipation: d, .. } => d > 0.0,
            _ => false,
        }
    }

    /// e of Newton's impact law, the ratio of the rates after and before an impact; none for other laws.
    pub(crate) fn restitution(&self) -> Option<f64> {
        match *self {
            Self::Restitution { coefficient } => Some(coefficient),
            _ => None,
        }
    }

    /// Whether a contact rebounds with a share of its approach rate.
    pub(crate) fn rebounds(&self) -> bool {
        self.restitution().is_some_and(|coefficient| coefficient > 0.0)
    }

    /// The quantity that a row constrains, by whether it was closed at the start of the stage.
    pub(crate) fn measure(&self, closed: bool) -> Measure {
        match (self, closed) {
            (Self::RateCondition, true) => Measure::Increment,
            (Self::RateCondition, false) => Measure::Nothing,
            (Self::PersistencySwitch, true) => Measure::Rate,
            _ => Measure::AsScheme,
        }
    }

    /// Whether a multiplier enforces the row, so that the scheme's unknown must change the constrained quantity.
    /// Forces of the other laws are functions of the gaps.
    pub(crate) fn needs_multiplier(&self) -> bool {
        !self.is_compliant() || self.is_predictive()
    }

    /// Whether the force is a function of the gap of the state and its rate, without masses and predictions.
    pub(crate) fn is_spring(&self) -> bool {
        self.is_compliant() && self.inertia() == 0.0 && !self.is_predictive()
    }

    /// Whether the condition, or corrections, use the rates of the gap.
    pub(crate) fn reads_rates(&self) -> bool {
        !self.is_compliant() || self.inertia() > 0.0 || self.is_damped()
    }

    /// Whether the force is not piecewise linear in the gap; then it is linearized repeatedly until it converges.
    pub(crate) fn is_nonlinear(&self) -> bool {
        matches!(self, Self::PowerLaw { .. } | Self::KelvinVoigt { .. } | Self::HuntCrossley { .. })
    }

    /// Whether the gap of a closed row may be other than zero.
    pub(crate) fn may_penetrate(&self) -> bool {
        self.is_compliant() || self.reads_start()
    }

    /// Whether the row constrains only the gap, or its rate where the scheme does. Predicted displacements are
    /// projected onto such rows.
    pub(crate) fn is_plain(&self) -> bool {
        matches!(self, Self::Rigid | Self::Equality)
    }

    /// Whether the contact may have friction, bounded by μ times the force of the law. Not for laws whose force may
    /// pull, or does not belong to a single instant.
    pub(crate) fn admits_friction(&self) -> bool {
        !matches!(
            self,
            Self::Equality
                | Self::RateCondition
                | Self::PersistencySwitch
                | Self::Bipenalty { .. }
                | Self::StabilizedBipenalty { .. }
        )
    }

    /// Whether a compliant law reads the gap that the scheme constrains ahead of the state, besides the gaps of the
    /// step.
    pub(crate) fn is_predictive(&self) -> bool {
        matches!(self, Self::StabilizedBipenalty { .. })
    }

    /// The penetration that a row may recover in a step, if its constraint limits it to `depth`. Only a rigid row
    /// would recover all of it at once; for other laws there is no limit.
    pub(crate) fn recovery<T: Real>(&self, depth: T) -> T {
        if *self == Self::Rigid { depth } else { T::infinity() }
    }

    pub(crate) fn is_equality(&self) -> bool {
        *self == Self::Equality
    }

    /// Whether the condition depends on the gap at the start of the stage. The gap of a closed row may then be
    /// negative.
    pub(crate) fn reads_start(&self) -> bool {
        matches!(self, Self::RateCondition | Self::PersistencySwitch)
    }

    /// Rejects parameters out of range. Also rejects a parameter if it or its reciprocal becomes zero or infinite in
    /// the scalar of a run.
    pub(crate) fn check<T: Real>(&self) -> Result<()> {
        let within = |name, value: f64, ok: bool, range| match ok {
            true => Ok(()),
            false => Err(Error::Parameter { name, value, range }),
        };
        let fits = |name, value: f64| {
            let own = T::of(value);
            let ok = own.is_finite() && own.recip().is_finite();
            within(
                name,
                value,
                ok,
                "a number of the scalar of the run, and its reciprocal too: choose other units, or f64",
            )
        };
        let stiff = |stiffness| fits("the contact stiffness", positive("the contact stiffness", stiffness)?);
        let power = |stiffness, exponent: f64| {
            stiff(stiffness)?;
            let ok = exponent >= 1.0 && exponent.is_finite();
            within("the exponent of the contact law", exponent, ok, "at least 1 and finite")?;
            fits("the contact stiffness times the exponent", stiffness * exponent)
        };
        // Zero is in range.
        let damps = |name, value: f64| {
            within(name, value, value >= 0.0 && value.is_finite(), "not negative and finite")?;
            if value > 0.0 { fits(name, value) } else { Ok(()) }
        };
        match *self {
            Self::Rigid | Self::Equality | Self::RateCondition | Self::PersistencySwitch => Ok(()),
            Self::Restitution { coefficient: e } => {
                within("the coefficient of restitution", e, (0.0..=1.0).contains(&e), "in [0, 1]")
            }
            Self::Penalty { stiffness } | Self::StabilizedBipenalty { stiffness } => stiff(stiffness),
            Self::AugmentedLagrangian { stiffness, augmentations } => {
                stiff(stiffness)?;
                let (name, range) =
                    ("the number of augmentations", "at most 10000: each of them solves the contact problem again");
                within(name, augmentations as f64, augmentations <= 10_000, range)
            }
            Self::PowerLaw { stiffness, exponent } => power(stiffness, exponent),
            Self::KelvinVoigt { stiffness, damping } => {
                stiff(stiffness)?;
                damps("the contact damping", damping)
            }
            Self::HuntCrossley { stiffness, exponent, dissipation } => {
                power(stiffness, exponent)?;
                damps("the dissipation of the contact law", dissipation)
            }
            Self::Bipenalty { stiffness, mass } => {
                stiff(stiffness)?;
                within("the contact mass", mass, mass >= 0.0 && mass.is_finite(), "not negative and finite")?;
                damps("the contact mass over the contact stiffness", self.inertia())
            }
        }
    }

    /// Weight of g̈ relative to g in the condition of a row (time²): m/k of a bipenalty.
    pub(crate) fn inertia(&self) -> f64 {
        match self {
            Self::Bipenalty { stiffness, mass } => mass / stiffness,
            _ => 0.0,
        }
    }

    /// The force of a compliant law for y, the gap with its inertia, and the rate of approach δ̇: zero if y ≥ 0.
    pub(crate) fn force<T: Real>(&self, y: T, approach: T) -> T {
        let depth = (-y).max(T::zero());
        match *self {
            Self::Penalty { stiffness }
            | Self::Bipenalty { stiffness, .. }
            | Self::StabilizedBipenalty { stiffness }
            | Self::AugmentedLagrangian { stiffness, .. } => T::of(stiffness) * depth,
            Self::PowerLaw { stiffness, exponent } => T::of(stiffness) * depth.powf(T::of(exponent)),
            Self::KelvinVoigt { .. } | Self::HuntCrossley { .. } if depth == T::zero() => T::zero(),
            Self::KelvinVoigt { .. } | Self::HuntCrossley { .. } => self.pull(depth, approach).max(T::zero()),
            _ => T::zero(),
        }
    }

    /// The force of a damped law, including negative values.
    fn pull<T: Real>(&self, depth: T, approach: T) -> T {
        match *self {
            Self::KelvinVoigt { stiffness, damping } => T::of(stiffness) * depth + T::of(damping) * approach,
            Self::HuntCrossley { stiffness, exponent, dissipation } => {
                T::of(stiffness) * depth.powf(T::of(exponent)) * (T::one() + T::of(dissipation) * approach)
            }
            _ => T::zero(),
        }
    }

    /// The derivatives of the force of a closed spring with respect to δ and δ̇.
    pub(crate) fn slopes(&self, force: f64, depth: f64) -> [f64; 2] {
        match *self {
            Self::Penalty { stiffness }
            | Self::Bipenalty { stiffness, .. }
            | Self::StabilizedBipenalty { stiffness }
            | Self::AugmentedLagrangian { stiffness, .. } => [stiffness, 0.0],
            Self::KelvinVoigt { stiffness, damping } => [stiffness, damping],
            // λ = k δ^p: dλ/dδ = p λ/δ.
            Self::PowerLaw { stiffness, exponent } => {
                [exponent * force / (force / stiffness).powf(exponent.recip()), 0.0]
            }
            Self::HuntCrossley { stiffness, exponent, dissipation } if depth > 0.0 => {
                [exponent * force / depth, dissipation * stiffness * depth.powf(exponent)]
            }
            _ => [0.0; 2],
        }
    }

    /// The energy stored in a damped spring at a gap. The dashpot dissipates it in the end.
    pub(crate) fn stored<T: Real>(&self, gap: T) -> T {
        let depth = (-gap).max(T::zero());
        match *self {
            Self::KelvinVoigt { stiffness, .. } => T::of(0.5 * stiffness) * depth * depth,
            Self::HuntCrossley { stiffness, exponent, .. } => {
                T::of(stiffness / (exponent + 1.0)) * depth.powf(T::of(exponent + 1.0))
            }
            _ => T::zero(),
        }
    }

    /// The law linearized at y as 0 ≤ y + c λ + s ⊥ λ ≥ 0; (c, s) = (0, 0) if it is rigid.
    ///
    /// Springs at smaller depths are linearized at the depth `least`. `force` is the last solution: the multiplier λ̂
    /// of an augmented Lagrangian. A dashpot that begins to press may bear any force up to c δ̇ at zero gap.
    pub(crate) fn linearized<T: Real>(&self, y: T, least: T, force: T, course: Course<T>) -> (T, T) {
        let depth = (-y).max(least);
        match *self {
            Self::Rigid | Self::Equality | Self::Restitution { .. } | Self::RateCondition | Self::PersistencySwitch => {
                (T::zero(), T::zero())
            }
            Self::Penalty { stiffness } | Self::Bipenalty { stiffness, .. } => (T::of(stiffness).recip(), T::zero()),
            // y is ḡ₊ − ⟨−ḡ₋⟩.
            Self::StabilizedBipenalty { stiffness } => (T::of(2.0 / stiffness), T::zero()),
            Self::AugmentedLagrangian { stiffness, .. } => {
                let compliance = T::of(stiffness).recip();
                (compliance, -compliance * force)
            }
            Self::PowerLaw { stiffness, exponent } => {
                let slope = T::of(stiffness * exponent) * depth.powf(T::of(exponent - 1.0));
                // At tiny depths the stiffness is tiny, but must not be zero.
                (slope.max(T::min_positive_value()).recip(), depth * (T::one() - T::of(exponent).recip()))
            }
            Self::KelvinVoigt { stiffness, damping } => {
                let [_, touching] = course.at(T::zero());
                let begins = course.moves() && touching > T::zero() && force <= T::of(damping) * touching;
                match begins {
                    true => (T::zero(), T::zero()),
                    false => course.tangent(self, -y, [T::of(stiffness), T::of(damping)]),
                }
            }
            Self::HuntCrossley { stiffness, exponent, dissipation } => {
                let x = if course.moves() { depth } else { -y };
                let [depth, approach] = course.at(x);
                let factor = (T::one() + T::of(dissipation) * approach).max(T::zero());
                let by_depth = T::of(stiffness * exponent) * depth.powf(T::of(exponent - 1.0)) * factor;
                let by_rate = T::of(stiffness * dissipation) * depth.powf(T::of(exponent));
                course.tangent(self, x, [by_depth, by_rate])
            }
        }
    }

    /// The number of further solutions of the stage with updated linearizations, even if the solution has converged.
    pub(crate) fn augmentations(&self) -> usize {
        match *self {
            Self::AugmentedLagrangian { augmentations, .. } => augmentations,
            _ => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{ContactLaw, Course};

    #[test]
    fn the_linearization_touches_the_law() {
        let law = ContactLaw::PowerLaw { stiffness: 3.0, exponent: 1.5 };
        for depth in [1e-3, 0.2, 5.0_f64] {
            let force = law.force(-depth, 0.0);
            let (c, s) = law.linearized(-depth, 0.0, 0.0, Course::at_rest());
            assert!((-depth + c * force + s).abs() < 1e-15 * depth.max(1.0));
            let slope = (law.force(-depth * (1.0 + 1e-6), 0.0) - force) / (depth * 1e-6);
            assert!((slope * c - 1.0).abs() < 1e-5);
            assert!((law.slopes(force, depth)[0] * c - 1.0).abs() < 1e-14);
        }
        let law = ContactLaw::AugmentedLagrangian { stiffness: 4.0, augmentations: 1 };
        let (c, s) = law.linearized(0.0, 0.0, 2.0_f64, Course::at_rest());
        let force = 2.0 + 4.0 * 0.5;
        assert!((-0.5 + c * force + s).abs() < 1e-15);
    }

    #[test]
    fn parameters_are_checked() {
        for law in [
            ContactLaw::Restitution { coefficient: 1.1 },
            ContactLaw::Restitution { coefficient: f64::NAN },
            ContactLaw::Penalty { stiffness: 0.0 },
            ContactLaw::PowerLaw { stiffness: 1.0, exponent: 0.5 },
            ContactLaw::PowerLaw { stiffness: f64::INFINITY, exponent: 1.5 },
            ContactLaw::Bipenalty { stiffness: 1.0, mass: -1.0 },
            ContactLaw::KelvinVoigt { stiffness: 0.0, damping: 1.0 },
            ContactLaw::KelvinVoigt { stiffness: 1.0, damping: -1.0 },
            ContactLaw::HuntCrossley { stiffness: 1.0, exponent: 0.9, dissipation: 1.0 },
            ContactLaw::HuntCrossley { stiffness: 1.0, exponent: 1.5, dissipation: f64::NAN },
            ContactLaw::StabilizedBipenalty { stiffness: -1.0 },
            ContactLaw::AugmentedLagrangian { stiffness: -1.0, augmentations: 3 },
            ContactLaw::AugmentedLagrangian { stiffness: 1.0, augmentations: usize::MAX },
        ] {
            assert!(law.check::<f64>().is_err(), "{law:?}");
        }
    }
}
