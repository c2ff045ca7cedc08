//! Schemes of the literature as bare tableaux, to test that nothing in the library knows an integrator by name.

use contact_dynamics::TimeIntegrator;
use contact_dynamics::tableau::{A, MAX_PAST, Row, Rows, Stage, Tableau, U, V, Z};

/// A tableau with a name.
#[derive(Clone, Debug)]
pub struct Listed {
    pub name: &'static str,
    pub tableau: Tableau,
}

impl TimeIntegrator for Listed {
    fn name(&self) -> String {
        self.name.into()
    }
    fn tableau(&self) -> Tableau {
        self.tableau.clone()
    }
}

fn single(name: &'static str, v: Row, a: Row) -> Listed {
    Listed { name, tableau: Tableau::single(Stage::new(Rows { u: Z, v, a })) }
}

/// Bathe's two-stage scheme with γ = 2 − √2.
pub fn bathe() -> Listed {
    let gamma = 2.0 - f64::sqrt(2.0);
    let q1 = 1.0 / (4.0 - 2.0 * gamma);
    let q2 = 0.5 - gamma * q1;
    let q0 = 1.0 - q1 - q2;
    let v = (2.0 / gamma) * (Z - U[0]) - V[0];
    let a = (4.0 / (gamma * gamma)) * (Z - U[0] - gamma * V[0]) - A[0];
    let first = Stage::new(Rows { u: Z, v, a }).ending_at(gamma);
    let v = (Z - U[1] - q0 * V[1] - q1 * V[0]) / q2;
    let a = (v - V[1] - q0 * A[1] - q1 * A[0]) / q2;
    Listed { name: "Bathe", tableau: Tableau::staged(vec![first, Stage::new(Rows { u: Z, v, a })]) }
}

/// Generalized-α of Chung and Hulbert by its spectral radius at infinity.
pub fn chung_hulbert(rho: f64) -> Listed {
    let (am, af) = ((2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0));
    let (gamma, beta) = (0.5 - am + af, 0.25 * (1.0 - am + af) * (1.0 - am + af));
    let a = (Z - U[0] - V[0]) / beta - ((0.5 - beta) / beta) * A[0];
    let v = V[0] + (1.0 - gamma) * A[0] + gamma * a;
    let balance = Rows { u: (1.0 - af) * Z + af * U[0], v: (1.0 - af) * v + af * V[0], a: (1.0 - am) * a + am * A[0] };
    let stage = Stage::new(Rows { u: Z, v, a }).balanced(balance, 1.0 - af);
    Listed { name: "Chung-Hulbert", tableau: Tableau::single(stage) }
}

/// Houbolt.
pub fn houbolt() -> Listed {
    let v = (11.0 * Z - 18.0 * U[0] + 9.0 * U[1] - 2.0 * U[2]) / 6.0;
    single("Houbolt", v, 2.0 * Z - 5.0 * U[0] + 4.0 * U[1] - U[2])
}

/// Park.
pub fn park() -> Listed {
    let d = |x: Row, y: [Row; MAX_PAST]| (10.0 * x - 15.0 * y[0] + 6.0 * y[1] - y[2]) / 6.0;
    let v = d(Z, U);
    single("Park", v, d(v, V))
}

/// BDF2 on displacement and velocity.
pub fn bdf2() -> Listed {
    let d = |x: Row, y: [Row; MAX_PAST]| 1.5 * x - 2.0 * y[0] + 0.5 * y[1];
    let v = d(Z, U);
    single("BDF2", v, d(v, V))
}
