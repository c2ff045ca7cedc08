//! What may be done with the mass of a body that touches others: lumped, consistent, blended, redistributed.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::mass::{self, Redistribution};
use contact_dynamics::tableau::Tableau;
use contact_dynamics::{Error, LinearSystem, Mass, Result};

/// A mass matrix, diagonal or not.
#[derive(Clone, Debug)]
pub enum MassMatrix {
    Lumped(Vec<f64>),
    Matrix(SparseColMat<usize, f64>),
}

impl MassMatrix {
    /// The system with this mass and a stiffness.
    pub fn system(self, stiffness: SparseColMat<usize, f64>) -> Result<LinearSystem<'static, f64>> {
        match self {
            Self::Lumped(mass) => LinearSystem::lumped(mass, stiffness),
            Self::Matrix(mass) => LinearSystem::new(mass, stiffness),
        }
    }

    /// The matrix.
    pub fn into_matrix(self) -> SparseColMat<usize, f64> {
        match self {
            Self::Lumped(mass) => crate::sparse::diagonal(&mass),
            Self::Matrix(mass) => mass,
        }
    }

    /// The sum of each row.
    pub fn row_sums(&self) -> Vec<f64> {
        match self {
            Self::Lumped(mass) => mass.clone(),
            Self::Matrix(mass) => {
                let mut sums = vec![0.0; mass.nrows()];
                Mass::Consistent(mass.as_ref()).product(1.0, &vec![1.0; mass.ncols()], &mut sums).unwrap();
                sums
            }
        }
    }
}

/// What a treatment of the mass needs of a body.
#[derive(Clone, Debug)]
pub struct Body {
    pub consistent: SparseColMat<usize, f64>,
    pub stiffness: SparseColMat<usize, f64>,
    /// Dofs that may become massless.
    pub contact: Vec<usize>,
    /// One number a body and direction.
    pub groups: Vec<usize>,
    /// Motions whose momentum and energy least squares keep.
    pub motions: Vec<Vec<f64>>,
}

/// Who takes the mass of massless contact dofs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Takers {
    Neighbors,
    Uniform,
    Tapered,
    LeastSquares,
}

/// A treatment of the mass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Treatment {
    Lumped,
    Consistent,
    /// The blend whose dispersion makes up for the scheme's, up to the consistent mass.
    Blend,
    /// The lumped mass without that of the contact dofs.
    Redistributed(Takers),
    /// The blend without the mass of the contact dofs.
    RedistributedBlend(Takers),
}

/// What neighbors give away, as in the presets.
const TAPER: f64 = 0.15;

impl Treatment {
    /// Name in tables.
    pub fn name(self) -> String {
        let takers = |takers| match takers {
            Takers::Neighbors => "neighbors",
            Takers::Uniform => "uniform",
            Takers::Tapered => "tapered",
            Takers::LeastSquares => "least squares",
        };
        match self {
            Self::Lumped => "lumped".into(),
            Self::Consistent => "consistent".into(),
            Self::Blend => "blend".into(),
            Self::Redistributed(to) => format!("massless, lumped, {}", takers(to)),
            Self::RedistributedBlend(to) => format!("massless, blend, {}", takers(to)),
        }
    }

    /// Whether contact dofs have no mass.
    pub fn is_massless(self) -> bool {
        matches!(self, Self::Redistributed(_) | Self::RedistributedBlend(_))
    }

    /// The matrix for a scheme whose Courant number at the contact is given.
    pub fn mass(self, body: &Body, tableau: &Tableau, courant: f64) -> Result<MassMatrix> {
        let lumped = mass::lump(body.consistent.as_ref())?;
        let weight = match mass::optimal_weight(tableau, courant) {
            Ok(weight) => weight.clamp(0.0, 1.0),
            // Beyond what is definite: the consistent mass. No optimum: halfway.
            Err(Error::Parameter { .. }) => 1.0,
            Err(_) => 0.5,
        };
        let blend = || mass::blend(body.consistent.as_ref(), &lumped, weight);
        let by = |takers| match takers {
            Takers::Neighbors => Redistribution::Neighbors(body.stiffness.symbolic()),
            Takers::Uniform => Redistribution::Uniform,
            Takers::Tapered => Redistribution::Tapered { neighbors: body.stiffness.symbolic(), fraction: TAPER },
            Takers::LeastSquares => Redistribution::LeastSquares { motions: &body.motions, receivers: None },
        };
        let (contact, groups) = (&body.contact, &body.groups);
        Ok(match self {
            Self::Lumped => MassMatrix::Lumped(lumped),
            Self::Consistent => MassMatrix::Matrix(body.consistent.clone()),
            Self::Blend => MassMatrix::Matrix(blend()?),
            Self::Redistributed(to) => MassMatrix::Lumped(mass::redistribute(&lumped, contact, groups, by(to))?),
            Self::RedistributedBlend(to) => {
                MassMatrix::Matrix(mass::redistribute_consistent(blend()?.as_ref(), contact, groups, by(to))?)
            }
        })
    }
}

impl Body {
    /// The Courant number at the contact: the largest of its dofs.
    pub fn courant(&self, h: f64) -> Result<f64> {
        let courant = mass::courant(Mass::Consistent(self.consistent.as_ref()), self.stiffness.as_ref(), h)?;
        Ok(self.contact.iter().map(|&dof| courant[dof]).fold(0.0, f64::max))
    }

    /// The largest Courant number, which explicit schemes must keep below 1.
    pub fn largest_courant(&self, h: f64) -> Result<f64> {
        let courant = mass::courant(Mass::Consistent(self.consistent.as_ref()), self.stiffness.as_ref(), h)?;
        Ok(courant.into_iter().fold(0.0, f64::max))
    }
}
