//! Some of the scenes that `--example random_scenes` draws by the thousand, and how it makes them smaller.

use contact_dynamics_random_scenes::rows::{KINDS, Recipe, shrunk};

#[test]
fn scenes_by_chance_hold_what_must_hold() {
    let (mut built, mut closed, mut compared) = (0, 0, 0);
    for seed in 0..3000 {
        let recipe = Recipe::of_seed(seed);
        let verdict = recipe.examine();
        if let Some(finding) = verdict.finding {
            panic!("`--example random_scenes -- --scene {seed}`: {finding}\n{}", recipe.summary());
        }
        built += usize::from(verdict.built);
        closed += verdict.closed;
        compared += verdict.compared;
    }
    assert!(built > 1500 && closed > 10_000 && compared > 40_000, "{built} {closed} {compared}");
}

/// The same by conjugate gradients in place of W. Hardening springs show whether a resumed run, which does not know the
/// contact forces of the stage before, takes as many iterations as the run itself.
#[test]
fn scenes_without_w_hold_what_must_hold() {
    let mut closed = 0;
    for seed in 10_000..11_500 {
        let recipe = Recipe::of_seed(seed).without_w();
        let verdict = recipe.examine();
        if let Some(finding) = verdict.finding {
            panic!("`--example random_scenes -- --without-w --scene {seed}`: {finding}\n{}", recipe.summary());
        }
        closed += verdict.closed;
    }
    assert!(closed > 5_000, "{closed}");
}

/// Scenes with rows that pulled, or beside friction missed their gap or rubbed beyond their cone, whose results
/// depended on units, on the order of rows, or on a common velocity, whose energy grew, and such as could not go on from
/// a state that the host does not admit though the run itself did.
#[test]
fn scenes_that_have_failed_hold() {
    let by_units = [40_062_161, 50_043_714, 50_122_859, 50_123_697, 90_017_504, 91_237_725];
    let by_units = by_units.into_iter().chain([80_276_381, 92_222_309, 94_064_348, 94_109_335]);
    let by_units = by_units.chain([95_397_770, 95_411_149, 96_434_204, 99_075_647, 101_796_554, 103_495_303]);
    let by_units = by_units.chain([105_752_472, 105_843_541, 110_253_182, 110_675_828, 140_065_947]);
    let by_order = [40_073_095, 50_175_212, 60_019_637, 60_025_014, 70_203_147, 80_267_802, 80_288_695, 80_397_469];
    let by_order = by_order.into_iter().chain([80_649_817, 91_268_618, 92_799_461, 96_569_854, 96_862_299]);
    let by_friction = [93_518_671, 95_441_833, 97_020_357, 97_083_399, 97_653_618, 100_387_625];
    let by_start = [103_572_554];
    let by_velocity = [70_113_558, 80_083_120, 80_155_686, 90_202_306];
    let by_energy = [10_004_401, 50_162_224, 70_122_330, 80_083_433, 80_204_920, 90_151_631, 97_407_527, 103_452_536];
    let by_energy = by_energy.into_iter().chain([97_064_646, 105_032_403]);
    let not_resumed = [50_041_867, 60_027_999];
    for seed in by_units
        .chain(by_order)
        .chain(by_velocity)
        .chain(by_energy)
        .chain(not_resumed)
        .chain(by_friction)
        .chain(by_start)
    {
        let recipe = Recipe::of_seed(seed);
        let verdict = recipe.examine();
        assert_eq!(verdict.finding, None, "`--example random_scenes -- --scene {seed}`: {}", recipe.summary());
        assert!(verdict.compared >= 2, "{seed}: {}", verdict.compared);
    }
}

#[test]
fn all_kinds_are_drawn_and_refusals_have_words() {
    let mut seen = Vec::new();
    for seed in 0..200 {
        let recipe = Recipe::of_seed(seed);
        if !seen.contains(&recipe.kind) {
            seen.push(recipe.kind);
        }
        if let Some((name, words)) = recipe.examine().refused {
            assert!(!name.is_empty() && words.len() > 20, "{name}: {words}");
        }
    }
    assert!(KINDS.iter().all(|kind| seen.contains(kind) || *kind == "lattices"), "{seen:?}");
}

/// Scenes that are large enough for threads to share them are rare.
#[test]
fn lattices_are_the_same_by_one_thread_and_three() {
    let large = (0..40_000).filter(|&seed| Recipe::of_seed(seed).kind == "lattices").take(3);
    let mut compared = 0;
    for seed in large {
        let verdict = Recipe::of_seed(seed).examine();
        assert_eq!(verdict.finding, None, "{seed}");
        compared += verdict.compared;
    }
    assert!(compared >= 6, "{compared}");
}

#[test]
fn scenes_shrink_to_what_they_fail_by() {
    // Say that whatever is pressed twice fails: nothing but two pressed rows and a step to press them is left.
    let fails = |recipe: &Recipe| recipe.rows.len() >= 2 && recipe.examine().closed > 0;
    let mut shrunken = 0;
    for seed in 0..20 {
        let recipe = Recipe::of_seed(seed);
        if !fails(&recipe) {
            continue;
        }
        let least = shrunk(&recipe, fails);
        assert!(fails(&least) && least.rows.len() == 2, "{seed}: {}", least.summary());
        assert!(least.damping.iter().all(|d| *d == 0.0) && least.load.amplitude.iter().all(|f| *f == 0.0), "{least:?}");
        assert!(least.dofs() <= recipe.dofs() && least.steps <= recipe.steps);
        shrunken += 1;
    }
    assert!(shrunken >= 5, "{shrunken}");
}
