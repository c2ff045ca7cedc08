//! Friction of few degrees of freedom: F3 (a block on an incline), F4 (the Coulomb oscillator and its belt), F5 (bodies
//! that come to roll, a disc that spins), F8 (Painlevé's rod), F9 (modes that couple).

use crate::Extent;
use crate::small::those;
use crate::table::Bound::AtMost;
use crate::table::{Row, each, rows};
use contact_dynamics::{ContactLaw, LinearRows, LinearSystem, Result, Simulation};
use contact_dynamics_scenes::combinations::Combination;
use contact_dynamics_scenes::schemes::Listed;
use contact_dynamics_scenes::sparse::{free, matrix};
use std::f64::consts::{PI, TAU};

const GRAVITY: f64 = 10.0;

/// Where blocks begin: what is below its rounding is no creep.
const START: f64 = 0.1;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    let mut all = incline(extent);
    all.extend(scales());
    all.extend(oscillator(extent));
    all.extend(belt());
    all.extend(rolling());
    all.extend(spinning(extent));
    all.extend(painleve());
    all.extend(coupled_modes(extent));
    all
}

/// All schemes by which a multiplier can impose contact; backward Euler at velocity level moves by the velocity of the
/// end of a step, and is of first order.
fn schemes() -> Vec<Combination> {
    those(|scheme: &Listed| scheme.takes_multipliers() && scheme.name() != "Moreau–Jean(1)")
}

/// Masses, each under a constant force, with a floor.
fn masses(
    row: &Combination,
    h: f64,
    mass: &[f64],
    force: Vec<f64>,
    velocity: Vec<f64>,
    floor: LinearRows<'static, f64>,
) -> Result<Simulation<'static, f64>> {
    let system = free(mass).load(move |_, f| f.copy_from_slice(&force));
    Simulation::builder(system, row.integrator()?, h).velocity(velocity).constraint(floor).build()
}

/// A block of mass 2, x down the slope and y off it.
fn block(row: &Combination, h: f64, slope: f64, friction: f64, v: f64) -> Result<Simulation<'static, f64>> {
    let weight = [2.0 * GRAVITY * slope.sin(), -2.0 * GRAVITY * slope.cos()];
    let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0)]]);
    let system = free(&[2.0; 2]).load(move |_, f| f.copy_from_slice(&weight));
    let builder = Simulation::builder(system, row.integrator()?, h);
    builder.displacement(vec![START, 0.0]).velocity(vec![v, 0.0]).constraint(floor).build()
}

fn incline(extent: &Extent) -> Vec<Row> {
    let slides = |row: &Combination| {
        let (slope, friction) = (0.5_f64, 0.3);
        let mut run = block(row, 0.01, slope, friction, 0.0)?;
        run.run_until(1.0, &mut ())?;
        let exact = GRAVITY * (slope.sin() - friction * slope.cos());
        Ok(vec![[(run.state().velocity()[0] / exact - 1.0).abs()]])
    };
    let asked = [("block on an incline: error of its acceleration", AtMost(1e-6))];
    let mut all = rows("F3", asked, &each(&schemes(), slides));
    let stops = |row: &Combination| {
        let of = |&phase: &f64| {
            let (h, friction) = (0.01, 0.25);
            let velocity = friction * GRAVITY * h * (40.0 + phase);
            let mut run = block(row, h, 0.0, friction, velocity)?;
            run.run_until(0.6, &mut ())?;
            let way = velocity * velocity / (2.0 * friction * GRAVITY);
            // The step in which it stops is of first order: v of its start, μ g h at most, over that step.
            Ok([
                (run.state().displacement()[0] - START - way).abs() / (friction * GRAVITY * h * h),
                run.state().velocity()[0].abs(),
            ])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked =
        [("block that stops: error of its way over μ g h²", AtMost(2.0)), ("its velocity afterwards", AtMost(1e-13))];
    all.extend(rows("F3", asked, &each(&schemes(), stops)));
    let steps = if extent.quick { 2000 } else { 1_000_000 };
    let rests = |row: &Combination| {
        let mut run = block(row, 0.01, 0.2, 0.25, 0.0)?;
        for _ in 0..steps {
            run.step()?;
        }
        let holds = run.state().contacts().friction_forces(0)[0] / (-2.0 * GRAVITY * 0.2_f64.sin()) - 1.0;
        Ok(vec![[(run.state().displacement()[0] - START).abs(), holds.abs()]])
    };
    let asked = [
        ("below the friction angle, 10⁶ steps (quick: 2000): creep", AtMost(0.0)),
        ("friction over what holds the block, − 1", AtMost(1e-9)),
    ];
    all.extend(rows("F3", asked, &each(&schemes(), rests)));
    all
}

/// Two masses tied by a spring slide down an incline: twelve decades of mass, stiffness and size.
fn scales() -> Vec<Row> {
    let run = |row: &Combination| {
        let (slope, friction) = (0.5_f64, 0.3);
        let exact = GRAVITY * (slope.sin() - friction * slope.cos());
        let mut all = Vec::new();
        for exponent in [-6, -3, 0, 3, 6] {
            for decades in [[exponent, 0, 0], [0, exponent, 0], [0, 0, exponent], [exponent, exponent, 3]] {
                let [mass, stiffness, size] = decades.map(|e| 10.0_f64.powi(e));
                let time = size.sqrt();
                let spring = [(0, 0, stiffness), (2, 2, stiffness), (0, 2, -stiffness), (2, 0, -stiffness)];
                let k = matrix(4, spring.into_iter().chain([(1, 1, 0.0), (3, 3, 0.0)]));
                let system = LinearSystem::lumped(vec![mass; 4], k)?.load(move |_, f| {
                    for node in 0..2 {
                        f[2 * node] = mass * GRAVITY * slope.sin();
                        f[2 * node + 1] = -mass * GRAVITY * slope.cos();
                    }
                });
                let floor = [0, 2].into_iter().fold(LinearRows::new(), |rows, x| {
                    rows.unilateral(&[(x + 1, 1.0)], 0.0).friction(friction, &[&[(x, 1.0)]])
                });
                let mut run = Simulation::builder(system, row.integrator()?, 0.01 * time).constraint(floor).build()?;
                run.run_until(time, &mut ())?;
                let miss = |x: usize| (run.state().displacement()[x] / (0.5 * exact * time * time) - 1.0).abs();
                all.push([miss(0).max(miss(2))]);
            }
        }
        Ok(all)
    };
    // Explicit schemes are beyond their limit with the stiffest springs.
    let implicit = those(|scheme| scheme.takes_multipliers() && scheme.radius.is_some() && scheme.order == 2);
    let asked = [("two masses on an incline, mass, stiffness, size over 12 decades: error of the way", AtMost(1e-6))];
    rows("F3", asked, &each(&implicit, run))
}

/// A unit mass on a unit spring, from x, on a floor with this friction, or a belt.
fn spring(row: &Combination, x: f64, friction: f64, h: f64, belt: f64) -> Result<Simulation<'static, f64>> {
    let system = LinearSystem::lumped(vec![1.0; 2], matrix(2, [(0, 0, 1.0), (1, 1, 0.0)]))?;
    let floor = LinearRows::new()
        .unilateral(&[(1, 1.0)], 0.0)
        .friction(friction / GRAVITY, &[&[(0, 1.0)]])
        .dragging(move |_| [[belt, 0.0], [0.0; 2]]);
    Simulation::builder(system.load(|_, f| f[1] = -GRAVITY), row.integrator()?, h)
        .displacement(vec![x, 0.0])
        .constraint(floor)
        .build()
}

fn oscillator(extent: &Extent) -> Vec<Row> {
    let run = |row: &Combination| {
        let of = |&phase: &f64| {
            let h = 0.005 * (1.0 + 0.01 * phase);
            let mut run = spring(row, 1.0, 0.15, h, 0.0)?;
            run.run_until(11.0, &mut ())?;
            let rest = run.state().displacement()[0];
            run.run_until(12.0, &mut ())?;
            // 1, −0.7, 0.4, −0.1: there it stays.
            Ok([(rest + 0.1).abs(), (run.state().displacement()[0] - rest).abs()])
        };
        extent.phases.iter().map(of).collect()
    };
    let asked = [
        ("Coulomb oscillator, h = 0.005: error of where it stops, over where it starts", AtMost(0.01)),
        ("creep there", AtMost(1e-15)),
    ];
    rows("F4", asked, &each(&schemes(), run))
}

fn belt() -> Vec<Row> {
    let (friction, belt) = (0.4, 0.1);
    let run = |row: &Combination| {
        let mut run = spring(row, 0.0, friction, 2e-3, belt)?;
        run.run_until(3.0, &mut ())?;
        let carried = (run.state().velocity()[0] - belt).abs();
        run.run_until(5.0, &mut ())?;
        let (mut largest, mut fastest) = (0.0_f64, 0.0_f64);
        while run.time() < 20.0 {
            run.step()?;
            largest = largest.max((run.state().displacement()[0] - friction).abs());
            fastest = fastest.max(run.state().velocity()[0]);
        }
        Ok(vec![[carried, (largest / belt - 1.0).abs(), fastest / belt - 1.0]])
    };
    let asked = [
        ("mass on a belt: velocity while it is carried − the belt's", AtMost(1e-12)),
        ("amplitude of the limit cycle, error", AtMost(0.02)),
        ("largest velocity over the belt's, − 1", AtMost(1e-4)),
    ];
    rows("F4", asked, &each(&schemes(), run))
}

/// Round bodies that slide at first: sphere and disc.
fn rolling() -> Vec<Row> {
    let run = |row: &Combination| {
        let of = |&inertia: &f64| {
            let (mass, radius, friction, speed) = (3.0, 0.5, 0.2, 2.0);
            let floor = LinearRows::new().unilateral(&[(1, 1.0)], 0.0).friction(friction, &[&[(0, 1.0), (2, radius)]]);
            let body = [mass, mass, inertia * mass * radius * radius];
            let mut run = masses(row, 0.0037, &body, vec![0.0, -mass * GRAVITY, 0.0], vec![speed, 0.0, 0.0], floor)?;
            // 2 v₀/(7 μ g) for a sphere, v₀/(3 μ g) for a disc.
            let time = speed / (friction * GRAVITY * (1.0 + inertia.recip()));
            // (Contact ahead of the state knows a step before that it rolls.)
            run.run_until(time - 3.0 * 0.0037, &mut ())?;
            let before = run.state().velocity()[0] - (speed - friction * GRAVITY * run.time());
            run.run_until(1.0, &mut ())?;
            let v = run.state().velocity();
            Ok([before.abs(), (v[0] / (speed / (1.0 + inertia)) - 1.0).abs(), (v[0] + radius * v[2]).abs()])
        };
        [0.4, 0.5].iter().map(of).collect()
    };
    let asked = [
        ("sphere and disc thrown with slip: velocity until they roll − exact", AtMost(1e-10)),
        ("velocity when they roll, error", AtMost(1e-10)),
        ("slip when they roll", AtMost(1e-12)),
    ];
    rows("F5", asked, &each(&schemes(), run))
}

/// A disc that spins flat on a floor stops after 3 R ω/(4 μ g); the cone is round in all directions.
fn spinning(extent: &Extent) -> Vec<Row> {
    let (rings, rays) = if extent.quick { (2, 6) } else { (4, 10) };
    let run = |row: &Combination| {
        let (radius, friction, spin) = (1.0, 0.3, 2.0);
        let points = rings * rays;
        let area = PI * radius * radius;
        let share = |k: usize| area * (2 * (k / rays) + 1) as f64 / (rings * rings * rays) as f64;
        let mass: Vec<f64> = (0..points).map(share).chain([0.5 * area * radius * radius]).collect();
        let force = (0..points).map(|k| -GRAVITY * share(k)).chain([0.0]).collect();
        let floor = (0..points).fold(LinearRows::new(), |rows, k| {
            let ring = (k / rays) as f64;
            // The radius at which the ring has its moment.
            let moment = ((ring + 1.0).powi(3) - ring.powi(3)) / (2.0 * ring + 1.0);
            let r = radius / rings as f64 * (2.0 / 3.0) * moment;
            let (sine, cosine) = (TAU * (k % rays) as f64 / rays as f64 + 0.1).sin_cos();
            let tangents: [&[_]; 2] = [&[(points, -r * sine)], &[(points, r * cosine)]];
            rows.unilateral(&[(k, 1.0)], 0.0).friction(friction, &tangents)
        });
        let velocity = (0..points).map(|_| 0.0).chain([spin]).collect();
        let h = 2e-3;
        let mut run = masses(row, h, &mass, force, velocity, floor)?;
        let end = 3.0 * radius * spin / (4.0 * friction * GRAVITY);
        let mut worst = 0.0_f64;
        while run.time() < end - 2.0 * h {
            run.step()?;
            worst = worst.max((run.state().velocity()[points] / spin - (1.0 - run.time() / end)).abs());
        }
        // (Noh and Bathe's end comes over some steps.)
        run.run_until(end + 40.0 * h, &mut ())?;
        Ok(vec![[worst, run.state().velocity()[points].abs()]])
    };
    let asked = [
        ("disc that spins flat on a floor: error of its velocity over the first", AtMost(1e-9)),
        ("velocity after 3 R ω/(4 μ g)", AtMost(1e-12)),
    ];
    rows("F5", asked, &each(&schemes(), run))
}

/// A rod that slides on its end: above the threshold no force lets it slide on, and an impact stops it at the start,
/// whose impulses have the ratio W_nn/W_nt; below it slides.
fn painleve() -> Vec<Row> {
    let (mass, half) = (1.0, 1.0);
    let inertia = mass * half * half / 3.0;
    let run = |row: &Combination| {
        let mut all = Vec::new();
        for angle in [0.6_f64, 1.0, 1.3] {
            let (sine, cosine) = angle.sin_cos();
            let threshold = (1.0 + 3.0 * cosine * cosine) / (3.0 * sine * cosine);
            let rod = |friction: f64| {
                let floor = LinearRows::new()
                    .unilateral(&[(1, 1.0), (2, -half * cosine)], 0.0)
                    .friction(friction, &[&[(0, 1.0), (2, half * sine)]]);
                let weight = vec![0.0, -mass * GRAVITY, 0.0];
                masses(row, 1e-3, &[mass, mass, inertia], weight, vec![-1.0, 0.0, 0.0], floor)
            };
            rod(0.999 * threshold)?.step()?;
            let mut run = rod(1.001 * threshold)?;
            let impact = run.start_adjustment().and_then(|adjustment| adjustment.impact);
            let ratio = impact.map(|impact| impact.friction[0] / impact.normal);
            run.step()?;
            all.push([ratio.map_or(f64::INFINITY, |ratio| (ratio / threshold - 1.0).abs())]);
        }
        Ok(all)
    };
    let asked = [(
        "Painlevé's rod: slides at 0.999 of the threshold, stopped by an impact at 1.001; error of its W_nn/W_nt",
        AtMost(1e-9),
    )];
    // (Contact ahead of the state has no force at the start: it stops the end in the first step.)
    let at_the_state = |scheme: &Listed| scheme.takes_corrections() || scheme.name() == "Moreau–Jean(0.5)";
    let at_the_state = those(|scheme: &Listed| scheme.takes_multipliers() && at_the_state(scheme));
    rows("F8", asked, &each(&at_the_state, run))
}

/// A mass on springs that are not along the floor, pressed on a belt: vibrations grow above a threshold of friction, as
/// the eigenvalues of the coupled modes say.
fn coupled_modes(extent: &Extent) -> Vec<Row> {
    let ([k11, k12, k22], k3, load) = ([2.0, -0.3, 1.0], 1.2, 10.0);
    let difference: f64 = k11 - (k22 + k3);
    let threshold = (-k12 - difference * difference / (4.0 * k12)) / k3;
    // (Until then what grows is far from the depth that is pressed in, beyond which it would lift off.)
    let small = 400.0;
    let growth = |row: &Combination, share: f64, until: f64| -> Result<f64> {
        let friction = share * threshold;
        let k = matrix(2, [(0, 0, k11), (0, 1, k12), (1, 0, k12), (1, 1, k22)]);
        let system = LinearSystem::lumped(vec![1.0; 2], k)?.load(move |_, f| f[1] = -load);
        let belt = LinearRows::new()
            .row(ContactLaw::Penalty { stiffness: k3 }, &[(1, 1.0)], 0.0)
            .friction(friction, &[&[(0, 1.0)]])
            .dragging(|_| [[1e3, 0.0], [0.0; 2]]);
        let coupled = k12 + friction * k3;
        let determinant = k11 * (k22 + k3) - k12 * coupled;
        let rest = [coupled * load / determinant, -k11 * load / determinant];
        let mut run = Simulation::builder(system, row.integrator()?, 0.05)
            .displacement(vec![rest[0] + 1e-4, rest[1]])
            .constraint(belt)
            .build()?;
        let mut largest = [0.0_f64; 2];
        while run.time() < until {
            run.step()?;
            let half = usize::from(run.time() > 0.5 * until);
            largest[half] = largest[half].max((run.state().displacement()[0] - rest[0]).abs());
        }
        Ok(largest[1] / largest[0])
    };
    // ω² = m ± i s, growth by the imaginary part of ω.
    let exact = |share: f64| {
        let coupled = k12 + share * threshold * k3;
        let mean = 0.5 * (k11 + k22 + k3);
        let size = (k11 * (k22 + k3) - k12 * coupled).sqrt();
        (0.5 * (size - mean)).sqrt()
    };
    let below = if extent.quick { 600.0 } else { 1200.0 };
    let run = |row: &Combination| {
        let rate = growth(row, 1.02, small)?.ln() / (0.5 * small);
        Ok(vec![[growth(row, 0.98, below)?, (rate / exact(1.02) - 1.0).abs()]])
    };
    let asked = [
        ("modes that couple by friction: growth at 0.98 of the threshold", AtMost(1.2)),
        ("error of the rate of growth at 1.02 of it", AtMost(0.1)),
    ];
    // Those without damping of their own; others move the threshold by it.
    let undamped = those(|scheme| scheme.takes_multipliers() && scheme.order == 2 && scheme.radius == Some(1.0));
    rows("F9", asked, &each(&undamped, run))
}
