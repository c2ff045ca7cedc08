//! A neo-Hookean body at large strains: a `System` whose force and tangent fenris assembles in every Newton iteration.

use crate::elastic::lame;
use crate::glue;
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{Error, Mass, Result, System, TangentWeights};
use contact_dynamics_scenes::solids::Material;
use fenris::assembly::global::{CsrAssembler, VectorAssembler, assemble_scalar};
use fenris::assembly::local::{
    Density, ElementEllipticAssembler, ElementEllipticAssemblerBuilder, ElementMassAssembler, UniformQuadratureTable,
};
use fenris::mesh::HexMesh;
use fenris::nalgebra::{DVectorView, DVectorViewMut, U3};
use fenris::nalgebra_sparse::CsrMatrix;
use fenris::quadrature::{CanonicalMassQuadrature, CanonicalStiffnessQuadrature};
use fenris_solid::MaterialEllipticOperator;
use fenris_solid::materials::{LameParameters, NeoHookeanMaterial};

type Operator = MaterialEllipticOperator<'static, NeoHookeanMaterial>;
type Quadrature = UniformQuadratureTable<f64, U3, LameParameters<f64>>;

/// A mesh of hexahedra with its material; no load but gravity.
pub(crate) struct Hyperelastic {
    pub(crate) mesh: HexMesh<f64>,
    operator: Operator,
    quadrature: Quadrature,
    mass: SparseColMat<usize, f64>,
    weight: Vec<f64>,
    pattern: SymbolicSparseColMat<usize>,
    vectors: VectorAssembler<f64>,
    matrices: CsrAssembler<f64>,
    /// K where it was assembled last.
    tangent: CsrMatrix<f64>,
}

impl Hyperelastic {
    pub(crate) fn new(mesh: HexMesh<f64>, material: Material, gravity: [f64; 3]) -> Result<Self> {
        let matrices = CsrAssembler::default();
        let density = mesh.canonical_mass_quadrature().with_uniform_data(Density(material.density));
        let mass = ElementMassAssembler::with_solution_dim(3).with_space(&mesh).with_quadrature_table(&density);
        let mass = glue::matrix(&matrices.assemble(&mass).map_err(|report| host("mass", report))?);
        let dofs = mass.nrows();
        let pull: Vec<f64> = (0..dofs).map(|dof| gravity[dof % 3]).collect();
        let mut weight = vec![0.0; dofs];
        Mass::Consistent(mass.as_ref()).product(1.0, &pull, &mut weight)?;
        let quadrature = mesh.canonical_stiffness_quadrature().with_uniform_data(lame(&material));
        let operator = MaterialEllipticOperator::new(&NeoHookeanMaterial);
        let rest = vec![0.0; dofs];
        let elements = elements(&mesh, &operator, &quadrature, &rest);
        let tangent = matrices.assemble(&elements).map_err(|report| host("tangent", report))?;
        let pattern = glue::pattern(tangent.pattern());
        let vectors = VectorAssembler::default();
        Ok(Self { mesh, operator, quadrature, mass, weight, pattern, vectors, matrices, tangent })
    }

    /// The strain energy; infinite where an element is turned inside out.
    fn energy(&self, u: &[f64], callback: &'static str) -> Result<f64> {
        let elements = elements(&self.mesh, &self.operator, &self.quadrature, u);
        assemble_scalar(&elements).map_err(|report| host(callback, report))
    }

    /// fenris has no stresses of elements that are turned inside out, and panics for their tangents.
    fn check(&self, u: &[f64], callback: &'static str) -> Result<()> {
        match self.energy(u, callback)?.is_finite() {
            true => Ok(()),
            false => Err(Error::Inadmissible { callback, source: "an element is turned inside out".into() }),
        }
    }
}

/// What fenris assembles of the elements at u.
fn elements<'a>(
    mesh: &'a HexMesh<f64>,
    operator: &'a Operator,
    quadrature: &'a Quadrature,
    u: &'a [f64],
) -> ElementEllipticAssembler<'a, f64, HexMesh<f64>, Operator, Quadrature> {
    ElementEllipticAssemblerBuilder::new()
        .with_finite_element_space(mesh)
        .with_operator(operator)
        .with_quadrature_table(quadrature)
        .with_u(DVectorView::from_slice(u, u.len()))
        .build()
}

/// An error of fenris as one of a host.
fn host(callback: &'static str, report: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::Host { callback, source: report.into() }
}

impl System<f64> for Hyperelastic {
    fn dofs(&self) -> usize {
        self.weight.len()
    }

    fn mass(&self) -> Mass<'_, f64> {
        Mass::Consistent(self.mass.as_ref())
    }

    fn force(&mut self, _t: f64, u: &[f64], _v: &[f64], out: &mut [f64]) -> Result<()> {
        self.check(u, "force")?;
        out.fill(0.0);
        let (size, elements) = (out.len(), elements(&self.mesh, &self.operator, &self.quadrature, u));
        let internal = DVectorViewMut::from_slice(out, size);
        self.vectors.assemble_vector_into(internal, &elements).map_err(|report| host("force", report))?;
        out.iter_mut().zip(&self.weight).for_each(|(force, weight)| *force = weight - *force);
        Ok(())
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }

    fn tangent(&mut self, _t: f64, u: &[f64], _v: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        self.check(u, "tangent")?;
        self.tangent.values_mut().fill(0.0);
        let elements = elements(&self.mesh, &self.operator, &self.quadrature, u);
        let assembled = self.matrices.assemble_into_csr(&mut self.tangent, &elements);
        assembled.map_err(|report| host("tangent", report))?;
        out.iter_mut().zip(self.tangent.values()).for_each(|(out, k)| *out = w.stiffness * k);
        Ok(())
    }

    fn potential_energy(&mut self, u: &[f64]) -> Option<f64> {
        self.energy(u, "potential_energy").ok()
    }

    fn external_load(&mut self, _t: f64, out: &mut [f64]) -> Result<()> {
        out.copy_from_slice(&self.weight);
        Ok(())
    }
}
