//! Linear elastic bodies in plane strain: fenris assembles M and K once.

use crate::glue;
use contact_dynamics::faer::sparse::SparseColMat;
use fenris::assembly::global::CsrAssembler;
use fenris::assembly::local::{Density, ElementEllipticAssemblerBuilder, ElementMassAssembler};
use fenris::mesh::QuadMesh2d;
use fenris::nalgebra::DVector;
use fenris::quadrature::{CanonicalMassQuadrature, CanonicalStiffnessQuadrature};
use fenris_solid::MaterialEllipticOperator;
use fenris_solid::materials::{LameParameters, LinearElasticMaterial, YoungPoisson};

/// Steel of a soft kind, in units of m, kg and s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Material {
    pub(crate) young: f64,
    pub(crate) poisson: f64,
    pub(crate) density: f64,
}

impl Material {
    pub(crate) fn lame(&self) -> LameParameters<f64> {
        YoungPoisson { young: self.young, poisson: self.poisson }.into()
    }

    /// λ + 2μ, the stiffness against strain along one direction alone.
    pub(crate) fn wave_modulus(&self) -> f64 {
        let LameParameters { mu, lambda } = self.lame();
        lambda + 2.0 * mu
    }
}

/// A mesh with its matrices.
pub(crate) struct Body {
    pub(crate) nodes: Vec<[f64; 2]>,
    /// Nodes of the boundary.
    pub(crate) boundary: Vec<usize>,
    pub(crate) mass: SparseColMat<usize, f64>,
    pub(crate) stiffness: SparseColMat<usize, f64>,
}

impl Body {
    pub(crate) fn new(mesh: &QuadMesh2d<f64>, material: Material) -> Result<Self, Box<dyn std::error::Error>> {
        let assembler = CsrAssembler::default();
        let density = mesh.canonical_mass_quadrature().with_uniform_data(Density(material.density));
        let mass = ElementMassAssembler::with_solution_dim(2).with_space(mesh).with_quadrature_table(&density);
        let lame = mesh.canonical_stiffness_quadrature().with_uniform_data(material.lame());
        // (A linear operator is assembled at any u.)
        let rest = DVector::zeros(2 * mesh.vertices().len());
        let operator = MaterialEllipticOperator::new(&LinearElasticMaterial);
        let stiffness = ElementEllipticAssemblerBuilder::new()
            .with_finite_element_space(mesh)
            .with_operator(&operator)
            .with_quadrature_table(&lame)
            .with_u(&rest)
            .build();
        Ok(Self {
            nodes: glue::coordinates(mesh),
            boundary: mesh.find_boundary_vertices(),
            mass: glue::matrix(&assembler.assemble(&mass)?),
            stiffness: glue::matrix(&assembler.assemble(&stiffness)?),
        })
    }
}
