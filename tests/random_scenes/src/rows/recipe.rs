//! A scene as plain data in natural units, so that it can be printed, written differently, and made smaller.

use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::combinations::Correction;
use contact_dynamics_scenes::schemes;

/// Weights of dofs.
pub(super) type Terms = Vec<(usize, f64)>;

/// Everything that a run is made of.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// What it was drawn as.
    pub kind: &'static str,
    pub precision: Precision,
    /// Of length, mass and time.
    pub units: [f64; 3],
    /// Dof d is along axis d % axes.
    pub axes: usize,
    /// By dof.
    pub mass: Vec<f64>,
    pub elements: Vec<Element>,
    /// Rayleigh's factors, of mass and stiffness.
    pub damping: [f64; 2],
    pub displacement: Vec<f64>,
    pub velocity: Vec<f64>,
    pub load: Load,
    pub supports: Vec<Support>,
    pub rows: Vec<Row>,
    pub scheme: usize,
    pub correction: Correction,
    pub contact_solver: Contacting,
    pub linear_solver: Solving,
    pub tangent: Tangent,
    pub h: f64,
    pub steps: usize,
    pub control: Control,
    /// The step size is so many times `h` from these steps on.
    pub changes: Vec<(usize, f64)>,
    /// The balance of energy is kept.
    pub balance: bool,
    pub twin: Twin,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    Single,
    Double,
}

/// What the second run of a scene is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Twin {
    /// The same once more.
    Repeated,
    /// It begins at a state in the middle of the first one.
    Resumed,
    /// The same by files, as text and as bytes. (Without the feature `whole` of this package as `Resumed`.)
    Filed,
    /// By three threads, the first one by one. (Without the feature `whole` as `Repeated`.)
    Threaded,
    /// Units are powers of two times as large.
    PowersOfTwo([i32; 3]),
    /// Dofs and rows have other places.
    Permuted,
    /// Units are powers of ten times as large.
    PowersOfTen([i32; 3]),
    /// All bodies move on with a velocity along each axis, and what they meet with them.
    Moving,
}

/// A part of K, and what it adds to M and to the force.
#[derive(Clone, Debug)]
pub struct Element {
    pub dofs: Vec<usize>,
    /// Row by row.
    pub stiffness: Vec<f64>,
    /// Of two dofs: the mass that they share, as that of a bar, and k₃ of the force k₃ d³ between them.
    pub shared_mass: f64,
    pub hardening: f64,
    /// What makes it nonlinear; K is then that of no displacement.
    pub rubber: Option<Rubber>,
}

/// A triangle of a hyperelastic material in the plane: W = ½ μ (F:F − 2 J) + ½ λ (J − 1)².
#[derive(Clone, Debug)]
pub struct Rubber {
    /// Derivatives of the shape functions of its three nodes.
    pub gradients: [[f64; 2]; 3],
    /// Times its volume.
    pub lambda: f64,
    pub mu: f64,
}

impl Element {
    /// Between two dofs.
    pub(super) fn spring(i: usize, j: usize, k: f64) -> Self {
        Self { dofs: vec![i, j], stiffness: vec![k, -k, -k, k], shared_mass: 0.0, hardening: 0.0, rubber: None }
    }

    /// To the ground.
    pub(super) fn ground(i: usize, k: f64) -> Self {
        Self { dofs: vec![i], stiffness: vec![k], shared_mass: 0.0, hardening: 0.0, rubber: None }
    }

    /// Without one of its dofs, which is held: the others are named anew.
    pub(super) fn without(&self, dof: usize) -> Option<Self> {
        let n = self.dofs.len();
        let kept: Vec<usize> = (0..n).filter(|&i| self.dofs[i] != dof).collect();
        let stiffness = kept.iter().flat_map(|&i| kept.iter().map(move |&j| (i, j)));
        let stiffness = stiffness.map(|(i, j)| self.stiffness[n * i + j]).collect();
        let dofs: Vec<usize> = kept.iter().map(|&i| self.dofs[i]).map(|d| d - usize::from(d > dof)).collect();
        let whole = dofs.len() == n;
        let [shared_mass, hardening] = [self.shared_mass, self.hardening].map(|x| if whole { x } else { 0.0 });
        // (What is left of a triangle is linear.)
        let rubber = self.rubber.clone().filter(|_| whole);
        (!dofs.is_empty()).then_some(Self { dofs, stiffness, shared_mass, hardening, rubber })
    }
}

/// F(t) = constant + amplitude sin(frequency t), by dof; empty if there is none.
#[derive(Clone, Debug, Default)]
pub struct Load {
    pub constant: Vec<f64>,
    pub amplitude: Vec<f64>,
    pub frequency: f64,
}

/// u = amplitude sin(frequency t) at a dof; 0 for one that is held.
#[derive(Clone, Copy, Debug)]
pub struct Support {
    pub dof: usize,
    pub amplitude: f64,
    pub frequency: f64,
}

/// A row G u + gap + amplitude sin(frequency t).
#[derive(Clone, Debug)]
pub struct Row {
    pub terms: Terms,
    pub gap: f64,
    pub amplitude: f64,
    pub frequency: f64,
    /// With stiffnesses and masses in natural units.
    pub law: ContactLaw,
    /// The coefficient, and one or two tangents.
    pub friction: Option<(f64, Vec<Terms>)>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contacting {
    Default,
    Pivoting,
    GaussSeidel,
    /// Projected conjugate gradients wherever they are possible.
    WithoutW,
}

impl Contacting {
    /// Whether forces are found by an iteration that ends at a tolerance.
    pub fn iterates(self) -> bool {
        matches!(self, Self::GaussSeidel | Self::WithoutW)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solving {
    Default,
    ByBody,
    Cholesky,
    Lu,
    ConjugateGradients,
    Tridiagonal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tangent {
    Full,
    Modified,
    LineSearch,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Control {
    None,
    Halving,
    /// Refuses local errors beyond this.
    LocalError(f64),
    ContactChanges(usize),
}

impl Recipe {
    pub fn dofs(&self) -> usize {
        self.mass.len()
    }

    pub(super) fn has_mass(&self) -> bool {
        self.masses().next().is_some()
    }

    /// Of the dofs that have some: those of points, and what elements give to each (the least that moves with it).
    pub(super) fn masses(&self) -> impl Iterator<Item = f64> {
        let mut masses = self.mass.clone();
        for element in self.elements.iter().filter(|element| element.shared_mass > 0.0) {
            element.dofs.iter().for_each(|&dof| masses[dof] += element.shared_mass);
        }
        masses.into_iter().filter(|m| *m > 0.0)
    }

    /// What it is made of, in a line.
    #[must_use]
    pub fn summary(&self) -> String {
        let laws: Vec<_> = self.rows.iter().map(|row| format!("{:?}", row.law)).collect();
        let laws: Vec<_> = laws.iter().map(|law| law.split(' ').next().unwrap_or_default()).collect();
        let Self { kind, precision, correction, contact_solver, linear_solver, control, .. } = self;
        format!(
            "{kind}, {precision:?}, {} dofs, {}, {}, {contact_solver:?}, {linear_solver:?}, {control:?}, {} changes, \
             damping {:?}, {} massless, {} rub, {:?}, rows {}",
            self.dofs(),
            (schemes::all()[self.scheme].make)().name(),
            correction.name(),
            self.changes.len(),
            self.damping,
            self.mass.iter().filter(|m| **m == 0.0).count(),
            self.rows.iter().filter(|row| row.friction.is_some()).count(),
            self.twin,
            laws.join(" "),
        )
    }

    /// Whether no spring, support, damper, load or row acts from outside along an axis: rigid motions are free.
    pub(super) fn is_free(&self) -> bool {
        let rigid = |terms: &Terms| (0..self.axes).all(|axis| self.along(terms, axis).abs() < 1e-12);
        let is_held = |element: &Element| {
            let n = element.dofs.len();
            let largest = element.stiffness.iter().fold(0.0_f64, |most, k| most.max(k.abs()));
            (0..n).any(|i| {
                let sum = |axis: usize| -> f64 {
                    let along = (0..n).filter(|&j| element.dofs[j] % self.axes == axis);
                    along.map(|j| element.stiffness[n * i + j]).sum()
                };
                (0..self.axes).any(|axis| sum(axis).abs() > 1e-12 * largest)
            })
        };
        let loaded = [&self.load.constant, &self.load.amplitude].iter().any(|f| f.iter().any(|f| *f != 0.0));
        let drags = self.damping[0] > 0.0;
        let rubs = |row: &Row| row.friction.as_ref().is_none_or(|(_, tangents)| tangents.iter().all(rigid));
        !loaded
            && !drags
            && self.supports.is_empty()
            && !self.elements.iter().any(is_held)
            && self.rows.iter().all(|row| rigid(&row.terms) && rubs(row))
    }

    /// Whether momentum is conserved: nothing acts from outside, and nothing is known to change it.
    #[must_use]
    pub fn conserves_momentum(&self) -> bool {
        self.is_free() && self.correction != Correction::ZeroAcceleration
    }

    /// What a row makes of a unit along an axis.
    pub(super) fn along(&self, terms: &Terms, axis: usize) -> f64 {
        terms.iter().filter(|(dof, _)| dof % self.axes == axis).map(|(_, weight)| weight).sum()
    }

    /// Dofs and rows at other places: `dofs[d]` is where dof d goes, `rows[r]` which row comes at place r. The axes
    /// are then no more than names.
    pub(super) fn permuted(&self, dofs: &[usize], rows: &[usize]) -> Self {
        let placed = |x: &[f64]| {
            let mut y = vec![0.0; x.len()];
            x.iter().zip(dofs).for_each(|(x, &dof)| y[dof] = *x);
            y
        };
        let terms = |terms: &Terms| terms.iter().map(|&(dof, weight)| (dofs[dof], weight)).collect::<Terms>();
        let row = |row: &Row| Row {
            terms: terms(&row.terms),
            friction: row.friction.as_ref().map(|(mu, tangents)| (*mu, tangents.iter().map(terms).collect())),
            ..row.clone()
        };
        let element = |e: &Element| Element { dofs: e.dofs.iter().map(|&dof| dofs[dof]).collect(), ..e.clone() };
        Self {
            mass: placed(&self.mass),
            elements: self.elements.iter().rev().map(element).collect(),
            displacement: placed(&self.displacement),
            velocity: placed(&self.velocity),
            load: Load {
                constant: placed(&self.load.constant),
                amplitude: placed(&self.load.amplitude),
                frequency: self.load.frequency,
            },
            supports: self.supports.iter().map(|s| Support { dof: dofs[s.dof], ..*s }).collect(),
            rows: rows.iter().map(|&place| row(&self.rows[place])).collect(),
            ..self.clone()
        }
    }
}
