//! Linear elastic bodies in plane strain: fenris assembles M and K once.

use crate::glue;
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics_scenes::solids::Material;
use fenris::assembly::global::CsrAssembler;
use fenris::assembly::local::{Density, ElementEllipticAssemblerBuilder, ElementMassAssembler};
use fenris::mesh::QuadMesh2d;
use fenris::nalgebra::DVector;
use fenris::quadrature::{CanonicalMassQuadrature, CanonicalStiffnessQuadrature};
use fenris_solid::MaterialEllipticOperator;
use fenris_solid::materials::{LameParameters, LinearElasticMaterial, YoungPoisson};

/// The constants of a material as fenris takes them.
pub(crate) fn lame(material: &Material) -> LameParameters<f64> {
    YoungPoisson { young: material.young, poisson: material.poisson }.into()
}

/// λ + 2μ, the stiffness against strain along one direction alone.
pub(crate) fn wave_modulus(material: &Material) -> f64 {
    let LameParameters { mu, lambda } = lame(material);
    lambda + 2.0 * mu
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
        let lame = mesh.canonical_stiffness_quadrature().with_uniform_data(lame(&material));
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

#[cfg(test)]
mod tests {
    use super::*;
    use contact_dynamics_scenes::solids::Solid;
    use fenris::mesh::procedural::create_rectangular_uniform_quad_mesh_2d;
    use fenris::nalgebra::Vector2;

    /// The largest difference of two matrices over the largest entry.
    fn difference(one: &SparseColMat<usize, f64>, other: &SparseColMat<usize, f64>) -> f64 {
        let (one, other) = (one.to_dense(), other.to_dense());
        (&one - &other).norm_max() / one.norm_max()
    }

    /// Two codes that know nothing of each other assemble the same matrices on a distorted mesh.
    #[test]
    fn matrices_are_those_of_another_code() {
        let material = Material { young: 3.0, poisson: 0.3, density: 0.7 };
        let mut mesh = create_rectangular_uniform_quad_mesh_2d(1.0, 2, 1, 3, &Vector2::new(0.0, 1.0));
        mesh.transform_vertices(|vertex| {
            let (x, y): (f64, f64) = (vertex.x, vertex.y);
            vertex.x += 0.1 * (3.0 * y).sin();
            vertex.y += 0.1 * (2.0 * x).cos() * y;
        });
        let body = Body::new(&mesh, material).unwrap();
        let other = Solid::<2> {
            nodes: body.nodes.clone(),
            elements: mesh.connectivity().iter().map(|quad| quad.0.to_vec()).collect(),
            material,
        };
        assert!(difference(&body.stiffness, &other.stiffness()) < 1e-13);
        assert!(difference(&body.mass, &other.consistent_mass()) < 1e-13);
    }
}
