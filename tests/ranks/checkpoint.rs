//! A run that is saved over some ranks goes on over others, or in one piece.

use crate::bodies::{Blocks, Seen, difference, linear, linear_part, record};
use crate::parts::{SolidPart, on_ranks};
use contact_dynamics::{Bathe, Checkpoint, Composite, Error, LinearSystem, Newmark, Simulation, TimeIntegrator};
use contact_dynamics_scenes::sparse::{matrix, springs};

const H: f64 = 2e-3;
const STEPS: usize = 30;

/// Goes on from a checkpoint of the whole over so many ranks; what is seen, and the checkpoint of the whole at the end.
fn go_on<I: TimeIntegrator + 'static>(
    blocks: &Blocks,
    scheme: impl Fn() -> I + Sync,
    (count, start): (usize, Option<&Checkpoint<f64>>),
    h: [f64; 2],
) -> (Vec<Seen>, Checkpoint<f64>) {
    let mut runs = on_ranks(count, |rank, meeting| {
        let set_up = |part: &SolidPart<2>| Simulation::builder(linear_part(part, false), scheme(), h[0]);
        let (own, builder) = blocks.on_rank((rank, meeting), set_up).unwrap();
        let builder = match start {
            Some(start) => builder.resume_from(start.part(&own.part.whole).unwrap()),
            None => builder,
        };
        let mut run = builder.build().unwrap();
        let whole = |values: &[f64]| own.part.gather(values).unwrap();
        let mut seen = record(&mut run, STEPS / 2, whole, &vec![1.0; own.part.whole.len()]).unwrap();
        run.set_step_size(h[1]).unwrap();
        seen.extend(record(&mut run, STEPS / 2, whole, &vec![1.0; own.part.whole.len()]).unwrap());
        // (As the file of a rank.)
        let file = serde_json::to_string(&run.checkpoint()).unwrap();
        (seen, (serde_json::from_str(&file).unwrap(), own.part.whole.clone()))
    });
    let parts: Vec<(Checkpoint<f64>, Vec<usize>)> = runs.iter().map(|run| run.1.clone()).collect();
    (runs.swap_remove(0).0, Checkpoint::joined(&parts, blocks.solid.dofs()).unwrap())
}

#[test]
fn saved_over_n_ranks_and_read_by_m() {
    let blocks = Blocks::new();
    let check = |name: &str, counts: [usize; 3], apart: f64| {
        println!("{name} {counts:?}: {apart:e}");
        assert!(apart < 1e-10, "{name} {counts:?}: {apart:e}");
    };
    for counts in [[1, 2, 3], [3, 1, 2], [2, 3, 1]] {
        // A multistep scheme whose step changes has a trail of motions as well.
        let expected = whole_run(&blocks, || Composite);
        check("composite", counts, over_ranks(&blocks, || Composite, counts, &expected));
        let bathe = || Bathe::with_radius(0.5).unwrap();
        let expected = whole_run(&blocks, bathe);
        check("Bathe", counts, over_ranks(&blocks, bathe, counts, &expected));
    }
}

/// Steps of two sizes, three times one after the other.
const SIZES: [[f64; 2]; 3] = [[H, 0.7 * H], [0.7 * H, H], [H, H]];

fn over_ranks<I: TimeIntegrator + 'static>(
    blocks: &Blocks,
    scheme: impl Fn() -> I + Sync,
    counts: [usize; 3],
    expected: &[Seen],
) -> f64 {
    let (mut found, mut start) = (Vec::new(), None);
    for (count, h) in counts.into_iter().zip(SIZES) {
        let (seen, end) = go_on(blocks, &scheme, (count, start.as_ref()), h);
        found.extend(seen);
        start = Some(end);
    }
    difference(expected, &found)
}

/// The same without ranks, and without a stop.
fn whole_run<I: TimeIntegrator + 'static>(blocks: &Blocks, scheme: impl Fn() -> I) -> Vec<Seen> {
    let builder = Simulation::builder(linear(&blocks.solid, false), scheme(), H).velocity(blocks.velocity());
    let mut run = builder.constraints(blocks.contact(0.3, |node| node).unwrap()).build().unwrap();
    let mut seen = Vec::new();
    for h in SIZES.into_iter().flatten() {
        run.set_step_size(h).unwrap();
        seen.extend(record(&mut run, STEPS / 2, <[f64]>::to_vec, &vec![1.0; blocks.solid.dofs()]).unwrap());
    }
    assert!(seen.iter().any(|seen| seen.forces.iter().any(|&force| force > 0.0)));
    seen
}

#[test]
fn parts_that_do_not_fit_are_refused() {
    let blocks = Blocks::new();
    let end = |steps: usize| {
        let builder = Simulation::builder(linear(&blocks.solid, false), Composite, H).velocity(blocks.velocity());
        let mut run = builder.constraints(blocks.contact(0.3, |node| node).unwrap()).build().unwrap();
        (0..steps).for_each(|_| run.step().unwrap());
        run.checkpoint()
    };
    let (whole, later, dofs) = (end(3), end(4), blocks.solid.dofs());
    let half = |first: usize, last: usize| (first..last).collect::<Vec<_>>();
    let part = |of: &Checkpoint<f64>, list: Vec<usize>| (of.part(&list).unwrap(), list);
    let [low, high] = [half(0, dofs / 2), half(dofs / 2, dofs)];
    let join = |parts: &[(Checkpoint<f64>, Vec<usize>)]| Checkpoint::joined(parts, dofs);
    let joined = join(&[part(&whole, high.clone()), part(&whole, low.clone())]).unwrap();
    assert_eq!(joined.state(), whole.state());
    let error = join(&[part(&whole, low.clone()), part(&later, high.clone())]).unwrap_err();
    assert!(matches!(error, Error::Incompatible { .. }) && error.to_string().contains("instants"), "{error}");
    let error = join(&[part(&whole, low.clone())]).unwrap_err();
    assert!(error.to_string().contains("belongs to none"), "{error}");
    assert!(matches!(join(&[]), Err(Error::Empty { .. })));
    let mut wrong = part(&whole, low);
    wrong.1.push(3);
    assert!(matches!(join(&[wrong]), Err(Error::Dimension { .. })));
    assert!(matches!(whole.part(&[dofs]), Err(Error::MissingDof { .. })));
    // Velocities of dofs without mass are differenced, and lists of those are not divided.
    let k = matrix(2, springs(2, 1.0));
    let without = LinearSystem::lumped(vec![1.0, 0.0], k).unwrap();
    let massless = Simulation::builder(without, Newmark::trapezoidal(), H).build().unwrap().checkpoint();
    for error in [massless.part(&[0]).unwrap_err(), Checkpoint::joined(&[(massless, vec![0, 1])], 2).unwrap_err()] {
        assert!(error.to_string().contains("without mass"), "{error}");
    }
}
