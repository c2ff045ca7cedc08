//! Rows of time integrators: what `check` lets pass is analyzed, and runs or is refused.

#![no_main]

use contact_dynamics::analysis::{
    critical_omega, local_error, massless_factor, order, overshoot, period_and_damping, period_elongation, report,
    spectral_radius,
};
use contact_dynamics::tableau::{A, ContactLevel, Row, Rows, Stage, StartUp, Tableau, U, V, Z};
use contact_dynamics::{LinearRows, LinearSystem, Simulation, TimeIntegrator};
use contact_dynamics_scenes::schemes::{self, Tabulated};
use contact_dynamics_scenes::sparse::matrix;
use fuzz::Input;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let tableau = match input.flag() {
        true => Tableau::staged((0..input.below(4)).map(|_| stage(&mut input)).collect()),
        false => altered(&mut input),
    };
    let momentum = || (tableau.momentum().after_step(), tableau.depth(), tableau.read_after(0));
    if tableau.check("fuzzed").is_ok() {
        let _ = momentum();
        let (omega, xi) = (input.size(), input.size());
        let _ = (report(&tableau).map(|report| report.to_string()), order(&tableau), local_error(&tableau));
        let _ = (spectral_radius(&tableau, omega, xi), critical_omega(&tableau, xi), massless_factor(&tableau));
        let _ = (period_and_damping(&tableau, omega, xi), period_elongation(&tableau));
        let _ = overshoot(&tableau, omega, StartUp::Taylor);
    }
    let k = matrix(2, [(0, 0, 4.0), (1, 1, 4.0), (0, 1, -2.0), (1, 0, -2.0)]);
    let Ok(system) = LinearSystem::<f64>::lumped(vec![1.0, 2.0], k) else { return };
    let wall = LinearRows::new().unilateral(&[(1, -1.0)], 0.1);
    let mut builder =
        Simulation::builder(system, Tabulated("fuzzed", tableau), 0.1).velocity(vec![1.0, 1.0]).constraint(wall);
    if input.flag() {
        builder = builder.unchecked_stability();
    }
    if input.flag() {
        builder = builder.uncorrected();
    }
    let Ok(mut run) = builder.build() else { return };
    for _ in 0..8 {
        let before = run.state().clone();
        if let Err(error) = run.step() {
            assert_eq!(&before, run.state(), "{error}");
            return;
        }
        assert!(run.state().displacement().iter().chain(run.state().velocity()).all(|x| x.is_finite()));
    }
});

/// A scheme of the library with a number changed.
fn altered(input: &mut Input<'_>) -> Tableau {
    let all = schemes::all();
    let mut tableau = (all[input.below(all.len())].make)().tableau();
    let (chosen, value) = (input.below(tableau.stages.len()), input.number());
    let stage = &mut tableau.stages[chosen];
    match input.below(6) {
        0 => stage.load = value,
        1 => stage.end = value,
        2 => stage.contact = ContactLevel::Position { lead: value },
        3 | 4 => *coefficient(&mut stage.recovery, input) = value,
        _ => *coefficient(&mut stage.balance, input) = value,
    }
    tableau
}

/// One of the numbers of three rows.
fn coefficient<'r>(rows: &'r mut Rows, input: &mut Input<'_>) -> &'r mut f64 {
    let row = match input.below(3) {
        0 => &mut rows.u,
        1 => &mut rows.v,
        _ => &mut rows.a,
    };
    match input.below(13) {
        0 => &mut row.z,
        k @ 1..=4 => &mut row.u[k - 1],
        k @ 5..=8 => &mut row.v[k - 5],
        k => &mut row.a[k - 9],
    }
}

fn row(input: &mut Input<'_>) -> Row {
    let mut row = input.number() * Z;
    for _ in 0..input.below(4) {
        let past = [U, V, A][input.below(3)][input.below(4)];
        row = row + input.number() * past;
    }
    row
}

fn stage(input: &mut Input<'_>) -> Stage {
    let [recovery, balance] = [(); 2].map(|()| Rows { u: row(input), v: row(input), a: row(input) });
    let mut stage = Stage::new(recovery);
    if input.flag() {
        stage = stage.balanced(balance, input.number());
    }
    if input.flag() {
        stage = stage.ending_at(input.number());
    }
    match input.below(4) {
        0 => stage.with_contact(ContactLevel::Position { lead: input.number() }),
        1 => {
            let (forecast, forecast_at) = (row(input), input.number());
            stage.with_contact(ContactLevel::Velocity { lead: input.number(), forecast, forecast_at })
        }
        2 => stage.along_path(),
        _ => stage,
    }
}
