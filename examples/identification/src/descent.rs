//! L-BFGS with values and gradients of runs.

use argmin::core::{CostFunction, Error, Executor, Gradient, State};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use std::cell::{Cell, RefCell};

/// J and its derivatives at some parameters.
pub(crate) type Evaluation = (f64, Vec<f64>);

/// A function of parameters, for `argmin`, which asks for values and gradients one after the other.
struct Problem<F> {
    evaluate: F,
    last: RefCell<Option<(Vec<f64>, Evaluation)>>,
    runs: Cell<usize>,
}

impl<F: Fn(&[f64]) -> Result<Evaluation, Error>> Problem<F> {
    fn at(&self, x: &[f64]) -> Result<Evaluation, Error> {
        let mut last = self.last.borrow_mut();
        if let Some((_, found)) = last.as_ref().filter(|(at, _)| at == x) {
            return Ok(found.clone());
        }
        self.runs.set(self.runs.get() + 1);
        let found = (self.evaluate)(x)?;
        *last = Some((x.to_vec(), found.clone()));
        Ok(found)
    }
}

impl<F: Fn(&[f64]) -> Result<Evaluation, Error>> CostFunction for &Problem<F> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, x: &Vec<f64>) -> Result<f64, Error> {
        Ok(self.at(x)?.0)
    }
}

impl<F: Fn(&[f64]) -> Result<Evaluation, Error>> Gradient for &Problem<F> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(self.at(x)?.1)
    }
}

/// What a descent found.
pub(crate) struct Found {
    pub(crate) parameters: Vec<f64>,
    pub(crate) value: f64,
    pub(crate) iterations: u64,
    pub(crate) runs: usize,
}

/// Goes down from some parameters.
///
/// # Errors
///
/// Those of the evaluation, and of a line search that finds no better point.
pub(crate) fn descend(
    start: &[f64],
    iterations: u64,
    evaluate: impl Fn(&[f64]) -> Result<Evaluation, Error>,
) -> Result<Found, Error> {
    let problem = Problem { evaluate, last: RefCell::new(None), runs: Cell::new(0) };
    let search = MoreThuenteLineSearch::new().with_c(1e-4, 0.9)?;
    let solver = LBFGS::new(search, 7).with_tolerance_grad(1e-9)?.with_tolerance_cost(1e-13)?;
    let from = start.to_vec();
    let result = Executor::new(&problem, solver).configure(|state| state.param(from).max_iters(iterations)).run()?;
    let state = result.state();
    Ok(Found {
        parameters: state.get_best_param().cloned().unwrap_or_else(|| start.to_vec()),
        value: state.get_best_cost(),
        iterations: state.get_iter(),
        runs: problem.runs.get(),
    })
}
