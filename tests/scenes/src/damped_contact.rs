//! Compliant contact with damping, as structural engineers have it for pounding: a force inside a system, by the five
//! methods that a host writes. (The contact laws of the crate know gaps, not their rates.)

use contact_dynamics::faer::sparse::SymbolicSparseColMatRef;
use contact_dynamics::{DampingForce, Error, LinearSystem, Mass, Result, System, TangentWeights};
use std::f64::consts::PI;

/// The force of a contact by its depth δ and the rate of that; none where it would pull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DampedLaw {
    /// k δ + c δ̇ (Anagnostopoulos, Earthq. Eng. Struct. Dyn. 16, 1988).
    KelvinVoigt {
        /// k (force/length).
        stiffness: f64,
        /// c (force time/length).
        damping: f64,
    },
    /// k δ^3/2 (1 + 3 (1 − e²)/(4 v₀) δ̇), v₀ the velocity of approach at first touch (Muthukumar and DesRoches,
    /// Earthq. Eng. Struct. Dyn. 35, 2006). A contact that began without approach has no damping.
    HertzDamp {
        /// k (force/length^3/2).
        stiffness: f64,
        /// e.
        restitution: f64,
    },
}

impl DampedLaw {
    /// Kelvin and Voigt's with c = 2 ξ √(k m), ξ = −ln e/√(π² + ln² e), m = m₁ m₂/(m₁ + m₂): the damping with which the
    /// whole half swing of two free masses, pulling at its end included, has the restitution e.
    pub fn kelvin_voigt(stiffness: f64, restitution: f64, masses: [f64; 2]) -> Self {
        let mass = masses[0] * masses[1] / (masses[0] + masses[1]);
        Self::KelvinVoigt { stiffness, damping: 2.0 * damping_ratio(restitution) * (stiffness * mass).sqrt() }
    }

    /// Force, and its derivatives by δ and δ̇.
    fn force(self, depth: f64, rate: f64, pair: &Pair) -> [f64; 3] {
        if depth <= 0.0 {
            return [0.0; 3];
        }
        let [force, by_depth, by_rate] = match self {
            Self::KelvinVoigt { stiffness, damping } => {
                let damping = if pair.closed { damping } else { 0.0 };
                [stiffness * depth + damping * rate, stiffness, damping]
            }
            Self::HertzDamp { stiffness, restitution } => {
                let own = if pair.approach > 0.0 { 0.75 * (1.0 - restitution.powi(2)) / pair.approach } else { 0.0 };
                let (spring, factor) = (stiffness * depth.powf(1.5), 1.0 + own * rate);
                [spring * factor, 1.5 * stiffness * depth.sqrt() * factor, spring * own]
            }
        };
        if force > 0.0 { [force, by_depth, by_rate] } else { [0.0; 3] }
    }

    fn check(self) -> Result<()> {
        let inside = |name, value: f64, ok: bool, range| match ok && value.is_finite() {
            true => Ok(()),
            false => Err(Error::Parameter { name, value, range }),
        };
        let (Self::KelvinVoigt { stiffness, .. } | Self::HertzDamp { stiffness, .. }) = self;
        inside("the contact stiffness", stiffness, stiffness > 0.0, "positive and finite")?;
        match self {
            Self::KelvinVoigt { damping, .. } => {
                inside("the contact damping", damping, damping >= 0.0, "not negative and finite")
            }
            Self::HertzDamp { restitution: e, .. } => {
                inside("the coefficient of restitution", e, (0.0..=1.0).contains(&e), "in [0, 1]")
            }
        }
    }
}

/// ξ = −ln e/√(π² + ln² e).
pub fn damping_ratio(restitution: f64) -> f64 {
    let log = restitution.ln();
    -log / PI.hypot(log)
}

/// The restitution of two free masses under Kelvin and Voigt's law, released when the force is zero and would pull:
/// exp(−ξ/√(1 − ξ²) · φ), φ the phase at release, tan φ = 2 ξ √(1 − ξ²)/(2 ξ² − 1) in (0, π] (Schwager and Pöschel,
/// Granul. Matter 9, 2007). A little more than the e from which ξ was taken.
pub fn restitution_without_pull(ratio: f64) -> f64 {
    let root = (1.0 - ratio * ratio).sqrt();
    (-ratio / root * (2.0 * ratio * root).atan2(2.0 * ratio * ratio - 1.0)).exp()
}

/// The restitution e′ of two free masses under [`DampedLaw::HertzDamp`]. From ∫ v dv/(1 + D v) over both halves, with
/// d = 3/4 (1 − e²): d (1 + e′) = ln (1 + d) − ln (1 − d e′). It is e only where that is near 1.
pub fn restitution_of_hertz_damp(nominal: f64) -> f64 {
    let d = 0.75 * (1.0 - nominal * nominal);
    let miss = |e: f64| (1.0 + d).ln() - (1.0 - d * e).ln() - d * (1.0 + e);
    // (The difference rises with e′ from below zero; at 1 it is positive. It is zero throughout without damping.)
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if miss(middle) <= 0.0 { low = middle } else { high = middle }
    }
    low
}

/// Two dofs that push each other apart when u[first] − u[second] exceeds the gap.
#[derive(Clone, Debug)]
struct Pair {
    dofs: [usize; 2],
    gap: f64,
    /// Places of (first, first), (second, second), (first, second) and (second, first) in the values of the pattern.
    places: [usize; 4],
    /// Whether it was closed when the step began: only then it has the damping of Kelvin and Voigt, whose force jumps
    /// at first touch. (With the jump inside a step there may be no solution at all.)
    closed: bool,
    /// The velocity of approach when it was open last.
    approach: f64,
}

impl Pair {
    fn depth(&self, u: &[f64]) -> f64 {
        u[self.dofs[0]] - u[self.dofs[1]] - self.gap
    }

    fn rate(&self, v: &[f64]) -> f64 {
        v[self.dofs[0]] - v[self.dofs[1]]
    }
}

/// A linear system with damped contacts between some of its dofs.
#[derive(Debug)]
pub struct DampedContact<'a> {
    linear: LinearSystem<'a, f64>,
    law: DampedLaw,
    pairs: Vec<Pair>,
    history: Vec<f64>,
}

impl<'a> DampedContact<'a> {
    /// Pairs of dofs with their gaps: the first pushes the second away when u[first] − u[second] > gap. The pattern of
    /// K must have places for both dofs of a pair together (entries may be zero).
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] for laws out of range, [`Error::Host`] for a pair that K has no place for.
    pub fn new(linear: LinearSystem<'a, f64>, law: DampedLaw, pairs: &[([usize; 2], f64)]) -> Result<Self> {
        law.check()?;
        let pattern = linear.pattern();
        let place = |row: usize, column: usize| {
            let range = if column < pattern.ncols() { pattern.col_range(column) } else { 0..0 };
            let found = pattern.row_idx()[range.clone()].binary_search(&row);
            found.map(|at| range.start + at).map_err(|_| Error::Host {
                callback: "damped contact",
                source: format!("the stiffness matrix has no place for dofs {row} and {column} together").into(),
            })
        };
        let pair = |&([i, j], gap): &([usize; 2], f64)| {
            let places = [place(i, i)?, place(j, j)?, place(i, j)?, place(j, i)?];
            Ok(Pair { dofs: [i, j], gap, places, closed: false, approach: 0.0 })
        };
        let pairs = pairs.iter().map(pair).collect::<Result<_>>()?;
        Ok(Self { linear, law, pairs, history: Vec::new() })
    }

    /// The forces at the end of each step taken, an entry a pair.
    pub fn history(&self) -> &[f64] {
        &self.history
    }
}

impl System<f64> for DampedContact<'_> {
    fn dofs(&self) -> usize {
        self.linear.dofs()
    }

    fn mass(&self) -> Mass<'_, f64> {
        self.linear.mass()
    }

    fn force(&mut self, t: f64, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        self.linear.force(t, u, v, out)?;
        for pair in &self.pairs {
            let [force, ..] = self.law.force(pair.depth(u), pair.rate(v), pair);
            out[pair.dofs[0]] -= force;
            out[pair.dofs[1]] += force;
        }
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.linear.pattern()
    }

    fn tangent(&mut self, t: f64, u: &[f64], v: &[f64], weights: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.linear.tangent(t, u, v, weights, out)?;
        for pair in &self.pairs {
            let [_, by_depth, by_rate] = self.law.force(pair.depth(u), pair.rate(v), pair);
            let slope = weights.stiffness * by_depth + weights.damping * by_rate;
            for (place, sign) in pair.places.into_iter().zip([1.0, 1.0, -1.0, -1.0]) {
                out[place] += sign * slope;
            }
        }
        Ok(())
    }

    fn damping_force(&mut self) -> Option<&mut dyn DampingForce<f64>> {
        Some(self)
    }

    fn external_load(&mut self, t: f64, out: &mut [f64]) -> Result<()> {
        self.linear.external_load(t, out)
    }

    fn commit(&mut self, _t: f64, u: &[f64], v: &[f64]) -> Result<()> {
        let force = |pair: &Pair| self.law.force(pair.depth(u), pair.rate(v), pair)[0];
        self.history.extend(self.pairs.iter().map(force));
        for pair in &mut self.pairs {
            pair.closed = pair.depth(u) > 0.0;
            if !pair.closed {
                pair.approach = pair.rate(v);
            }
        }
        Ok(())
    }
}

impl DampingForce<f64> for DampedContact<'_> {
    fn evaluate(&mut self, u: &[f64], v: &[f64], out: &mut [f64]) -> Result<()> {
        match self.linear.damping_force() {
            Some(damping) => damping.evaluate(u, v, out)?,
            None => out.fill(0.0),
        }
        for pair in &self.pairs {
            let [moving, still] = [pair.rate(v), 0.0].map(|rate| self.law.force(pair.depth(u), rate, pair)[0]);
            out[pair.dofs[0]] += moving - still;
            out[pair.dofs[1]] -= moving - still;
        }
        Ok(())
    }
}
