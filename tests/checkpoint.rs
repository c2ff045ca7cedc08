//! Checkpoints: runs saved as text or bytes go on bit for bit, and files that no run has left are refused.

use contact_dynamics::contact::{Plane, Side, Sphere};
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::tableau::{StartUp, Tableau};
use contact_dynamics::{
    CdLagrange, Checkpoint, Composite, ContactState, Energy, Error, GeneralizedAlpha, Houbolt, InitialOverclosure,
    LinearRows, LinearSystem, Newmark, NodesOnObstacle, Outcome, PersistencyCorrection, Real, Result, Simulation,
    SimulationBuilder, Statistics, StepControl, System, TimeIntegrator, Works,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::hosts::Hooked;
use contact_dynamics_scenes::schemes::{Listed, all};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::matrix;
use proptest::prelude::*;
use serde_json::{Value, json};

const H: f64 = 1e-3;

/// A checkpoint as text and as bytes.
#[derive(Clone, Debug, PartialEq)]
struct Files {
    text: String,
    bytes: Vec<u8>,
}

fn save<T: Real>(run: &Simulation<'_, T>) -> Files {
    let checkpoint = run.checkpoint();
    Files { text: serde_json::to_string(&checkpoint).unwrap(), bytes: postcard::to_stdvec(&checkpoint).unwrap() }
}

/// The checkpoint of both files, which must be the same to the last bit.
fn read<T: Real>(files: &Files) -> [Checkpoint<T>; 2] {
    let (text, bytes) = (serde_json::from_str(&files.text).unwrap(), postcard::from_bytes(&files.bytes).unwrap());
    for checkpoint in [&text, &bytes] {
        assert_eq!(postcard::to_stdvec::<Checkpoint<T>>(checkpoint).unwrap(), files.bytes);
    }
    [text, bytes]
}

/// Work counts of the steps since an earlier moment.
fn work(run: &Simulation<'_, impl Real>, since: Statistics) -> [u64; 6] {
    let now = *run.statistics();
    [
        now.steps - since.steps,
        now.newton_iterations - since.newton_iterations,
        now.contact_solves - since.contact_solves,
        now.contact_changes - since.contact_changes,
        now.refused_steps - since.refused_steps,
        now.coarse_steps - since.coarse_steps,
    ]
}

/// Takes steps with a run and with those that go on from its files: all that later steps read, and the work, are the
/// same.
fn go_on<'a, T: Real>(
    run: &mut Simulation<'a, T>,
    resumed: impl Fn(Checkpoint<T>) -> Simulation<'a, T>,
    steps: usize,
    what: &str,
) {
    let files = save(run);
    let mut others = read(&files).map(resumed);
    let since = *run.statistics();
    let begun = others.each_ref().map(|other| *other.statistics());
    for step in 0..steps {
        run.step().unwrap();
        for (other, begun) in others.iter_mut().zip(begun) {
            other.step().unwrap();
            assert_eq!(run.state(), other.state(), "{what}, step {step}");
            assert_eq!(work(run, since), work(other, begun), "{what}, step {step}");
        }
    }
    for other in &others {
        assert_eq!(save(run), save(other), "{what}");
    }
}

/// A host, last committed at `last`, that admits no step longer than `limit` that ends in the window.
fn reluctant(
    system: LinearSystem<'static, f64>,
    mut last: f64,
    window: [f64; 2],
    limit: f64,
) -> impl System<f64> + 'static {
    Hooked::new(system, move |method, t, _| {
        if method != "commit" {
            return Ok(());
        }
        if (window[0]..window[1]).contains(&t) && t - last > limit * (1.0 + 1e-6) {
            return Err(Error::Inadmissible { callback: method, source: "an element is turned inside out".into() });
        }
        last = t;
        Ok(())
    })
}

/// The bars of the paper, by a scheme with the default correction where there is one.
fn bars<T: Real>(scheme: &Listed, h: f64) -> SimulationBuilder<'static, T> {
    let bars = Bars::paper(10).delayed(0.4, H);
    Simulation::builder(bars.system::<T>(), (scheme.make)(), h)
        .velocity(bars.velocities().into_iter().map(T::of).collect())
        .constraint(bars.contact())
}

/// Schemes that take the contact of the bars.
fn schemes() -> Vec<Listed> {
    let schemes: Vec<_> = all().into_iter().filter(Listed::takes_multipliers).collect();
    assert!(schemes.len() > 25);
    schemes
}

#[test]
fn runs_of_every_scheme_go_on_bit_for_bit() {
    for scheme in schemes() {
        let mut run = bars::<f64>(&scheme, H).build().unwrap();
        // At the start and as a past is collected, in flight, from before the impact to behind it, before release.
        for until in [0, 1, 2, 3, 50, 99, 100, 101, 102, 200, 290] {
            while run.statistics().steps < until {
                run.step().unwrap();
            }
            let mut branch = bars::<f64>(&scheme, H).resume_from(run.checkpoint()).build().unwrap();
            let resumed = |checkpoint| bars::<f64>(&scheme, H).resume_from(checkpoint).build().unwrap();
            go_on(&mut branch, resumed, 25, &format!("{} from {until}", scheme.name()));
        }
        assert!(run.statistics().contact_changes > 0);
    }
}

#[test]
fn runs_in_single_precision_go_on_too_and_only_there() {
    for scheme in schemes().iter().step_by(3) {
        let mut run = bars::<f32>(scheme, H).build().unwrap();
        run.run_until(0.15, &mut ()).unwrap();
        let files = save(&run);
        let refused = serde_json::from_str::<Checkpoint<f64>>(&files.text).unwrap_err().to_string();
        assert!(refused.contains("f32") && refused.contains("f64"), "{refused}");
        assert!(postcard::from_bytes::<Checkpoint<f64>>(&files.bytes).is_err());
        let resumed = |checkpoint| bars::<f32>(scheme, H).resume_from(checkpoint).build().unwrap();
        go_on(&mut run, resumed, 100, &scheme.name());
    }
    let run = bars::<f64>(&schemes()[0], H).build().unwrap();
    assert!(serde_json::from_str::<Checkpoint<f32>>(&save(&run).text).is_err());
    assert!(postcard::from_bytes::<Checkpoint<f32>>(&save(&run).bytes).is_err());
}

#[test]
fn runs_whose_step_has_changed_go_on_bit_for_bit() {
    for scheme in schemes() {
        let mut run = bars::<f64>(&scheme, H).build().unwrap();
        run.run_until(0.15, &mut ()).unwrap();
        for (h, steps) in [(0.5 * H, 1), (0.7 * H, 1), (H, 2), (0.9 * H, 5)] {
            run.set_step_size(h).unwrap();
            for _ in 0..steps {
                let mut branch = bars::<f64>(&scheme, h).resume_from(run.checkpoint()).build().unwrap();
                let resumed = |checkpoint| {
                    let mut run = bars::<f64>(&scheme, h).resume_from(checkpoint).build().unwrap();
                    run.set_step_size(0.6 * h).unwrap();
                    run
                };
                let files = save(&branch);
                branch.set_step_size(0.6 * h).unwrap();
                let others = read(&files).map(resumed);
                for other in &others {
                    assert_eq!(save(&branch), save(other), "{}", scheme.name());
                }
                let resumed = |checkpoint| bars::<f64>(&scheme, 0.6 * h).resume_from(checkpoint).build().unwrap();
                go_on(&mut branch, resumed, 5, &scheme.name());
                run.step().unwrap();
            }
        }
    }
}

#[test]
fn controlled_runs_of_every_scheme_go_on_bit_for_bit() {
    let control = StepControl::halving(H / 64.0).unwrap().contact_changes(1).unwrap();
    for scheme in schemes() {
        let builder = |last: f64| {
            let bars = Bars::paper(10).delayed(0.4, H);
            let system = reluctant(bars.system(), last, [0.1503, 0.1597], H / 8.0);
            Simulation::builder(system, (scheme.make)(), H)
                .velocity(bars.velocities())
                .constraint(bars.contact())
                .step_control(control)
        };
        let mut run = builder(0.0).build().unwrap();
        run.run_until(0.149, &mut ()).unwrap();
        let mut smallest = H;
        // Halved, held, and growing again; the last of these steps have the nominal size.
        for step in 0..150 {
            run.step().unwrap();
            smallest = smallest.min(run.step_size());
            if step % 7 == 0 || run.step_size() < H && step % 2 == 0 {
                let t = run.time();
                let mut branch = builder(t).resume_from(run.checkpoint()).build().unwrap();
                let resumed = |checkpoint| builder(t).resume_from(checkpoint).build().unwrap();
                go_on(&mut branch, resumed, 20, &format!("{} at {t}", scheme.name()));
            }
        }
        assert!(smallest == H / 8.0 && run.step_size() == H, "{}: {smallest}", scheme.name());
    }
}

#[test]
fn a_refused_step_leaves_no_trace_in_a_file() {
    for scheme in schemes() {
        let builder = |limit: f64| {
            let bars = Bars::paper(10).delayed(0.4, H);
            let system = reluctant(bars.system(), 0.0, [0.1495, 0.1505], limit);
            Simulation::builder(system, (scheme.make)(), H).velocity(bars.velocities()).constraint(bars.contact())
        };
        let (mut run, mut other) = (builder(0.5 * H).build().unwrap(), builder(H).build().unwrap());
        for run in [&mut run, &mut other] {
            for _ in 0..149 {
                run.step().unwrap();
            }
        }
        let before = save(&run);
        run.step().unwrap_err();
        assert_eq!(save(&run), before, "{}", scheme.name());
        // The step that is taken instead knows nothing of it either.
        for run in [&mut run, &mut other] {
            run.set_step_size(0.5 * H).unwrap();
            run.step().unwrap();
        }
        assert_eq!(save(&run), save(&other), "{}", scheme.name());
    }
}

/// A ball rolls over a block whose foot is driven: candidates come and go.
fn rolling() -> SimulationBuilder<'static, f64> {
    let block = Solid::rectangle([1.0; 2], [6; 2], Material { young: 100.0, poisson: 0.3, density: 1.0 });
    let top: Vec<usize> = block.surface_nodes().into_iter().filter(|&n| block.nodes[n][1] > 0.99).collect();
    let ball = Sphere::new([-0.3, 1.45], 0.5, Side::Outside).unwrap();
    let contact = NodesOnObstacle::new(ball, &block.nodes, &block.node_dofs(), &top).unwrap();
    let contact = contact.reach(0.04).unwrap().moving(|t| [[t, 0.0], [1.0, 0.0], [0.0; 2]]);
    let foot = (0..block.nodes.len()).filter(|&n| block.nodes[n][1] < 0.01);
    let system = foot.fold(block.system(), |system: LinearSystem<'static, f64>, n| {
        let system = system.drive(2 * n, |t: f64| [1e-3 * (1.0 - t.cos()), 1e-3 * t.sin(), 1e-3 * t.cos()]).unwrap();
        system.fix(2 * n + 1).unwrap()
    });
    Simulation::builder(system, Composite, 0.02).constraint(contact)
}

#[test]
fn candidates_that_come_and_go_are_kept_by_name() {
    let mut run = rolling().build().unwrap();
    let mut found = Vec::new();
    for _ in 0..12 {
        run.run_until(run.time() + 0.1, &mut ()).unwrap();
        found.push(run.gaps().len());
        let mut branch = rolling().resume_from(run.checkpoint()).build().unwrap();
        go_on(&mut branch, |checkpoint| rolling().resume_from(checkpoint).build().unwrap(), 10, "ball");
    }
    found.dedup();
    assert!(found.len() > 2, "{found:?}");
}

/// Two masses on a string of springs, the last one without mass and 1e-3 deep in a wall, which it is pushed out of.
fn string(scheme: impl TimeIntegrator + 'static) -> SimulationBuilder<'static, f64> {
    let entries = [(0, 0, 18.0), (1, 1, 18.0), (2, 2, 9.0), (0, 1, -9.0), (1, 0, -9.0), (1, 2, -9.0), (2, 1, -9.0)];
    let entries: Vec<_> = entries.into_iter().map(|(i, j, k)| Triplet::new(i, j, k)).collect();
    let k = SparseColMat::<usize, f64>::try_new_from_triplets(3, 3, &entries).unwrap();
    Simulation::builder(LinearSystem::lumped(vec![1.0, 1.0, 0.0], k).unwrap(), scheme, 0.01)
        .velocity(vec![-0.1, -0.2, -0.3])
        .constraint(LinearRows::new().unilateral(&[(2, 1.0)], -1e-3).unilateral(&[(1, 1.0)], 0.01))
        .initial_overclosure(InitialOverclosure::RemovedOver(0.5))
}

#[test]
fn overlaps_and_dofs_without_mass_go_on_too() {
    for start_up in [StartUp::Trapezoidal, StartUp::Taylor] {
        let mut run = string(Houbolt).start_up(start_up).build().unwrap();
        for steps in [0, 1, 1, 5, 20, 30] {
            for _ in 0..steps {
                run.step().unwrap();
            }
            let mut branch = string(Houbolt).resume_from(run.checkpoint()).build().unwrap();
            go_on(&mut branch, |checkpoint| string(Houbolt).resume_from(checkpoint).build().unwrap(), 60, "string");
        }
    }
}

/// A small run that has all that a file may hold: a past, a trail, stored accelerations of another time, contacts,
/// overlaps.
fn small(scheme: impl TimeIntegrator + 'static) -> SimulationBuilder<'static, f64> {
    let entries: Vec<_> = [(0, 0, 18.0), (1, 1, 9.0), (0, 1, -9.0), (1, 0, -9.0)]
        .into_iter()
        .map(|(i, j, k)| Triplet::new(i, j, k))
        .collect();
    let k = SparseColMat::<usize, f64>::try_new_from_triplets(2, 2, &entries).unwrap();
    Simulation::builder(LinearSystem::lumped(vec![1.0; 2], k).unwrap(), scheme, 0.01)
        .velocity(vec![-0.1, -0.2])
        .constraint(LinearRows::new().unilateral(&[(1, 1.0)], -1e-3).unilateral(&[(0, 1.0)], 1e-3))
        .initial_overclosure(InitialOverclosure::RemovedOver(0.5))
        .step_control(StepControl::halving(1e-4).unwrap().contact_changes(1).unwrap())
}

fn alpha() -> GeneralizedAlpha {
    GeneralizedAlpha::chung_hulbert(0.8).unwrap()
}

/// Saves of a multistep scheme and of one that stores its accelerations elsewhere, after a step at a smaller size.
fn samples() -> [Files; 2] {
    fn sample(mut run: Simulation<'static, f64>) -> Files {
        run.run_until(0.1, &mut ()).unwrap();
        run.set_step_size(0.005).unwrap();
        run.step().unwrap();
        run.set_step_size(0.01).unwrap();
        save(&run)
    }
    [sample(small(Houbolt).build().unwrap()), sample(small(alpha()).build().unwrap())]
}

/// Builds from what was read, and takes steps. They may fail, but never panic.
fn try_out(checkpoint: Checkpoint<f64>) -> Result<()> {
    let built = match checkpoint.scheme() == Houbolt.name() {
        true => small(Houbolt).resume_from(checkpoint).build(),
        false => small(alpha()).resume_from(checkpoint).build(),
    };
    let mut run = built?;
    for _ in 0..4 {
        if run.step().is_err() {
            break;
        }
    }
    Ok(())
}

/// Every value in a document, by its path.
fn paths(value: &Value, path: &str, all: &mut Vec<String>) {
    all.push(path.to_owned());
    match value {
        Value::Array(items) => {
            for (i, item) in items.iter().enumerate() {
                paths(item, &format!("{path}/{i}"), all);
            }
        }
        Value::Object(fields) => {
            for (name, field) in fields {
                paths(field, &format!("{path}/{name}"), all);
            }
        }
        _ => {}
    }
}

#[test]
fn documents_with_one_wrong_value_are_refused_or_run() {
    let (mut refused, mut taken) = (0, 0);
    for files in samples() {
        let document: Value = serde_json::from_str(&files.text).unwrap();
        let mut all = Vec::new();
        paths(&document, "", &mut all);
        assert!(all.len() > 80, "{}", all.len());
        let wrong = [
            json!(null),
            json!(-1),
            json!(0),
            json!(1),
            json!(2),
            json!(77),
            json!(1e308),
            json!(-1e-308),
            json!(u64::MAX),
            json!(1_u64 << 53),
            json!("text"),
            json!([]),
            json!([0.5]),
            json!({}),
            json!(true),
        ];
        for path in &all {
            let mut variants: Vec<Value> = wrong.to_vec();
            let right = document.pointer(path).unwrap();
            match right {
                Value::Array(items) => {
                    variants.push(items[..items.len().saturating_sub(1)].into());
                    variants.push(items.iter().chain(items.last()).cloned().collect());
                }
                Value::Object(fields) => variants.extend(fields.keys().map(|left_out| {
                    let fields = fields.iter().filter(|(name, _)| *name != left_out);
                    Value::Object(fields.map(|(name, field)| (name.clone(), field.clone())).collect())
                })),
                Value::Number(number) => {
                    let x = number.as_f64().unwrap();
                    variants.extend([json!(-x), json!(2.0 * x), json!(number.as_u64().map_or(0, |n| n + 1))]);
                }
                _ => {}
            }
            for variant in variants {
                let mut document = document.clone();
                *document.pointer_mut(path).unwrap() = variant;
                match serde_json::from_value::<Checkpoint<f64>>(document).map(try_out) {
                    Ok(Ok(())) => taken += 1,
                    Ok(Err(_)) | Err(_) => refused += 1,
                }
            }
        }
    }
    assert!(refused > taken && taken > 100, "{refused} {taken}");
}

/// Counts of a run are numbers that `f64` has exactly.
#[test]
fn counts_that_no_run_reaches_are_refused() {
    for Files { text, .. } in samples() {
        for (path, name) in [
            ("/history/clock/steps", "the number of steps of a checkpoint"),
            ("/history/pace/position", "the place in the nominal grid of a checkpoint"),
        ] {
            let mut document: Value = serde_json::from_str(&text).unwrap();
            assert!(document.pointer(path).unwrap().as_u64().unwrap() < 1 << 53);
            *document.pointer_mut(path).unwrap() = json!((1_u64 << 53) + 1);
            let error = serde_json::from_value::<Checkpoint<f64>>(document).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
}

#[test]
fn bytes_that_are_cut_or_flipped_are_refused_or_run() {
    for Files { text, bytes } in samples() {
        for length in 0..bytes.len() {
            assert!(postcard::from_bytes::<Checkpoint<f64>>(&bytes[..length]).is_err());
        }
        for length in (0..text.len()).filter(|&length| text.is_char_boundary(length)) {
            assert!(serde_json::from_str::<Checkpoint<f64>>(&text[..length]).is_err());
        }
        for place in 0..bytes.len() {
            for bit in 0..8 {
                let mut flipped = bytes.clone();
                flipped[place] ^= 1 << bit;
                if let Ok(checkpoint) = postcard::from_bytes(&flipped) {
                    try_out(checkpoint).ok();
                }
            }
        }
    }
}

/// In text there are no such numbers, in bytes there are.
#[test]
fn bytes_of_numbers_that_are_not_finite_are_refused() {
    for Files { text, bytes } in samples() {
        let mut all = Vec::new();
        let document = serde_json::from_str(&text).unwrap();
        paths(&document, "", &mut all);
        let mut tried = 0;
        for path in all {
            let Some(number) = document.pointer(&path).filter(|value| value.is_f64()).and_then(Value::as_f64) else {
                continue;
            };
            // (Of zeros and ones there are more than those of this place.)
            let written = number.to_le_bytes();
            let places = bytes.windows(8).enumerate().filter(|(_, window)| *window == written).map(|(place, _)| place);
            for place in places.filter(|_| written[..4] != [0; 4]) {
                for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
                    let mut changed = bytes.clone();
                    changed[place..place + 8].copy_from_slice(&wrong.to_le_bytes());
                    let refused = match postcard::from_bytes(&changed) {
                        Ok(checkpoint) => try_out(checkpoint).is_err(),
                        Err(_) => true,
                    };
                    assert!(refused, "{path}, {number}: {wrong}");
                    tried += 1;
                }
            }
        }
        assert!(tried > 100, "{tried}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn bytes_that_are_mangled_are_refused_or_run(
        which in 0_usize..2,
        writes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        moved in prop::option::of((any::<prop::sample::Index>(), any::<prop::sample::Index>())),
        foreign in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        thread_local!(static SAMPLES: [Files; 2] = samples());
        let mut bytes = SAMPLES.with(|samples| samples[which].bytes.clone());
        if let Some((from, to)) = moved {
            let byte = bytes.remove(from.index(bytes.len()));
            bytes.insert(to.index(bytes.len()), byte);
        }
        for (place, byte) in writes {
            let place = place.index(bytes.len());
            bytes[place] = byte;
        }
        if let Ok(checkpoint) = postcard::from_bytes(&bytes) {
            try_out(checkpoint).ok();
        }
        prop_assert!(postcard::from_bytes::<Checkpoint<f64>>(&foreign).is_err());
    }
}

#[test]
fn other_files_and_formats_are_refused_in_words() {
    let [files, _] = samples();
    let read = |text: &str| serde_json::from_str::<Checkpoint<f64>>(text).unwrap_err().to_string();
    for (written, words) in [
        (files.text.replace("checkpoint 6", "checkpoint 7"), ["format 7", "reads format 6"]),
        (files.text.replace("contact-dynamics checkpoint", "results"), ["no checkpoint", "contact-dynamics"]),
        (files.text.replace("\"f64\"", "\"f16\""), ["f16", "f64"]),
        ("7".to_owned(), ["a checkpoint of contact-dynamics", "integer"]),
    ] {
        assert_ne!(written, files.text);
        let refused = read(&written);
        assert!(words.iter().all(|words| refused.contains(words)), "{refused}");
    }
    let mut document: Value = serde_json::from_str(&files.text).unwrap();
    document["state"]["contacts"]["closed"].as_array_mut().unwrap().pop();
    let refused = read(&document.to_string());
    assert!(refused.contains("closed flags") && refused.contains("size 1, expected 2"), "{refused}");
    // Motions have one entry a dof if they are read, and none if they are not.
    for (motion, entries, words) in [
        ("/history/slots/0", json!([0.0, 0.0]), "size 2, expected 0"),
        ("/history/slots/1", json!([]), "size 0, expected 2"),
        ("/history/computed/states/0/0", json!([0.0]), "size 1, expected 2"),
    ] {
        let mut document: Value = serde_json::from_str(&files.text).unwrap();
        document.pointer_mut(motion).unwrap()["u"] = entries;
        let refused = read(&document.to_string());
        assert!(refused.contains("displacement of a checkpoint") && refused.contains(words), "{refused}");
    }
    let mut document: Value = serde_json::from_str(&files.text).unwrap();
    document["history"]["slots"].as_array_mut().unwrap().truncate(1);
    let refused = read(&document.to_string());
    assert!(refused.contains("the past of a checkpoint"), "{refused}");
}

#[test]
fn another_layout_is_another_format() {
    let [files, _] = samples();
    let document: Value = serde_json::from_str(&files.text).unwrap();
    assert_eq!(document["format"], "contact-dynamics checkpoint 6");
    // Whoever changes one of these lists, or the order or meaning of what is in them, raises the number above.
    for (path, names) in [
        ("", "format history rows scalar state"),
        ("/state", "broken contacts motion rates"),
        ("/state/motion", "a t u v"),
        (
            "/state/contacts",
            "closed dissipated gap ids impulse lambda lambda_a lambda_raw lambda_v sliding slip tangents",
        ),
        ("/history", "clock computed known made_with overclosures pace scheme slopes slots smooth unshifted"),
        ("/history/clock", "elapsed h origin steps"),
        ("/history/pace", "grown kept lasting level nominal patience position steps"),
        ("/history/computed", "known states"),
        ("/history/overclosures", "depths over start"),
    ] {
        let fields = document.pointer(path).and_then(Value::as_object).unwrap();
        let mut found: Vec<&str> = fields.keys().map(String::as_str).collect();
        found.sort_unstable();
        assert_eq!(found.join(" "), names, "{path}");
    }
}

/// A scheme that calls itself by another's name.
#[derive(Debug)]
struct Disguised(GeneralizedAlpha, String);

impl TimeIntegrator for Disguised {
    fn name(&self) -> String {
        self.1.clone()
    }
    fn tableau(&self) -> Tableau {
        self.0.tableau()
    }
}

#[test]
fn what_does_not_fit_the_run_is_refused() {
    let mut run = small(alpha()).build().unwrap();
    run.run_until(0.1, &mut ()).unwrap();
    let files = save(&run);
    let checkpoint = || read::<f64>(&files)[0].clone();
    let scheme = small(Newmark::trapezoidal()).resume_from(checkpoint()).build();
    assert!(matches!(scheme, Err(Error::Incompatible { part, .. }) if part.contains(&alpha().name())));
    let scheme = small(CdLagrange).resume_from(checkpoint()).build();
    assert!(matches!(scheme, Err(Error::Incompatible { .. })));
    let other = GeneralizedAlpha::chung_hulbert(0.7).unwrap();
    let disguised = small(Disguised(other, alpha().name())).resume_from(checkpoint()).build();
    assert!(matches!(disguised, Err(Error::Incompatible { reason, .. }) if reason.contains("rows")));
    small(Disguised(alpha(), alpha().name())).resume_from(checkpoint()).build().unwrap();
    let dofs = bars::<f64>(&Listed { make: || Box::new(alpha()), ..all()[0] }, 0.01);
    let dofs = dofs.unchecked_stability().resume_from(checkpoint()).build();
    assert!(matches!(dofs, Err(Error::Dimension { expected: 22, found: 2, .. })));
    let size = small(alpha()).resume_from(checkpoint());
    assert!(size.build().is_ok());
    let size = Simulation::builder(LinearSystem::lumped(vec![1.0; 2], free(2)).unwrap(), alpha(), 0.02);
    assert!(matches!(size.resume_from(checkpoint()).build(), Err(Error::Parameter { .. })));
    let massless = string(alpha()).resume_from(checkpoint()).build();
    assert!(massless.is_err());
    // State and history of two instants.
    run.step().unwrap();
    let (early, late): (Value, Value) =
        (serde_json::from_str(&files.text).unwrap(), serde_json::from_str(&save(&run).text).unwrap());
    for (state, history) in [(&early, &late), (&late, &early)] {
        let mut mixed = state.clone();
        mixed["history"] = history["history"].clone();
        let mixed: Checkpoint<f64> = serde_json::from_value(mixed).unwrap();
        let refused = small(alpha()).resume_from(mixed).build();
        assert!(matches!(refused, Err(Error::Incompatible { part, .. }) if part.contains("a state of t")));
    }
}

fn free(dofs: usize) -> SparseColMat<usize, f64> {
    SparseColMat::try_new_from_triplets(dofs, dofs, &[Triplet::new(0, 0, 0.0)]).unwrap()
}

#[test]
fn a_file_can_be_read_without_a_run() {
    let mut run = small(alpha()).build().unwrap();
    run.run_until(0.1, &mut ()).unwrap();
    let [checkpoint, _] = read::<f64>(&save(&run));
    assert_eq!(checkpoint.state(), run.state());
    assert_eq!(checkpoint.scheme(), alpha().name());
    assert_eq!(checkpoint.history().step_size().to_bits(), run.step_size().to_bits());
    assert_eq!(checkpoint.history().past(1), run.history().past(1));
    let contacts: &ContactState<f64> = checkpoint.state().contacts();
    assert_eq!(contacts.ids().len(), 2);
}

#[test]
fn results_are_plain_data() {
    fn again<D: serde::Serialize + serde::de::DeserializeOwned>(data: &D) -> [D; 2] {
        let text = serde_json::to_string(data).unwrap();
        [serde_json::from_str(&text).unwrap(), postcard::from_bytes(&postcard::to_stdvec(data).unwrap()).unwrap()]
    }
    for overclosure in [InitialOverclosure::Refused, InitialOverclosure::RemovedOver(0.1)] {
        assert_eq!(again(&overclosure), [overclosure; 2]);
    }
    assert_eq!(again(&StartUp::Taylor), [StartUp::Taylor; 2]);
    assert_eq!(again(&Outcome::Stopped), [Outcome::Stopped; 2]);
    let mut run = small(Houbolt).energy_balance().build().unwrap();
    run.run_until(0.3, &mut ()).unwrap();
    let (energy, statistics): (Energy<f64>, Statistics) = (run.energy(), *run.statistics());
    assert_eq!(again(&energy), [energy; 2]);
    assert_eq!(again(&statistics), [statistics; 2]);
    // Counts that an earlier version did not have are zero.
    assert_eq!(serde_json::from_str::<Statistics>(r#"{"steps":3}"#).unwrap().steps, 3);
    // Works add up over the parts of a run.
    let mut resumed = small(Houbolt).energy_balance().resume_from(run.checkpoint()).build().unwrap();
    run.run_until(0.6, &mut ()).unwrap();
    resumed.run_until(0.6, &mut ()).unwrap();
    let [whole, first, second] = [run.energy(), energy, resumed.energy()].map(|energy| energy.works.unwrap());
    let parts = |of: fn(&Works<f64>) -> f64| (of(&whole), of(&first) + of(&second));
    for (whole, parts) in [parts(|w| w.contact), parts(|w| w.corrections), parts(|w| w.remainder)] {
        assert!((whole - parts).abs() < 1e-12, "{whole} {parts}");
    }
}

#[test]
fn a_fall_with_the_correction_of_the_past_goes_on_bit_for_bit() {
    let block = Solid::block([1.0; 3], [2; 3], Material { young: 1.0, poisson: 0.3, density: 1.0 }).lifted(1e-3);
    let build = || {
        let floor = Plane::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
        let feet: Vec<usize> = (0..block.nodes.len()).filter(|&n| block.nodes[n][2] < 0.1).collect();
        Simulation::builder(block.system(), Composite, 0.02)
            .velocity(block.uniform([0.0, 0.0, -0.01]))
            .constraint(NodesOnObstacle::new(floor, &block.nodes, &block.node_dofs(), &feet).unwrap())
            .corrector(PersistencyCorrection::with_history_projection())
    };
    let mut run = build().build().unwrap();
    // From right before the impact, whose correction edits the past.
    while !run.state().contacts().closed().contains(&true) {
        let mut branch = build().resume_from(run.checkpoint()).build().unwrap();
        go_on(&mut branch, |checkpoint| build().resume_from(checkpoint).build().unwrap(), 3, "block");
        run.step().unwrap();
    }
    go_on(&mut run, |checkpoint| build().resume_from(checkpoint).build().unwrap(), 100, "block");
}

/// Masses that slide and stick, one of them not rough: friction forces, slips and flags are part of the file, and a
/// file with wrong ones is refused.
#[test]
fn friction_goes_on_too() {
    let scene = || {
        let k = matrix(6, (0..3).flat_map(|m| [(2 * m, 2 * m, 30.0), (2 * m + 1, 2 * m + 1, 0.0)]));
        let system = LinearSystem::lumped(vec![1.0; 6], k).unwrap().load(|_, f: &mut [f64]| {
            (f[1], f[3], f[5]) = (-10.0, -10.0, -10.0);
        });
        let floor = LinearRows::new()
            .unilateral(&[(1, 1.0)], 0.0)
            .friction(0.3, &[&[(0, 1.0)]])
            .unilateral(&[(3, 1.0)], 0.0)
            .unilateral(&[(5, 1.0)], 0.01)
            .friction(0.1, &[&[(4, 1.0)]]);
        let velocity = vec![1.0, 0.0, 1.0, 0.0, 2.0, -1.0];
        Simulation::builder(system, Composite, 0.01).velocity(velocity).constraint(floor).energy_balance()
    };
    let mut run = scene().build().unwrap();
    for steps in [3, 20, 60] {
        for _ in 0..steps {
            run.step().unwrap();
        }
        let files = save(&run);
        let mut resumed = scene().resume_from(read::<f64>(&files)[0].clone()).build().unwrap();
        let mut other = scene().resume_from(run.checkpoint()).build().unwrap();
        for _ in 0..30 {
            resumed.step().unwrap();
            other.step().unwrap();
        }
        assert!(resumed.state() == other.state());
        assert_eq!(resumed.energy(), other.energy());
    }
    let mut document: Value = serde_json::from_str(&save(&run).text).unwrap();
    assert_eq!(document["state"]["contacts"]["tangents"], json!([[0.3, 1], [0.0, 0], [0.1, 1]]));
    for (field, value, words) in [
        ("tangents", json!([[0.3, 1], [0.0, 0], [0.1, 0]]), "contact forces"),
        ("tangents", json!([[0.3, 1], [0.1, 1]]), "friction of the contacts"),
        ("tangents", json!([[-0.3, 1], [0.0, 0], [0.1, 1]]), "friction coefficient"),
        ("tangents", json!([[0.3, 3], [0.0, 0], [0.1, 1]]), "tangents of a contact"),
        ("sliding", json!([true]), "sliding contacts"),
        ("slip", json!([0.0]), "slips"),
    ] {
        let before = std::mem::replace(&mut document["state"]["contacts"][field], value);
        let refused = serde_json::from_str::<Checkpoint<f64>>(&document.to_string()).unwrap_err().to_string();
        assert!(refused.contains(words), "{field}: {refused}");
        document["state"]["contacts"][field] = before;
    }
}

/// A writer that has room for so many bytes.
struct Full {
    room: usize,
}

impl std::io::Write for Full {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let written = bytes.len().min(self.room);
        self.room -= written;
        match written {
            0 => Err(std::io::ErrorKind::StorageFull.into()),
            _ => Ok(written),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Whatever byte the disk is full after, the format says so, and the run goes on as if nothing had been written.
#[test]
fn a_full_disk_is_an_error_and_the_run_goes_on() {
    let mut run = small(alpha()).build().unwrap();
    let mut untouched = small(alpha()).build().unwrap();
    for _ in 0..3 {
        run.step().unwrap();
        untouched.step().unwrap();
    }
    let files = save(&run);
    for room in 0..files.text.len() {
        let error = serde_json::to_writer(Full { room }, &run.checkpoint()).unwrap_err();
        assert_eq!(error.io_error_kind(), Some(std::io::ErrorKind::StorageFull), "{room}");
    }
    serde_json::to_writer(Full { room: files.text.len() }, &run.checkpoint()).unwrap();
    for room in 0..files.bytes.len() {
        assert!(postcard::to_io(&run.checkpoint(), Full { room }).is_err(), "{room}");
    }
    postcard::to_io(&run.checkpoint(), Full { room: files.bytes.len() }).unwrap();
    assert_eq!(save(&run), files);
    for _ in 0..3 {
        run.step().unwrap();
        untouched.step().unwrap();
        assert_eq!(run.state(), untouched.state());
    }
}
