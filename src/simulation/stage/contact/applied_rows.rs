//! A contact problem of many rows on a body whose factor changes with every iteration: W is applied, not formed.

use crate::contact::ContactJacobian;
use crate::contact_solver::{AdmissibleSet, AppliedProblem, ContactSolver};
use crate::error::Result;
use crate::real::Real;
use crate::simulation::operator::Operator;

/// The rows of the problem, and its data with one entry per row.
pub(crate) struct AppliedRows<'p, T> {
    /// The rows along which forces act.
    pub(crate) g: &'p ContactJacobian<T>,
    pub(crate) rows: &'p [usize],
    /// Compliances of the laws.
    pub(crate) own: &'p [T],
    pub(crate) offset: &'p [T],
    pub(crate) sets: &'p [AdmissibleSet],
    pub(crate) tolerance: &'p [T],
}

impl<T: Real> AppliedRows<'_, T> {
    /// Solves for the multipliers, and leaves their forces and response in the vectors on the interface. Returns the
    /// iterations, or nothing if the solver needs a formed W. `scale` is scratch.
    pub(crate) fn solve(
        &self,
        operator: &mut Operator<T>,
        solver: &mut dyn ContactSolver<T>,
        [forces, response]: [&mut [T]; 2],
        scale: &mut Vec<T>,
        multipliers: &mut [T],
    ) -> Result<Option<usize>> {
        let Self { g, rows, own, offset, sets, tolerance } = *self;
        operator.scale(g, rows, scale);
        for (scale, &own) in scale.iter_mut().zip(own) {
            *scale += own;
        }
        let sound = scale.iter().all(|&scale| scale > T::zero() && scale.is_finite());
        if !sound {
            return Ok(None);
        }
        let mut failure = None;
        let mut product = |x: &[T], y: &mut [T]| {
            if let Err(error) = operator.apply(g, (rows, x), [&mut *forces, &mut *response], y) {
                failure.get_or_insert(error);
                y.fill(T::nan());
            }
            for ((y, &x), &own) in y.iter_mut().zip(x).zip(own) {
                *y += own * x;
            }
        };
        let mut problem = AppliedProblem { product: &mut product, scale, offset, sets, tolerance };
        let solved = solver.solve_applied(&mut problem, multipliers);
        if let Some(error) = failure {
            return Err(error);
        }
        let Some(Ok(iterations)) = solved else { return Ok(None) };
        operator.apply(g, (rows, multipliers), [forces, response], scale)?;
        Ok(Some(iterations))
    }
}
