//! Input that could be read in two ways: refused, or read in the one way that all parts share.
#![allow(clippy::float_cmp)] // unchanged values are meant exactly

use contact_dynamics::contact::{Candidates, Contacts, GapOffset, GapRates, Rates};
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    Composite, ContactConstraint, ContactLaw, Error, LinearRows, Mass, Newmark, PersistencyCorrection, Result,
    Simulation, StepControl, System, TangentWeights, verify,
};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::sparse::{free, matrix};
use std::cell::Cell;
use std::f64::consts::TAU;

#[test]
fn normals_of_pairs_have_any_length() {
    let row = |normal: [f64; 2]| {
        let rows = LinearRows::new().pair(ContactLaw::Rigid, [0, 1], [2, 3], normal, 0.25)?;
        Ok::<_, Error>(rows.jacobian())
    };
    let unit = row([0.6, 0.8]).unwrap();
    for length in [1e-200, 0.5, 2.0, 1e200] {
        let g = row([0.6 * length, 0.8 * length]).unwrap();
        for ((dof, weight), (other, expected)) in g.row(0).zip(unit.row(0)) {
            assert!(dof == other && (weight - expected).abs() < 1e-15, "{length:e}");
        }
    }
    assert!(matches!(row([0.0, 0.0]), Err(Error::Parameter { value: 0.0, .. })));
    assert!(matches!(row([f64::NAN, 1.0]), Err(Error::NotFinite { index: 0, .. })));
    // The force of a weight on a floor whose normal is given twice as long.
    let system = free(&[1.0; 2]).load(|_, f: &mut [f64]| f[1] = -10.0).fix(0).unwrap();
    let floor = LinearRows::new().pair(ContactLaw::Rigid, [0], [1], [2.0], 0.0).unwrap();
    let mut run = Simulation::builder(system, Newmark::trapezoidal(), 0.1)
        .constraint(floor)
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
        .unwrap();
    run.step().unwrap();
    assert!((run.state().contacts().forces()[0] - 10.0).abs() < 1e-12);
}

/// A gap over a wall at z(t) with the rates given, from a start at t.
fn over_wall(
    t: f64,
    h: f64,
    scale: f64,
    wall: impl FnMut(f64) -> [f64; 3] + Send + 'static,
) -> Result<Simulation<'static, f64>> {
    Simulation::builder(free(&[1.0; 1]), Newmark::trapezoidal(), h)
        .start_time(t)
        .displacement(vec![scale])
        .constraint(LinearRows::new().unilateral(&[(0, 1.0)], GapOffset::moving(wall)))
        .corrector(PersistencyCorrection::with_history_projection())
        .build()
}

#[test]
fn walls_that_move_without_rates_are_refused() {
    for (t, h) in [(0.0, 1e-3), (0.0, 1e-9), (1e6, 1e-3), (-5.0, 1e3), (1e-12, 1e-15)] {
        for scale in [1e-9, 1.0, 1e9] {
            let speed = 0.1 * scale / h;
            let silent = over_wall(t, h, scale, move |s| [-speed * (s - t), 0.0, 0.0]);
            let Err(error) = silent else { panic!("accepted at {t}, {h}, {scale}") };
            assert!(matches!(error, Error::SilentMotion { .. }) && !error.is_recoverable(), "{error}");
            assert!(error.to_string().contains("rates"), "{error}");
            over_wall(t, h, scale, move |s| [-speed * (s - t), -speed, 0.0]).unwrap();
            // What the wall did before does not count, what it will do does.
            let begins = over_wall(t, h, scale, move |s| [-speed * (s - t).max(0.0), 0.0, 0.0]);
            assert!(matches!(begins, Err(Error::SilentMotion { .. })), "{t}, {h}, {scale}");
            over_wall(t, h, scale, move |s| [-speed * (s - t).min(0.0), 0.0, 0.0]).unwrap();
            // At rest at the start, at rest but for a kink at the start or within the step, and a jump.
            let omega = TAU / (20.0 * h);
            let smooth = move |s: f64| {
                let phase = omega * (s - t);
                [0.1 * scale * (1.0 - phase.cos()), 0.1 * scale * omega * phase.sin(), 0.1 * scale * omega.powi(2)]
            };
            over_wall(t, h, scale, smooth).unwrap();
            for kink in [0.0, 0.3, 0.99] {
                let late = move |s: f64| {
                    let since = s - t - kink * h;
                    if since > 0.0 { [-speed * since, -speed, 0.0] } else { [0.0; 3] }
                };
                over_wall(t, h, scale, late).unwrap();
            }
            over_wall(t, h, scale, move |s| [if s > t + 0.5 * h { -0.1 * scale } else { 0.0 }, 0.0, 0.0]).unwrap();
            over_wall(t, h, scale, move |_| [0.25 * scale, 0.0, 0.0]).unwrap();
            // Many periods in a step: badly resolved, but said.
            let fast = TAU * 17.3 / h;
            over_wall(t, h, scale, move |s| {
                let phase = fast * (s - t);
                [0.1 * scale * phase.sin(), 0.1 * scale * fast * phase.cos(), -0.1 * scale * fast.powi(2) * phase.sin()]
            })
            .unwrap();
        }
    }
}

#[test]
fn walls_that_begin_to_move_without_rates_are_found() {
    // From t = 0.5 on, while a mass flies at it; and under a mass that rests on it.
    for (v, start) in [(-1.0, 2.0), (0.0, 0.0)] {
        let wall = |t: f64| [(0.5 - t).max(-0.9) * f64::from(u8::from(t > 0.5)), 0.0, 0.0];
        let mut run = Simulation::builder(free(&[1.0; 1]), Newmark::trapezoidal(), 1e-2)
            .displacement(vec![start])
            .velocity(vec![v])
            .constraint(LinearRows::new().unilateral(&[(0, 1.0)], GapOffset::moving(wall)))
            .corrector(PersistencyCorrection::with_history_projection())
            .build()
            .unwrap();
        let error = run.run_until(3.0, &mut ()).unwrap_err();
        assert!(matches!(error, Error::SilentMotion { .. }), "{error}");
        assert!(run.time() < 1.3, "{}", run.time());
    }
}

/// A floor that has no rows before its first search.
struct Sleeping {
    awake: Cell<bool>,
}

impl ContactConstraint<f64> for Sleeping {
    fn dofs(&self) -> &[usize] {
        &[1, 0]
    }
    fn search(&mut self, _: f64, u: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        // Supports are in place.
        assert_eq!(u[0], 0.125);
        self.awake.set(true);
        Ok(Candidates::Unchanged)
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        assert!(self.awake.get(), "no rows before the first search");
        contacts.push((0, 0), ContactLaw::Rigid, &[(1, 1.0)]);
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = 1.0 + u[1];
        Ok(())
    }
}

#[test]
fn rows_are_read_after_the_first_search() {
    let build = || {
        let system = free(&[1.0; 2]).drive(1, |_| [0.125, 0.0, 0.0]).unwrap();
        Simulation::builder(system, Newmark::trapezoidal(), 0.1)
            .velocity(vec![-3.0, 0.0])
            .constraint(Sleeping { awake: Cell::new(false) })
            .corrector(PersistencyCorrection::with_history_projection())
    };
    let mut run = build().build().unwrap();
    run.run_until(0.3, &mut ()).unwrap();
    let (state, history) = (run.state().clone(), run.history().clone());
    let mut resumed = build().resume(state, history).build().unwrap();
    for run in [&mut run, &mut resumed] {
        run.run_until(1.0, &mut ()).unwrap();
        assert!(run.state().velocity()[0].abs() < 1e-12);
    }
    assert_eq!(run.state(), resumed.state());
}

#[test]
fn a_state_and_a_history_of_two_instants_are_refused() {
    let build = || Simulation::builder(free(&[1.0; 1]), Composite, 0.1).velocity(vec![1.0]);
    let mut run = build().build().unwrap();
    run.run_until(1.0, &mut ()).unwrap();
    let early = (run.state().clone(), run.history().clone());
    run.step().unwrap();
    let late = (run.state().clone(), run.history().clone());
    for (state, history) in [(&early.0, &late.1), (&late.0, &early.1)] {
        let refused = build().resume(state.clone(), history.clone()).build();
        assert!(matches!(refused, Err(Error::Incompatible { .. })));
    }
    // Of one instant they are taken, wherever the clock has begun; also under step control, after steps of another
    // size.
    build().resume(late.0, late.1).build().unwrap();
    let controlled = || {
        let control = StepControl::halving(1e-3).unwrap().contact_changes(1).unwrap();
        let stops = LinearRows::new().unilateral(&[(0, -1.0)], 0.52).unilateral(&[(1, -1.0)], 0.53);
        Simulation::builder(free(&[1.0; 2]), Composite, 0.1)
            .start_time(1e7)
            .velocity(vec![1.0, 1.0])
            .constraint(stops)
            .corrector(PersistencyCorrection::with_history_projection())
            .step_control(control)
    };
    let mut run = controlled().build().unwrap();
    for _ in 0..30 {
        run.step().unwrap();
        controlled().resume(run.state().clone(), run.history().clone()).build().unwrap();
    }
    assert!(run.statistics().refused_steps > 0);
}

/// Two masses on springs that pull with 2 u³, whose pattern or mass changes when it is told to.
struct Changing {
    change: Option<Change>,
    after: f64,
    now: f64,
    patterns: [SymbolicSparseColMat<usize>; 2],
    consistent: [SparseColMat<usize, f64>; 2],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Change {
    Pattern,
    MassSize,
    MassEntries,
}

impl Changing {
    fn new(change: Option<Change>) -> Self {
        let diagonal = SymbolicSparseColMat::new_checked(2, 2, vec![0, 1, 2], None, vec![0, 1]);
        let full = SymbolicSparseColMat::new_checked(2, 2, vec![0, 2, 4], None, vec![0, 1, 0, 1]);
        let coupled = matrix(2, [(0, 0, 1.0), (0, 1, 0.1), (1, 0, 0.1), (1, 1, 1.0)]);
        let consistent = [coupled, matrix(2, [(0, 0, 1.0), (1, 1, 1.0)])];
        Self { change, after: 0.25, now: 0.0, patterns: [diagonal, full], consistent }
    }

    fn changed(&self, change: Change) -> bool {
        self.change == Some(change) && self.now > self.after
    }
}

impl System<f64> for Changing {
    fn dofs(&self) -> usize {
        2
    }
    fn mass(&self) -> Mass<'_, f64> {
        match self.change {
            Some(Change::MassEntries) => {
                Mass::Consistent(self.consistent[usize::from(self.changed(Change::MassEntries))].as_ref())
            }
            Some(Change::MassSize) if self.changed(Change::MassSize) => Mass::Lumped(&[1.0]),
            _ => Mass::Lumped(&[1.0, 1.0]),
        }
    }
    fn force(&mut self, t: f64, u: &[f64], _: &[f64], out: &mut [f64]) -> Result<()> {
        self.now = t;
        for (out, u) in out.iter_mut().zip(u) {
            *out = -2.0 * u.powi(3);
        }
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.patterns[usize::from(self.changed(Change::Pattern))].as_ref()
    }
    fn tangent(&mut self, _: f64, u: &[f64], _: &[f64], w: TangentWeights<f64>, out: &mut [f64]) -> Result<()> {
        out.fill(0.0);
        let last = out.len() - 1;
        (out[0], out[last]) = (w.stiffness * 6.0 * u[0] * u[0], w.stiffness * 6.0 * u[1] * u[1]);
        Ok(())
    }
}

#[test]
fn patterns_and_masses_that_change_in_a_run_are_refused() {
    for change in [None, Some(Change::Pattern), Some(Change::MassSize), Some(Change::MassEntries)] {
        let mut run = Simulation::builder(Changing::new(change), Newmark::trapezoidal(), 0.1)
            .velocity(vec![1.0, -1.0])
            .build()
            .unwrap();
        let result = run.run_until(1.0, &mut ());
        match change {
            None => assert!(result.is_ok()),
            Some(change) => {
                let error = result.unwrap_err();
                assert!(matches!(error, Error::Dimension { .. }), "{change:?}: {error}");
                assert!((run.time() - 0.2).abs() < 1e-12, "{change:?}: {}", run.time());
            }
        }
    }
}

#[test]
fn searches_that_keep_a_change_for_themselves_are_found() {
    /// A row around a point of the plane that turns with the node.
    struct Turning {
        normal: [f64; 2],
        gap: f64,
        place: [f64; 2],
        says: Candidates,
    }
    impl ContactConstraint<f64> for Turning {
        fn dofs(&self) -> &[usize] {
            &[0, 1]
        }
        fn search(&mut self, _: f64, u: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
            let [x, y] = [1.0 + u[0], u[1]];
            let r = x.hypot(y);
            (self.normal, self.gap, self.place) = ([x / r, y / r], r - 0.5, [u[0], u[1]]);
            Ok(self.says)
        }
        fn contacts(&self, contacts: &mut Contacts<f64>) {
            contacts.push((0, 0), ContactLaw::Rigid, &[(0, self.normal[0]), (1, self.normal[1])]);
        }
        fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
            gaps[0] = self.gap + (0..2).map(|k| self.normal[k] * (u[k] - self.place[k])).sum::<f64>();
            Ok(())
        }
        fn rates(&mut self, _: f64, u: &[f64], v: &[f64], rates: &mut [GapRates<f64>]) -> Result<Rates> {
            let [x, y] = [1.0 + u[0], u[1]];
            let r = x.hypot(y);
            let across = (x * v[1] - y * v[0]) / r;
            rates[0] = GapRates { rate: 0.0, acceleration: across * across / r };
            Ok(Rates::Given)
        }
    }
    for (says, expected) in [(Candidates::Changed, false), (Candidates::Unchanged, true)] {
        let mut contact = Turning { normal: [0.0; 2], gap: 0.0, place: [0.0; 2], says };
        let error = verify::gap_jacobian(&mut contact, 0.0, &[0.1, 0.2], &[0.3, -0.4], 1e-6).unwrap();
        assert!(error.jacobian < 1e-8 && error.acceleration < 1e-3, "{error:?}");
        assert_eq!(error.unreported > 0, expected, "{error:?}");
    }
}
