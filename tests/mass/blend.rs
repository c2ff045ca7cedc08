//! Lumped and blended masses, dispersion, and Courant numbers, against closed forms.

use contact_dynamics::analysis::{order, period_and_damping, period_elongation};
use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::faer::{Mat, Side};
use contact_dynamics::mass::{self, Mass};
use contact_dynamics::observer::{Control, StepView};
use contact_dynamics::tableau::Tableau;
use contact_dynamics::{
    Bathe, CentralDifference, Composite, Error, GeneralizedAlpha, LinearSystem, Newmark, PersistencyCorrection,
    Simulation, TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::measure::{figures, record_run};
use contact_dynamics_scenes::schemes::all;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{element, matrix};

type Matrix = SparseColMat<usize, f64>;

/// Linear bar elements of the lengths given, ρA = EA = 1: consistent mass and stiffness.
fn bar(lengths: &[f64]) -> [Matrix; 2] {
    let assembled = |entries: &dyn Fn(f64) -> [f64; 2]| {
        let element = |(e, &length): (usize, &f64)| element(e, e + 1, entries(length));
        matrix(lengths.len() + 1, lengths.iter().enumerate().flat_map(element))
    };
    [assembled(&|l| [l / 3.0, l / 6.0]), assembled(&|l| [1.0 / l, -1.0 / l])]
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    let worst = found.iter().zip(expected).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
    assert!(worst < tolerance, "{found:?}\ninstead of {expected:?}");
}

/// The square 8-node quadrilateral of mass 1 (3 × 3 Gauss points are exact): corners first.
fn serendipity() -> Matrix {
    let nodes: [[f64; 2]; 8] = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.], [0., -1.], [1., 0.], [0., 1.], [-1., 0.]];
    let shape = |[a, b]: [f64; 2], [x, y]: [f64; 2]| match (a.abs() > 0.5, b.abs() > 0.5) {
        (true, true) => 0.25 * (1.0 + a * x) * (1.0 + b * y) * (a * x + b * y - 1.0),
        (false, _) => 0.5 * (1.0 - x * x) * (1.0 + b * y),
        (_, false) => 0.5 * (1.0 + a * x) * (1.0 - y * y),
    };
    let gauss = [(-0.6_f64.sqrt(), 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.6_f64.sqrt(), 5.0 / 9.0)];
    let points = gauss.iter().flat_map(|&(x, v)| gauss.iter().map(move |&(y, w)| ([x, y], 0.25 * v * w)));
    let entries = points.flat_map(|(at, weight)| {
        (0..64).map(move |k| (k / 8, k % 8, weight * shape(nodes[k / 8], at) * shape(nodes[k % 8], at)))
    });
    matrix(8, entries)
}

#[test]
fn diagonal_scaling_is_positive_where_row_sums_are_not() {
    let m = serendipity();
    match mass::lump(m.as_ref()) {
        Err(Error::Mass { dof: 0, value }) => assert!((value + 1.0 / 12.0).abs() < 1e-15, "{value}"),
        other => panic!("{other:?}"),
    }
    let [corner, middle] = [3.0 / 76.0, 16.0 / 76.0];
    let expected = [corner, corner, corner, corner, middle, middle, middle, middle];
    close(&mass::lump_diagonal(m.as_ref(), &[0; 8]).unwrap(), &expected, 1e-15);
}

#[test]
fn diagonal_scaling_and_row_sums_agree_on_linear_elements_with_constant_jacobian() {
    let [m, _] = bar(&[1.0, 0.3, 2.0, 0.7]);
    let row_sums = mass::lump(m.as_ref()).unwrap();
    close(&mass::lump_diagonal(m.as_ref(), &[0; 5]).unwrap(), &row_sums, 1e-15);

    let material = Material { young: 1.0, poisson: 0.3, density: 2.0 };
    let block = Solid::block([1.0, 2.0, 1.5], [2, 3, 2], material).mapped(|[x, y, z]| [x + 0.3 * y, y, z - 0.2 * x]);
    let directions: Vec<usize> = (0..block.dofs()).map(|dof| dof % 3).collect();
    let scaled = mass::lump_diagonal(block.consistent_mass().as_ref(), &directions).unwrap();
    close(&scaled, &block.lumped_mass(), 1e-14);

    // Distorted: each total is kept, masses differ.
    let block = block.mapped(|[x, y, z]| [x + 0.2 * y * z, y + 0.1 * x * x, z]);
    let (scaled, sums) =
        (mass::lump_diagonal(block.consistent_mass().as_ref(), &directions).unwrap(), block.lumped_mass::<f64>());
    for axis in 0..3 {
        let total = |m: &[f64]| m.iter().skip(axis).step_by(3).sum::<f64>();
        assert!((total(&scaled) / total(&sums) - 1.0).abs() < 1e-13);
    }
    assert!(scaled.iter().zip(&sums).any(|(x, y)| (x / y - 1.0).abs() > 1e-3));
}

/// Directions that carry unlike masses keep their own totals.
#[test]
fn each_group_keeps_its_total() {
    // Dofs 0 and 2 a bar of mass 6, dofs 1 and 3 one of mass 60 with another shape of the matrix.
    let m = matrix(
        4,
        [(0, 0, 2.0), (0, 2, 1.0), (2, 0, 1.0), (2, 2, 2.0), (1, 1, 30.0), (3, 3, 10.0), (1, 3, 10.0), (3, 1, 10.0)],
    );
    close(&mass::lump_diagonal(m.as_ref(), &[0, 1, 0, 1]).unwrap(), &[3.0, 45.0, 3.0, 15.0], 1e-13);
    close(&mass::lump_diagonal(m.as_ref(), &[7, usize::MAX, 7, usize::MAX]).unwrap(), &[3.0, 45.0, 3.0, 15.0], 1e-13);
}

#[test]
fn blends_are_positive_definite_up_to_the_bound() {
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let [m, _] = bar(&[1.0, 0.3, 2.0, 0.7]);
    let (plate, block) =
        (Solid::rectangle([3.0, 2.0], [3, 4], material), Solid::block([1.0, 1.0, 2.0], [2, 3, 2], material));
    for (m, bound) in [(m, 1.5), (plate.consistent_mass(), 9.0 / 8.0), (block.consistent_mass(), 27.0 / 26.0)] {
        let lumped = mass::lump(m.as_ref()).unwrap();
        let blend = |weight| mass::blend(m.as_ref(), &lumped, weight);
        assert!(blend(bound - 1e-6).is_ok() && blend(-3.0).is_ok());
        assert!(matches!(blend(bound + 1e-6), Err(Error::Singular { matrix: "mass matrix", .. })));
        // Row sums stay.
        close(&mass::lump(blend(0.37).unwrap().as_ref()).unwrap(), &lumped, 1e-14);
    }
}

#[test]
fn blends_interpolate_in_either_precision() {
    let bars = Bars::paper(3);
    let (m, lumped) = (bars.consistent_mass::<f32>(), bars.lumped_mass::<f32>());
    assert_eq!(mass::blend(m.as_ref(), &lumped, 1.0).unwrap().val(), m.val());
    // A diagonal consistent matrix without stored off-diagonals, and one without stored diagonal.
    let empty = matrix::<f64>(2, []);
    assert_eq!(mass::blend(empty.as_ref(), &[2.0, 4.0], 0.5).unwrap().val(), [1.0, 2.0]);
    assert_eq!(mass::blend(m.as_ref(), &lumped, 0.0).unwrap().val().iter().filter(|m| **m != 0.0).count(), 8);
}

/// p of the rows is the limit of the computed period error.
#[test]
fn period_elongation_is_that_of_small_steps() {
    for scheme in all() {
        let tableau = (scheme.make)().tableau();
        let found = period_elongation(&tableau);
        if order(&tableau).displacement < 2 {
            assert_eq!(found, None, "{}", scheme.name());
            continue;
        }
        // Extrapolated to Ω → 0; the next term is Ω⁴.
        let at =
            |omega: f64| period_and_damping(&tableau, omega / std::f64::consts::TAU, 0.0).unwrap().0 / (omega * omega);
        let limit = (4.0 * at(0.01) - at(0.02)) / 3.0;
        assert!((found.unwrap() - limit).abs() < 1e-6, "{}: {found:?}, {limit}", scheme.name());
    }
}

/// Relative error of the phase velocity of the wave with `kappa` = wave number times element length.
fn phase_error(tableau: &Tableau, courant: f64, weight: f64, kappa: f64) -> f64 {
    let one_less_cos = 1.0 - kappa.cos();
    let omega = courant * (2.0 * one_less_cos / (1.0 - weight * one_less_cos / 3.0)).sqrt();
    let (elongation, _) = period_and_damping(tableau, omega / std::f64::consts::TAU, 0.0).unwrap();
    omega / (1.0 + elongation) / (kappa * courant) - 1.0
}

#[test]
fn phase_velocities_err_at_fourth_order_with_the_optimal_weight() {
    let fox_goodwin = Newmark::new(1.0 / 12.0, 0.5).unwrap();
    assert!(period_elongation(&fox_goodwin.tableau()).unwrap().abs() < 1e-14);
    let schemes: [(&dyn TimeIntegrator, f64); 6] = [
        (&Newmark::trapezoidal(), 0.5),
        (&GeneralizedAlpha::chung_hulbert(0.8).unwrap(), 0.7),
        (&Composite, 0.4),
        (&Bathe::default(), 1.0),
        (&CentralDifference, 0.6),
        (&fox_goodwin, 0.8),
    ];
    for (scheme, courant) in schemes {
        let (name, tableau) = (scheme.name(), scheme.tableau());
        let optimal = mass::optimal_weight(&tableau, courant).unwrap();
        let order = |weight: f64| {
            let [coarse, fine] = [0.2, 0.1].map(|kappa| phase_error(&tableau, courant, weight, kappa).abs());
            (coarse / fine).log2()
        };
        assert!((order(optimal) - 4.0).abs() < 0.1, "{name}: {}", order(optimal));
        for weight in [0.0, 1.0] {
            assert!((order(weight) - 2.0).abs() < 0.1, "{name}: {}", order(weight));
        }
    }
    // Lumped and exact for every wave at Courant number 1.
    let central = CentralDifference.tableau();
    let weight = mass::optimal_weight(&central, 1.0).unwrap();
    for kappa in [0.1, 1.0, 2.0, 3.0] {
        assert!(phase_error(&central, 1.0, weight, kappa).abs() < 1e-12);
    }
}

/// ω² of dilatational and shear waves along a mesh of quadrilaterals, read off an interior node, is that of the bar.
#[test]
fn waves_along_a_solid_disperse_as_in_a_bar() {
    let material = Material { young: 2.0, poisson: 0.3, density: 0.7 };
    let (plate, size, weight, kappa) = (Solid::rectangle([2.0, 2.1], [8, 3], material), 0.25, 0.8, 1.1);
    let (m, k) = (plate.consistent_mass(), plate.stiffness::<f64>());
    let m = mass::blend(m.as_ref(), &plate.lumped_mass(), weight).unwrap();
    let node = plate.nodes.iter().position(|p| (p[0] - 1.0).abs() < 1e-9 && (p[1] - 0.7).abs() < 1e-9).unwrap();
    let shear = (material.lame()[1] / material.density).sqrt();
    for (axis, speed) in [material.wave_speed(), shear].into_iter().enumerate() {
        let dof = Solid::<2>::dof(node, axis);
        let along = |a: &Matrix| -> f64 {
            let a = a.as_ref();
            let column = a.row_idx_of_col_raw(dof).iter().zip(a.val_of_col(dof));
            column
                .filter(|(row, _)| *row % 2 == axis)
                .map(|(row, x)| x * (kappa * plate.nodes[row / 2][0] / size).cos())
                .sum()
        };
        let one_less_cos = 1.0 - f64::cos(kappa);
        let expected = 2.0 * one_less_cos / (1.0 - weight * one_less_cos / 3.0);
        let found = along(&k) / along(&m) * (size / speed).powi(2);
        assert!((found / expected - 1.0).abs() < 1e-12, "{axis}: {found} {expected}");
    }
}

/// Central differences with their optimal weight are stable up to Courant number 1 for all waves, like the lumped mass.
#[test]
fn optimal_weights_keep_the_stability_limit_of_central_differences() {
    for courant in [0.1, 0.5, 0.9, 1.0] {
        let weight = mass::optimal_weight(&CentralDifference.tableau(), courant).unwrap();
        // κ = π: Ω² = 12 Co²/(2 + Co²).
        let omega = courant * (4.0 / (1.0 - weight * 2.0 / 3.0)).sqrt();
        assert!(omega < 2.0 + 1e-12, "{courant}: {omega}");
    }
}

/// A Gaussian pulse of 4 elements' width that travels through 120 elements: RMS of the displacement then, over that of
/// the pulse, and how late its crest passes the node 120 elements on, in times a wave takes through an element.
fn pulse(scheme: impl TimeIntegrator + 'static, courant: f64, weight: f64) -> [f64; 2] {
    const ELEMENTS: usize = 200;
    let (start, travel, width) = (40.0, 120.0, 4.0);
    let shape = |x: f64| (-0.5 * (x / width).powi(2)).exp();
    let [m, k] = bar(&[1.0; ELEMENTS]);
    let blend = mass::blend(m.as_ref(), &mass::lump(m.as_ref()).unwrap(), weight).unwrap();
    let nodes = || (0..=ELEMENTS).map(|node| node as f64 - start);
    let mut run = Simulation::builder(LinearSystem::new(blend, k).unwrap(), scheme, courant)
        .displacement(nodes().map(shape).collect())
        .velocity(nodes().map(|x| x / (width * width) * shape(x)).collect())
        .build()
        .unwrap();
    let mut heard: Vec<[f64; 2]> = Vec::new();
    let mut listen = |step: &StepView<'_, f64>| {
        heard.push([step.state.time(), step.state.displacement()[160]]);
        Control::Continue
    };
    run.run_until(1.2 * travel, &mut listen).unwrap();
    // Crest of the parabola through the highest three.
    let top = (1..heard.len() - 1).max_by(|&i, &j| heard[i][1].total_cmp(&heard[j][1])).unwrap();
    let [before, at, after] = [heard[top - 1][1], heard[top][1], heard[top + 1][1]];
    let late = heard[top][0] + 0.5 * courant * (before - after) / (before - 2.0 * at + after) - travel;
    let end = run.state().time();
    let (mut miss, mut size) = (0.0, 0.0);
    for (x, u) in nodes().zip(run.state().displacement()) {
        let exact = shape(x - end);
        miss += (u - exact).powi(2);
        size += exact * exact;
    }
    [(miss / size).sqrt(), late]
}

/// Errors with the optimal weight, and with lumped and consistent mass: [RMS, delay].
#[test]
fn a_pulse_arrives_in_time_with_the_optimal_weight() {
    type Make = fn() -> Box<dyn TimeIntegrator>;
    let rows: [(Make, f64, [[f64; 2]; 2]); 5] = [
        (|| Box::new(Newmark::trapezoidal()), 0.5, [[0.180, 1.213], [0.063, -0.446]]),
        (|| Box::new(GeneralizedAlpha::chung_hulbert(0.8).unwrap()), 0.7, [[0.233, 1.534], [0.006, 0.043]]),
        (|| Box::new(Composite), 0.3, [[0.175, 1.183], [0.068, -0.484]]),
        (|| Box::new(Bathe::default()), 0.5, [[0.152, 1.036], [0.095, -0.665]]),
        (|| Box::new(CentralDifference), 0.5, [[0.095, 0.673], [0.155, -1.048]]),
    ];
    for (scheme, courant, others) in rows {
        let name = scheme().name();
        let weight = mass::optimal_weight(&scheme().tableau(), courant).unwrap();
        let [rms, late] = pulse(scheme(), courant, weight);
        assert!(rms < 0.0026 && late.abs() < 0.022, "{name}: {rms} {late}");
        for (weight, expected) in [0.0, 1.0].into_iter().zip(others) {
            close(&pulse(scheme(), courant, weight), &expected, 1e-3);
        }
    }
}

/// Two bars of 100 elements, corrected with projection of the past: RMS errors of force and velocity of the contact
/// node with lumped, optimal and consistent mass.
#[test]
fn impacts_are_sharper_with_the_optimal_weight() {
    type Make = fn() -> Box<dyn TimeIntegrator>;
    let bars = Bars::paper(100);
    let (consistent, lumped) = (bars.consistent_mass::<f64>(), bars.lumped_mass::<f64>());
    let rows: [(Make, f64, [[f64; 2]; 3]); 2] = [
        (|| Box::new(Newmark::trapezoidal()), 0.5, [[0.0592, 0.1365], [0.0363, 0.0831], [0.1245, 0.0478]]),
        (|| Box::new(Composite), 0.3, [[0.0670, 0.1333], [0.0499, 0.0717], [0.1212, 0.0436]]),
    ];
    for (scheme, courant, measured) in rows {
        let h = courant * 1e-3;
        let found = mass::courant(Mass::Lumped(&lumped), bars.stiffness::<f64>().as_ref(), h).unwrap();
        close(&found, &[courant; 202], 1e-12);
        let weight = mass::optimal_weight(&scheme().tableau(), courant).unwrap();
        for (weight, measured) in [0.0, weight, 1.0].into_iter().zip(measured) {
            let blend = mass::blend(consistent.as_ref(), &lumped, weight).unwrap();
            let mut run = Simulation::builder(LinearSystem::new(blend, bars.stiffness()).unwrap(), scheme(), h)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .corrector(PersistencyCorrection::with_history_projection())
                .build()
                .unwrap();
            let figures = figures(&bars, &record_run(&bars, &mut run, 0.4), h);
            let found = [figures.force_rms, figures.velocity_rms];
            assert!(found.iter().zip(measured).all(|(x, y)| (x / y - 1.0).abs() < 0.03), "{found:?}, {measured:?}");
        }
    }
}

/// Largest eigenvalue of M⁻¹K.
fn largest_eigenvalue(m: &[f64], k: &Matrix) -> f64 {
    let dense = k.to_dense();
    let scaled = Mat::from_fn(m.len(), m.len(), |i, j| dense[(i, j)] / (m[i] * m[j]).sqrt());
    scaled.self_adjoint_eigenvalues(Side::Lower).unwrap().into_iter().fold(0.0, f64::max)
}

#[test]
fn courant_numbers_of_bars_are_exact() {
    let (bars, h) = (Bars { young: [49.0, 100.0], ..Bars::paper(10) }, 0.003);
    let k = bars.stiffness::<f64>();
    let expected: Vec<f64> = [0, 1]
        .into_iter()
        .flat_map(|bar| [(bars.young[bar] / bars.density[bar]).sqrt() * h / bars.element_size(bar); 11])
        .collect();
    let lumped = bars.lumped_mass();
    close(&mass::courant(Mass::Lumped(&lumped), k.as_ref(), h).unwrap(), &expected, 1e-14);
    let consistent = bars.consistent_mass();
    close(&mass::courant(Mass::Consistent(consistent.as_ref()), k.as_ref(), h).unwrap(), &expected, 1e-14);
}

/// Over the Courant number of dilatational waves across the unit element: smallest and largest value of a mesh, and
/// half the Ω of its highest mode.
fn ratios<const D: usize>(solid: &Solid<D>) -> [f64; 3] {
    let (m, k) = (solid.lumped_mass::<f64>(), solid.stiffness::<f64>());
    let h = 0.1 / solid.material.wave_speed();
    let found = mass::courant(Mass::Lumped(&m), k.as_ref(), h).unwrap();
    let [low, high] = [found.iter().copied().fold(f64::MAX, f64::min), found.iter().copied().fold(0.0, f64::max)];
    [low, high, 0.5 * h * largest_eigenvalue(&m, &k).sqrt()].map(|x| x / 0.1)
}

#[test]
fn courant_numbers_of_solids_bound_the_highest_mode() {
    let measured = [
        (0.0, [1.0607, 1.2247, 1.0], [1.1667, 1.4530, 1.0]),
        (0.3, [1.0856, 1.1952, 1.0155], [1.1718, 1.3686, 1.0437]),
        (0.45, [1.1078, 1.3484, 1.0639], [1.2060, 1.6237, 1.1561]),
    ];
    for (poisson, plate, block) in measured {
        let material = Material { young: 210.0, poisson, density: 7.8 };
        let found = [
            ratios(&Solid::rectangle([6.0, 5.0], [6, 5], material)),
            ratios(&Solid::block([5.0, 4.0, 4.0], [5, 4, 4], material)),
        ];
        for (found, measured) in found.into_iter().zip([plate, block]) {
            close(&found, &measured, 1e-4);
            assert!(found[2] <= found[1]);
        }
    }
    // The bound holds on distorted meshes, and is sharp for bars.
    let material = Material { young: 1.0, poisson: 0.3, density: 1.0 };
    let [low, high, mode] = ratios(&Solid::disc(4.0, 6, material));
    assert!(mode <= high && mode > low, "{low} {high} {mode}");
    let [m, k] = bar(&[1.0; 30]);
    let lumped = mass::lump(m.as_ref()).unwrap();
    let bound = mass::courant(Mass::Lumped(&lumped), k.as_ref(), 1.0).unwrap()[7];
    assert!((0.5 * largest_eigenvalue(&lumped, &k).sqrt() / bound - 1.0).abs() < 1e-12);
}

#[test]
fn wrong_input_is_refused_with_its_numbers() {
    let [m, k] = bar(&[1.0; 2]);
    let lumped = [0.5, 1.0, 0.5];
    macro_rules! refused {
        ($call:expr, $pattern:pat) => {
            match $call {
                Err($pattern) => {}
                other => panic!("{other:?}"),
            }
        };
    }
    refused!(mass::lump_diagonal(m.as_ref(), &[0; 2]), Error::Dimension { expected: 3, found: 2, .. });
    let hollow = matrix::<f64>(2, [(0, 0, 1.0), (1, 1, 0.0)]);
    refused!(mass::lump_diagonal(hollow.as_ref(), &[0; 2]), Error::Mass { dof: 1, .. });
    let negative = matrix::<f64>(2, [(0, 0, 1.0), (1, 1, 1.0), (0, 1, -2.0), (1, 0, -2.0)]);
    refused!(mass::lump_diagonal(negative.as_ref(), &[0; 2]), Error::Mass { dof: 0, .. });

    for weight in [f64::NAN, f64::INFINITY] {
        refused!(mass::blend(m.as_ref(), &lumped, weight), Error::Parameter { .. });
    }
    refused!(mass::blend(m.as_ref(), &lumped[..2], 0.5), Error::Dimension { expected: 3, found: 2, .. });
    refused!(mass::blend(m.as_ref(), &[0.5, 0.0, 0.5], 0.5), Error::Mass { dof: 1, .. });
    refused!(mass::blend(matrix(1, [(0, 0, f64::NAN)]).as_ref(), &[1.0], 0.5), Error::MatrixNotFinite { .. });

    let rule = Newmark::trapezoidal().tableau();
    for courant in [-0.1, f64::NAN, f64::INFINITY] {
        refused!(mass::optimal_weight(&rule, courant), Error::Parameter { .. });
    }
    assert!(mass::optimal_weight(&rule, 0.999).is_ok());
    refused!(mass::optimal_weight(&rule, 1.001), Error::Parameter { .. });
    refused!(mass::optimal_weight(&Newmark::new(0.3025, 0.6).unwrap().tableau(), 0.5), Error::Incompatible { .. });
    refused!(mass::optimal_weight(&Tableau::staged(vec![]), 0.5), Error::Tableau { .. });

    let courant = |m: &[f64], k: &Matrix, h| mass::courant(Mass::Lumped(m), k.as_ref(), h);
    for h in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        refused!(courant(&lumped, &k, h), Error::Parameter { .. });
    }
    refused!(courant(&lumped[..2], &k, 0.1), Error::Dimension { .. });
    refused!(courant(&[0.5, -1.0, 0.5], &k, 0.1), Error::Mass { dof: 1, .. });
    refused!(courant(&[1.0; 2], &matrix(2, [(0, 1, 1.0)]), 0.1), Error::Asymmetric { .. });
    refused!(mass::courant(Mass::Consistent(hollow.as_ref()), hollow.as_ref(), 0.1), Error::Mass { dof: 1, .. });
}
