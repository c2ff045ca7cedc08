//! Contact constraints as blocks on dofs of their own: forwarding, rates by differences, output, rows that come later.
#![allow(clippy::float_cmp)] // forwarded values are meant exactly

use contact_dynamics::contact::{
    Candidates, ContactConstraint, ContactId, ContactLaw, Contacts, GapFunction, GapRates, NodesOnObstacle, Rates,
    Side, Sphere, Stride, Variation,
};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{
    CentralDifference, Composite, ContactStatus, Error, LinearRows, LinearSystem, Newmark, PersistencyCorrection,
    Result, Simulation, StepControl, TimeIntegrator,
};
use contact_dynamics_scenes::schemes::{self, Listed};

/// Free masses.
fn free(count: usize) -> LinearSystem<'static, f64> {
    let none: Vec<_> = (0..count).map(|i| Triplet::new(i, i, 0.0)).collect();
    let k = SparseColMat::<usize, f64>::try_new_from_triplets(count, count, &none).unwrap();
    LinearSystem::lumped(vec![1.0; count], k).unwrap()
}

/// Answers every question otherwise than the default does, and writes down what it was asked.
#[derive(Default)]
struct Witness {
    asked: Vec<&'static str>,
}

impl ContactConstraint<f64> for Witness {
    fn dofs(&self) -> &[usize] {
        &[3, 1]
    }
    fn only_reads(&self, place: usize) -> bool {
        place == 1
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        contacts.push((5, 6), ContactLaw::Equality, &[(0, 2.0)]).magnitude(7.0);
    }
    fn gaps(&mut self, t: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        self.asked.push("gaps");
        gaps[0] = t + u[0];
        Ok(())
    }
    fn rates(&mut self, t: f64, u: &[f64], v: &[f64], rates: &mut [GapRates<f64>]) -> Result<Rates> {
        self.asked.push("rates");
        rates[0] = GapRates { rate: t + u[0], acceleration: v[0] };
        Ok(Rates::Given)
    }
    fn search(&mut self, _: f64, _: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        self.asked.push("search");
        Ok(Candidates::Changed)
    }
    fn follow(&mut self, t: f64, _: &[f64]) -> Result<Candidates> {
        self.asked.push("follow");
        Err(Error::ContactLost { t, contact: ContactId::default() })
    }
    fn inspect(&mut self, _: &Stride<'_, f64>) -> Result<()> {
        self.asked.push("inspect");
        Err(Error::ContactLost { t: 1.0, contact: ContactId::default() })
    }
    fn inspects(&self) -> bool {
        false
    }
    fn variation(&self) -> Variation {
        Variation::BySearch
    }
}

/// Asks everything there is to ask; a method more in the trait belongs here too.
fn interrogate(mut constraint: impl ContactConstraint<f64>) {
    let (u, v) = ([0.25, 0.5], [3.0, 4.0]);
    assert_eq!((constraint.dofs(), constraint.only_reads(0), constraint.only_reads(1)), (&[3, 1][..], false, true));
    assert_eq!((constraint.variation(), constraint.inspects()), (Variation::BySearch, false));
    let found = Contacts::of(&constraint);
    assert_eq!((found.len(), found.name(0), found.law(0), found.magnitude(0)), (1, (5, 6), ContactLaw::Equality, 7.0));
    let (mut gaps, mut rates) = ([0.0], [GapRates::default()]);
    constraint.gaps(1.0, &u, &mut gaps).unwrap();
    assert_eq!(constraint.rates(2.0, &u, &v, &mut rates).unwrap(), Rates::Given);
    assert_eq!((gaps[0], rates[0]), (1.25, GapRates { rate: 2.25, acceleration: 3.0 }));
    assert_eq!(constraint.search(0.0, &u, &v, 0.1).unwrap(), Candidates::Changed);
    assert!(constraint.follow(0.0, &u).is_err());
    assert!(constraint.inspect(&Stride::new([0.0, 1.0], [&u, &u], &v, [&[false], &[true]])).is_err());
}

#[test]
fn what_is_boxed_or_lent_answers_as_what_it_is() {
    let all = ["gaps", "rates", "search", "follow", "inspect"];
    let mut witness = Witness::default();
    interrogate(&mut witness);
    assert_eq!(witness.asked, all);
    let mut boxed: Box<dyn ContactConstraint<f64>> = Box::new(&mut witness);
    interrogate(&mut boxed);
    interrogate(&mut *boxed);
    interrogate(boxed);
    assert_eq!(witness.asked, all.repeat(4));
    interrogate(Box::new(Witness::default()));
}

#[test]
fn a_lent_constraint_stays_with_the_host() {
    let mut floor = LinearRows::new().unilateral(&[(0, 1.0)], 0.5);
    for _ in 0..2 {
        let mut run =
            Simulation::builder(free(1), Composite, 0.1).velocity(vec![-1.0]).constraint(&mut floor).build().unwrap();
        run.run_until(1.0, &mut ()).unwrap();
        assert!((run.state().displacement()[0] + 0.5).abs() < 1e-12);
        assert_eq!(run.constraint(0).map(ContactConstraint::dofs), Some(&[0][..]));
        assert!(run.constraint(1).is_none());
    }
    assert_eq!(floor.len(), 1);
}

/// Hides the rates of a constraint.
struct Silent<C>(C);

impl<C: ContactConstraint<f64>> ContactConstraint<f64> for Silent<C> {
    fn dofs(&self) -> &[usize] {
        self.0.dofs()
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        self.0.contacts(contacts);
    }
    fn gaps(&mut self, t: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        self.0.gaps(t, u, gaps)
    }
    fn search(&mut self, t: f64, u: &[f64], v: &[f64], ahead: f64) -> Result<Candidates> {
        self.0.search(t, u, v, ahead)
    }
    fn follow(&mut self, t: f64, u: &[f64]) -> Result<Candidates> {
        self.0.follow(t, u)
    }
    fn inspect(&mut self, step: &Stride<'_, f64>) -> Result<()> {
        self.0.inspect(step)
    }
}

/// A particle in a bowl that shakes, and one under a function that moves and bends: with exact rates and without.
#[test]
fn rates_by_differences_are_those_that_are_given() {
    let bowl = || {
        let bowl = Sphere::new([0.0, 2.0], 2.0, Side::Inside).unwrap();
        NodesOnObstacle::new(bowl, &[[0.0, 0.0]], &[[0, 1]], &[0]).unwrap().moving(|t| {
            let (sin, cos) = (3.0 * t).sin_cos();
            [[0.1 * sin, 0.0], [0.3 * cos, 0.0], [-0.9 * sin, 0.0]]
        })
    };
    let wave = || {
        GapFunction::new(&[0, 1], |t: f64, x: &[f64], v: &[f64], gradient: &mut [f64]| {
            let (sin, cos) = (x[0] - 0.7 * t).sin_cos();
            gradient.copy_from_slice(&[-0.3 * cos, 1.0]);
            [x[1] - 0.3 * sin, 0.21 * cos, 0.3 * sin * (v[0] - 0.7) * (v[0] - 0.7)]
        })
        .scale(1.0)
        .unwrap()
    };
    let run = |contact: Box<dyn ContactConstraint<f64>>, h: f64| {
        let system = free(2).load(|_, f| f[1] = -10.0);
        let mut run = Simulation::builder(system, Newmark::trapezoidal(), h)
            .velocity(vec![0.5, 0.0])
            .constraint(contact)
            .corrector(PersistencyCorrection::new())
            .build()
            .unwrap();
        run.run_until(0.5, &mut ()).unwrap();
        let state = run.state();
        assert!(state.contacts().closed()[0]);
        [state.displacement(), state.velocity(), state.contacts().forces()].concat()
    };
    let far = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).fold(0.0_f64, |far, (a, b)| far.max((a - b).abs()));
    for h in [0.01, 0.005] {
        // (δ²/12 of the fourth derivative of the gap, δ = h/16, and rounding over δ².)
        let bound = 0.05 * h * h;
        let bowls = far(run(Box::new(bowl()), h), run(Box::new(Silent(bowl())), h));
        assert!(bowls < bound, "{bowls:e} at {h}");
        let waves = far(run(Box::new(wave()), h), run(Box::new(Silent(wave())), h));
        assert!(waves < bound, "{waves:e} at {h}");
    }
}

/// Differences of the gap of a wall at rest are rounding, however far a fast body goes in the time that they are taken
/// over: the run is the same to the bit.
#[test]
fn a_wall_at_rest_has_no_rates_for_fast_bodies_either() {
    for k in 0..40 {
        let speed = 10.0_f64.powf(0.1 * f64::from(k));
        let wall = || LinearRows::new().unilateral(&[(0, -1.0), (1, 0.3)], 0.37);
        let run = |contact: Box<dyn ContactConstraint<f64>>| {
            let mut run = Simulation::builder(free(2), Newmark::trapezoidal(), 1.0)
                .velocity(vec![speed, -0.7 * speed])
                .constraint(contact)
                .corrector(PersistencyCorrection::new())
                .build()
                .unwrap();
            run.run_until(3.0, &mut ()).unwrap();
            let state = run.state();
            [state.displacement(), state.velocity(), state.acceleration(), state.contacts().forces()].concat()
        };
        assert_eq!(run(Box::new(wall())), run(Box::new(Silent(wall()))), "{speed}");
    }
}

/// A wall that moves and does not say so: what is not said is found.
#[test]
fn a_wall_that_moves_needs_no_rates() {
    let wall = |_| {
        LinearRows::new()
            .unilateral(&[(0, -1.0)], contact_dynamics::contact::GapOffset::moving(|t| [1.0 - 0.5 * t, 0.0, 0.0]))
    };
    let refused = Simulation::builder(free(1), Composite, 0.01).constraint(wall(0)).build();
    assert!(matches!(refused, Err(Error::SilentMotion { .. })));
    let mut run =
        Simulation::builder(free(1), Composite, 0.01).velocity(vec![1.0]).constraint(Silent(wall(0))).build().unwrap();
    run.run_until(1.0, &mut ()).unwrap();
    assert!((run.state().velocity()[0] + 0.5).abs() < 1e-9, "{:?}", run.state());
}

/// The inside of a bowl y = x², whose row follows the particle on it; whether it says so is another matter.
struct Bowl {
    x: f64,
    says: Candidates,
}

impl ContactConstraint<f64> for Bowl {
    fn dofs(&self) -> &[usize] {
        &[0, 1]
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        contacts.push((0, 0), ContactLaw::Rigid, &[(0, -2.0 * self.x), (1, 1.0)]);
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = u[1] - u[0] * u[0];
        Ok(())
    }
    fn follow(&mut self, _: f64, u: &[f64]) -> Result<Candidates> {
        self.x = u[0];
        Ok(self.says)
    }
}

/// Rows that turn although their constraint says that they do not are found out, where a contact closes or within 64
/// steps, before the run goes astray.
#[test]
fn rows_that_turn_in_silence_are_refused() {
    for listed in schemes::all().into_iter().filter(Listed::takes_multipliers) {
        let runs = [Candidates::Changed, Candidates::Unchanged].map(|says| {
            let mut run = Simulation::builder(free(2), (listed.make)(), 0.01)
                .velocity(vec![1.0, 0.0])
                .constraint(Bowl { x: 0.0, says })
                .build()?;
            run.run_until(1.0, &mut ())?;
            Ok::<_, Error>(run.state().velocity().to_vec())
        });
        let [honest, silent] = runs;
        let refused = matches!(silent, Err(Error::SilentTurn { change: [by_gap, by_row], .. }) if by_gap != by_row);
        assert!(honest.is_ok() && refused, "{}: {honest:?} {silent:?}", listed.name());
    }
}

/// A floor that says that it never changes, and writes down what it is asked besides gaps.
#[derive(Default)]
struct Still {
    asked: Vec<&'static str>,
    /// Its speed, of which it says nothing.
    speed: f64,
}

impl ContactConstraint<f64> for Still {
    fn dofs(&self) -> &[usize] {
        &[0]
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        contacts.push((0, 0), ContactLaw::Rigid, &[(0, 1.0)]);
    }
    fn gaps(&mut self, t: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = u[0] + 1.0 - self.speed * t;
        Ok(())
    }
    fn rates(&mut self, _: f64, _: &[f64], _: &[f64], rates: &mut [GapRates<f64>]) -> Result<Rates> {
        self.asked.push("rates");
        // (What is left in the slice is not read.)
        rates[0] = GapRates { rate: f64::NAN, acceleration: f64::NAN };
        Ok(Rates::Zero)
    }
    fn search(&mut self, _: f64, _: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        self.asked.push("search");
        Ok(Candidates::Unchanged)
    }
    fn inspect(&mut self, _: &Stride<'_, f64>) -> Result<()> {
        self.asked.push("inspect");
        Ok(())
    }
    fn inspects(&self) -> bool {
        false
    }
    fn variation(&self) -> Variation {
        Variation::Never
    }
}

/// A mass that falls onto such a floor.
fn fall(floor: &mut Still) -> Result<Simulation<'_, f64>> {
    let builder = Simulation::builder(free(1), Composite, 0.01).velocity(vec![-2.0]);
    builder.constraint(floor).corrector(PersistencyCorrection::new()).build()
}

#[test]
fn what_never_changes_is_asked_once() {
    let mut floor = Still::default();
    let mut run = fall(&mut floor).unwrap();
    run.run_until(2.0, &mut ()).unwrap();
    let (u, v) = (run.state().displacement()[0], run.state().velocity()[0]);
    assert!((u + 1.0).abs() < 1e-12 && v.abs() < 1e-12, "{u} {v}");
    drop(run);
    floor.asked.sort_unstable();
    assert_eq!(floor.asked, ["rates", "search"]);
    // One that moves all the same is found out.
    let refused = fall(&mut Still { speed: 0.5, ..Still::default() }).map(drop);
    assert!(matches!(refused, Err(Error::SilentMotion { .. })), "{refused:?}");
}

/// Floors under masses that come one after the other.
struct Rain {
    dofs: Vec<usize>,
    near: usize,
}

impl ContactConstraint<f64> for Rain {
    fn dofs(&self) -> &[usize] {
        &self.dofs
    }
    fn search(&mut self, _: f64, u: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        let near = u.iter().filter(|&&u| u < -0.5).count();
        Ok(Candidates::changed_if(std::mem::replace(&mut self.near, near) != near))
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        for place in 0..self.near {
            contacts.push((place, 0), ContactLaw::Rigid, &[(place, 1.0)]);
        }
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        for (gap, u) in gaps.iter_mut().zip(u) {
            *gap = u + 1.0;
        }
        Ok(())
    }
}

/// No number of candidates is promised: none at first, and all in the end.
#[test]
fn candidates_come_in_any_number() {
    let count = 40;
    let rain = Rain { dofs: (0..count).collect(), near: 0 };
    let mut run = Simulation::builder(free(count), Composite, 0.01)
        .velocity((0..count).map(|k| -2.0 + 0.03 * k as f64).collect())
        .constraint(rain)
        .build()
        .unwrap();
    assert!(run.gaps().is_empty());
    run.run_until(2.0, &mut ()).unwrap();
    assert_eq!(run.gaps().len(), count);
    for (dof, (u, v)) in run.state().displacement().iter().zip(run.state().velocity()).enumerate() {
        assert!((u + 1.0).abs() < 1e-9 && v.abs() < 1e-9, "{dof}: {u} {v}");
    }
}

/// Nothing to touch; writes down for how far ahead it searches.
struct Horizon(Vec<f64>);

impl ContactConstraint<f64> for Horizon {
    fn dofs(&self) -> &[usize] {
        &[0]
    }
    fn search(&mut self, _: f64, _: &[f64], _: &[f64], ahead: f64) -> Result<Candidates> {
        self.0.push(ahead);
        Ok(Candidates::Unchanged)
    }
    fn contacts(&self, _: &mut Contacts<f64>) {}
    fn gaps(&mut self, _: f64, _: &[f64], _: &mut [f64]) -> Result<()> {
        Ok(())
    }
}

/// A step looks as far ahead as it goes, and one step further where the scheme imposes contact a step after its state.
#[test]
fn searches_are_told_how_far_a_step_looks() {
    let h = 0.125;
    let schemes: [(Box<dyn TimeIntegrator>, f64); 3] =
        [(Box::new(Newmark::trapezoidal()), h), (Box::new(Composite), h), (Box::new(CentralDifference), 2.0 * h)];
    for (scheme, ahead) in schemes {
        let (name, mut horizon) = (scheme.name(), Horizon(Vec::new()));
        let mut run = Simulation::builder(free(1), scheme, h).constraint(&mut horizon).build().unwrap();
        run.step().unwrap();
        run.set_step_size(0.5 * h).unwrap();
        run.step().unwrap();
        drop(run);
        assert!(horizon.0.ends_with(&[ahead, 0.5 * ahead]), "{name}: {:?}", horizon.0);
    }
}

#[test]
fn forces_of_contacts_are_vectors() {
    let slope = contact_dynamics::contact::Plane::new([0.0, 0.0], [0.6, 0.8]).unwrap();
    let rest = NodesOnObstacle::new(slope, &[[5.0, 5.0], [0.0, 0.0]], &[[0, 1], [2, 3]], &[0, 1]).unwrap();
    let system = free(5).load(|_, f| f[2..].copy_from_slice(&[-6.0, -8.0, -1.0]));
    let mut run = Simulation::builder(system, Composite, 0.1)
        .constraint(LinearRows::new().unilateral(&[(4, 1.0)], 0.0))
        .constraint(rest)
        .build()
        .unwrap();
    run.step().unwrap();
    let contacts: Vec<_> = run.contact_forces().collect();
    let names: Vec<_> = contacts.iter().map(|contact| contact.id.to_string()).collect();
    assert_eq!(names, ["0.0.0", "1.0.0", "1.1.0"]);
    let forces: Vec<Vec<_>> = contacts.iter().map(|contact| contact.forces().collect()).collect();
    let near = |force: &[(usize, f64)], expected: &[(usize, f64)]| {
        force.len() == expected.len()
            && force.iter().zip(expected).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-11)
    };
    assert!(near(&forces[0], &[(4, 1.0)]), "{forces:?}");
    assert!(near(&forces[1], &[(0, 0.0), (1, 0.0)]), "{forces:?}");
    assert!(near(&forces[2], &[(2, 6.0), (3, 8.0)]), "{forces:?}");
    assert_eq!([contacts[0].position, contacts[1].position], [None, Some([5.0, 5.0, 0.0])]);
    assert_eq!((contacts[1].status, contacts[2].status), (ContactStatus::Open, ContactStatus::Closed));
}

/// A floor at zero that is looked for from some time on: what has passed it by then is found inside.
struct LateFloor {
    from: f64,
    law: ContactLaw,
    recovery: Option<f64>,
    found: bool,
}

impl ContactConstraint<f64> for LateFloor {
    fn dofs(&self) -> &[usize] {
        &[0]
    }
    fn contacts(&self, contacts: &mut Contacts<f64>) {
        if self.found {
            let mut contact = contacts.push((0, 0), self.law, &[(0, 1.0)]);
            if let Some(depth) = self.recovery {
                contact.recovery(depth);
            }
        }
    }
    fn gaps(&mut self, _: f64, u: &[f64], gaps: &mut [f64]) -> Result<()> {
        gaps[0] = u[0];
        Ok(())
    }
    fn search(&mut self, t: f64, _: &[f64], _: &[f64], _: f64) -> Result<Candidates> {
        let found = t >= self.from;
        Ok(Candidates::changed_if(std::mem::replace(&mut self.found, found) != found))
    }
    fn variation(&self) -> Variation {
        Variation::BySearch
    }
}

/// A mass that falls onto such a floor from 1 above it, with a velocity of −1.
fn falling(floor: LateFloor) -> Result<Simulation<'static, f64>> {
    Simulation::builder(free(1), Composite, 0.1).displacement(vec![1.0]).velocity(vec![-1.0]).constraint(floor).build()
}

#[test]
fn what_is_found_deep_inside_comes_out_slowly() {
    let floor = |recovery| LateFloor { from: 1.45, law: ContactLaw::Rigid, recovery, found: false };
    let mut run = falling(floor(Some(1e-3))).unwrap();
    run.run_until(1.5, &mut ()).unwrap();
    let mut energy: f64 = 0.0;
    for _ in 0..30 {
        let before = run.state().displacement()[0];
        run.step().unwrap();
        let state = run.state();
        let [gap] = state.contacts().gaps() else { panic!("one row") };
        energy = energy.max(0.5 * state.velocity()[0].powi(2));
        // By the depth that was given, and not faster.
        let out = state.displacement()[0] - before;
        assert!((0.0..1.5e-3).contains(&out), "comes out by {out:e}");
        assert!((gap - state.displacement()[0]).abs() < 1e-15 && state.contacts().closed()[0], "{gap:e}");
    }
    assert!(energy < 1e-3, "{energy:e}");
    assert!(run.state().displacement()[0] > -0.5 + 0.02);

    // All at once, unless it is asked for.
    let mut run = falling(floor(None)).unwrap();
    run.run_until(1.75, &mut ()).unwrap();
    assert!(run.state().displacement()[0] > -1e-12);
}

/// In steps that are halved over and over, and in those that are cut to land on a time, as fast as in whole ones.
#[test]
fn what_is_deep_inside_comes_out_no_faster_in_parts_of_steps() {
    let begin = || {
        let floor = LateFloor { from: 1.45, law: ContactLaw::Rigid, recovery: Some(1e-3), found: false };
        let fall = Simulation::builder(free(1), Composite, 0.1).displacement(vec![1.0]).velocity(vec![-1.0]);
        fall.constraint(floor)
    };
    let mut halved =
        begin().step_control(StepControl::halving(1e-3).unwrap().local_error(1e-12).unwrap()).build().unwrap();
    let mut landed = begin().build().unwrap();
    for run in [&mut halved, &mut landed] {
        run.run_until(1.5, &mut ()).unwrap();
    }
    let mut fastest: f64 = 0.0;
    for k in 1..=10 {
        let before = [&halved, &landed].map(|run| run.state().displacement()[0]);
        halved.run_until(1.5 + 0.1 * f64::from(k), &mut ()).unwrap();
        for part in [0.011, 0.1] {
            landed.land_on(1.5 + 0.1 * f64::from(k - 1) + part, &mut ()).unwrap();
            // (The step in which it is stopped is that of an impact.)
            if k > 1 {
                fastest = fastest.max(landed.state().velocity()[0].abs());
            }
        }
        let after = [&halved, &landed].map(|run| run.state().displacement()[0]);
        for (out, name) in [after[0] - before[0], after[1] - before[1]].into_iter().zip(["halved", "landed"]) {
            assert!((0.0..2.5e-3).contains(&out), "{name}, {k}: comes out by {out:e}");
        }
    }
    assert!(halved.statistics().steps > 500 && fastest < 0.05, "{} {fastest}", halved.statistics().steps);
}

/// Also where a run goes on from memory right behind an impact, and its step changes at once.
#[test]
fn what_is_deep_inside_stays_there_when_a_resumed_run_changes_its_step() {
    let floor = || LateFloor { from: 1.45, law: ContactLaw::Rigid, recovery: Some(1e-3), found: false };
    let mut run = falling(floor()).unwrap();
    while run.state().contacts().closed() != [true] {
        run.step().unwrap();
    }
    let (state, history) = (run.state().clone(), run.history().clone());
    let builder = Simulation::builder(free(1), Composite, 0.1).constraint(floor());
    let mut resumed = builder.resume(state, history).build().unwrap();
    for run in [&mut run, &mut resumed] {
        run.set_step_size(0.05).unwrap();
        let (u, v, _) = run.history().past(1).unwrap();
        assert!((u[0] - run.state().displacement()[0]).abs() < 1e-12 && v[0].abs() < 1e-12, "{u:?}, {v:?}");
    }
    for _ in 0..5 {
        for run in [&mut run, &mut resumed] {
            run.step().unwrap();
        }
        assert_eq!(run.state(), resumed.state());
    }
}

#[test]
fn depths_of_springs_and_of_the_start_are_as_they_are() {
    let law = ContactLaw::Penalty { stiffness: 1.0 };
    let mut run = falling(LateFloor { from: 1.45, law, recovery: Some(1e-3), found: false }).unwrap();
    run.run_until(1.55, &mut ()).unwrap();
    let state = run.state();
    assert!(state.contacts().gaps()[0] < -0.5 && state.contacts().gaps()[0] == state.displacement()[0]);
    assert!((state.contacts().raw_forces()[0] + state.contacts().gaps()[0]).abs() < 1e-12, "{:?}", state.contacts());

    let inside = LateFloor { from: 0.0, law: ContactLaw::Rigid, recovery: Some(1e-3), found: false };
    let builder = Simulation::builder(free(1), Composite, 0.1).displacement(vec![-0.5]);
    let error = builder.constraint(inside).build().unwrap_err();
    assert!(matches!(error, Error::InitialViolation { gap: -0.5, .. }), "{error}");
}

#[test]
fn absurd_depths_of_recovery_are_refused() {
    for depth in [-1e-3, f64::NAN] {
        let floor = LateFloor { from: 0.0, law: ContactLaw::Rigid, recovery: Some(depth), found: false };
        let error = falling(floor).unwrap_err();
        assert!(matches!(error, Error::Parameter { range: "from 0", .. }), "{error}");
    }
}
