//! Numbers derived from the rows of a scheme, and cached from one run to the next: deriving them takes longer than
//! ten steps of a small system, and a study of a thousand runs has one scheme.

use crate::analysis::{self, Order, ZeroStability};
use crate::integrator::{Newmark, TimeIntegrator};
use crate::tableau::Tableau;
use std::cell::RefCell;
use std::sync::{Arc, OnceLock};

/// Numbers derived from a tableau.
#[derive(Debug)]
pub(crate) struct Derived {
    pub(crate) order: Order,
    pub(crate) zero_stability: ZeroStability,
    pub(crate) radius_at_infinity: Option<f64>,
    /// The one-step scheme of the first steps.
    pub(crate) starter: Tableau,
    /// The momentum covector for 1, 2, … known states; the last one belongs to the scheme itself.
    pub(crate) covectors: Vec<Vec<[f64; 3]>>,
    critical: OnceLock<Option<f64>>,
}

impl Derived {
    /// From a checked tableau. The last result of the thread is cached with its tableau.
    pub(crate) fn of(tableau: &Tableau) -> Arc<Self> {
        thread_local! {
            static LAST: RefCell<Option<(Tableau, Arc<Derived>)>> = const { RefCell::new(None) };
        }
        LAST.with_borrow_mut(|last| match last {
            Some((of, derived)) if of == tableau => derived.clone(),
            _ => {
                let derived = Arc::new(Self::new(tableau));
                *last = Some((tableau.clone(), derived.clone()));
                derived
            }
        })
    }

    fn new(tableau: &Tableau) -> Self {
        let starter = Newmark::trapezoidal().tableau();
        Self {
            order: analysis::order(tableau),
            zero_stability: analysis::zero_stability(tableau),
            radius_at_infinity: analysis::radius_at_infinity(tableau),
            covectors: tableau.momentum().during_start(&starter.stages[0]),
            starter,
            critical: OnceLock::new(),
        }
    }

    /// The critical Ω of the tableau without damping, computed at the first call.
    pub(crate) fn critical(&self, tableau: &Tableau) -> Option<f64> {
        *self.critical.get_or_init(|| analysis::critical_omega(tableau, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrator::Composite;

    #[test]
    fn another_scheme_is_derived_anew() {
        let [one, other] = [Newmark::trapezoidal().tableau(), Composite.tableau()];
        let first = Derived::of(&one);
        assert!(Arc::ptr_eq(&first, &Derived::of(&one)));
        let second = Derived::of(&other);
        assert_ne!(first.covectors, second.covectors);
        assert_eq!(Derived::of(&one).covectors, first.covectors);
    }
}
