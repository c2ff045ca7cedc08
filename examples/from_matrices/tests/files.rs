//! Runs through files: beside the crate itself bit for bit, beside exact solutions, and with mistakes in every file.

use clap::Parser;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{GeneralizedAlpha, LinearRows, LinearSystem, Simulation};
use from_matrices::options::Options;
use from_matrices::output::Summary;
use from_matrices::{Result, answer, run};
use std::collections::HashMap;
use std::path::Path;
use tempfile::TempDir;

/// Input files of a run, by the name of their option, and its other options.
struct Inputs {
    directory: TempDir,
    options: Vec<String>,
}

impl Inputs {
    fn new(files: &[(&str, &str)], options: &str) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let mut all = vec!["from-matrices".to_string()];
        for (name, content) in files {
            let suffix = if ["mass", "stiffness", "damping"].contains(name) { "mtx" } else { "csv" };
            let path = directory.path().join(format!("{name}.{suffix}"));
            std::fs::write(&path, content).unwrap();
            all.extend([format!("--{name}"), path.display().to_string()]);
        }
        all.extend(options.split_whitespace().map(String::from));
        all.extend(["--output".to_string(), directory.path().display().to_string()]);
        Self { directory, options: all }
    }

    fn run(&self) -> Result<Summary> {
        run(&Options::try_parse_from(&self.options).unwrap())
    }

    /// The lines of a table that was written, by the names of its columns.
    fn table(&self, name: &str) -> Vec<HashMap<String, String>> {
        let mut reader = csv::Reader::from_path(self.directory.path().join(name)).unwrap();
        reader.deserialize().map(|line: csv::Result<_>| line.unwrap()).collect()
    }
}

/// A cell as a number.
fn number(line: &HashMap<String, String>, column: &str) -> f64 {
    line[column].parse().unwrap()
}

/// Two bars of 20 elements, data as in the demonstration, without files.
#[test]
fn two_bars_through_files_are_the_crate_bit_for_bit() {
    let directory = tempfile::tempdir().unwrap();
    let inputs = directory.path().join("inputs").display().to_string();
    let command = answer(&Options::parse_from(["from-matrices", "--quick", "--demo", "bars", &inputs])).unwrap();
    let output = directory.path().join("results");
    let arguments = command.split(' ').map(String::from);
    let options =
        arguments.chain(["--record", "all", "--output"].map(String::from)).chain([output.display().to_string()]);
    run(&Options::parse_from(options)).unwrap();

    let (elements, size) = (20, 10.0 / 20.0);
    let (k, m, nodes) = (25.0 / size, 0.0025 * size, elements + 1);
    let element = |i: usize| [(i, i, k), (i + 1, i + 1, k), (i, i + 1, -k), (i + 1, i, -k)];
    let first = (0..2).flat_map(|bar| (0..elements).map(move |e| bar * nodes + e));
    let entries: Vec<_> = first.flat_map(element).map(|(i, j, x)| Triplet::new(i, j, x)).collect();
    let stiffness = SparseColMat::try_new_from_triplets(2 * nodes, 2 * nodes, &entries).unwrap();
    let is_end = |dof: usize| [0, elements, nodes, nodes + elements].contains(&dof);
    let mass = (0..2 * nodes).map(|dof| if is_end(dof) { m / 2.0 } else { m }).collect();
    let scheme = GeneralizedAlpha::chung_hulbert(0.8).unwrap();
    let mut direct = Simulation::builder(LinearSystem::lumped(mass, stiffness).unwrap(), scheme, 1e-3)
        .velocity((0..2 * nodes).map(|dof| if dof < nodes { 0.05 } else { -0.05 }).collect())
        .constraint(LinearRows::new().unilateral(&[(nodes, 1.0), (elements, -1.0)], 0.01))
        .build()
        .unwrap();

    let table = |name: &str| -> Vec<HashMap<String, String>> {
        let mut reader = csv::Reader::from_path(output.join(name)).unwrap();
        reader.deserialize().map(|line: csv::Result<_>| line.unwrap()).collect()
    };
    let (forces, motion) = (table("forces.csv"), table("motion.csv"));
    assert_eq!(forces.len(), 401);
    let mut pressed = 0;
    for (step, line) in forces.iter().enumerate() {
        if step > 0 {
            direct.step().unwrap();
        }
        let (state, contacts) = (direct.state(), direct.state().contacts());
        let expected = [state.time(), contacts.forces()[0], contacts.gaps()[0]];
        let found = ["time", "normal_force", "gap"].map(|column| number(line, column));
        assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "step {step}: {found:?}, {expected:?}");
        if step > 0 {
            assert_eq!(number(line, "impulse").to_bits(), contacts.impulses()[0].to_bits(), "step {step}");
        }
        assert_eq!(line["status"] == "open", !contacts.closed()[0]);
        pressed += usize::from(expected[1] > 0.0);
        for (dof, line) in motion[step * 2 * nodes..][..2 * nodes].iter().enumerate() {
            let expected = [state.displacement()[dof], state.velocity()[dof], state.acceleration()[dof]];
            let found = ["u", "v", "a"].map(|column| number(line, column));
            assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "step {step}, dof {dof}");
            assert_eq!(line["dof"], (dof + 1).to_string());
        }
    }
    // The bars touch for half of the run.
    assert!((190..=220).contains(&pressed), "{pressed}");
}

#[test]
fn demonstrations_meet_their_exact_solutions() {
    let directory = tempfile::tempdir().unwrap();
    let output = directory.path().display().to_string();
    let text = answer(&Options::parse_from(["from-matrices", "--quick", "--output", &output])).unwrap();
    let errors: Vec<f64> =
        text.lines().filter_map(|line| line.split_once("RMS error ")?.1.split(' ').next()?.parse().ok()).collect();
    // Bar and bars ring at the fronts of the waves, as coarse meshes do; the block's forces are exact.
    let [bar, bars, normal, friction] = errors[..] else { panic!("{text}") };
    assert!(bar > 0.0 && bar < 30.0 && bars > 0.0 && bars < 20.0, "{text}");
    assert!(normal == 0.0 && friction == 0.0, "{text}");
}

/// A block of mass 2 on a floor that leans by an angle whose tangent is 3/4, along axes of space.
fn incline(friction: f64) -> Inputs {
    let gravity = "0,-10";
    let contact = format!("node,dofs,normal,gap,friction\nblock,1 2,-3 4,0,{friction}\n");
    Inputs::new(
        &[
            ("mass", "%%MatrixMarket matrix array real general\n2 1\n2\n2\n"),
            ("stiffness", "%%MatrixMarket matrix coordinate real symmetric\n2 2 0\n"),
            ("contacts", &contact),
        ],
        &format!("--gravity {gravity} --step 0.01 --end 1"),
    )
}

/// Down the slope a = g (sin α − μ cos α) = 10 (0.6 − 0.8 μ); it sticks for μ above tan α.
#[test]
fn a_block_slides_down_an_incline_or_sticks() {
    let slides = incline(0.25);
    let summary = slides.run().unwrap();
    let last = slides.table("motion.csv");
    let [x, y] = [&last[last.len() - 2], &last[last.len() - 1]].map(|line| number(line, "u"));
    let way = 0.5 * 4.0;
    assert!((x + 0.8 * way).abs() < 1e-10 && (y + 0.6 * way).abs() < 1e-10, "{x}, {y}");
    let forces = slides.table("forces.csv");
    let end = forces.last().unwrap();
    assert_eq!(end["status"], "sliding");
    assert!((number(end, "normal_force") - 16.0).abs() < 1e-10 && (number(end, "friction") - 4.0).abs() < 1e-10);
    // The force on the block, along x and y: 16 (−0.6, 0.8) + 4 (0.8, 0.6).
    let [fx, fy] = ["force_1", "force_2"].map(|column| number(end, column));
    assert!((fx + 6.4).abs() < 1e-10 && (fy - 15.2).abs() < 1e-10, "{fx}, {fy}");
    let impulse: f64 = forces.iter().map(|line| number(line, "impulse")).sum();
    assert!((impulse - 16.0).abs() < 1e-10 && (summary.impulse - 16.0).abs() < 1e-10, "{impulse}");
    // What weight and friction have done is the energy: no other term.
    let works = summary.energies[1].works.unwrap();
    assert!((works.friction + 8.0).abs() < 1e-9 && (works.load - 24.0).abs() < 1e-9, "{works:?}");
    assert!(works.remainder.abs() < 1e-9, "{works:?}");

    let sticks = incline(0.8);
    sticks.run().unwrap();
    assert!(sticks.table("motion.csv").iter().all(|line| number(line, "u").abs() < 1e-12));
    let end = sticks.table("forces.csv").pop().unwrap();
    assert_eq!(end["status"], "sticking");
    assert!((number(&end, "friction") - 12.0).abs() < 1e-10);
}

/// A load that grows linearly, a support, damping by a matrix and by Rayleigh's coefficients, and every tenth step.
#[test]
fn loads_supports_and_damping_are_read() {
    let files = [
        ("mass", "%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 1\n2 2 1\n"),
        ("stiffness", "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 4\n2 1 -4\n2 2 4\n"),
        ("contacts", "node,dofs,normal,gap\nstop,2,-1,1\n"),
        ("supports", "dof\n1\n"),
        ("load", "time,dof,force\n0,2,0\n2,2,8\n"),
        ("damping", "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n1 1 2\n2 1 -2\n2 2 2\n"),
    ];
    let options = "--step 1e-3 --end 2 --every 10 --record all";
    let by_matrix = Inputs::new(&files, options);
    by_matrix.run().unwrap();
    let by_rayleigh = Inputs::new(&files[..5], &format!("{options} --rayleigh 0 0.5"));
    by_rayleigh.run().unwrap();
    let [one, other] = [&by_matrix, &by_rayleigh].map(|inputs| inputs.table("motion.csv"));
    assert_eq!((one.len(), other.len()), (402, 402));
    for (one, other) in one.iter().zip(&other) {
        assert!((number(one, "u") - number(other, "u")).abs() < 1e-12);
        // ü + 2 u̇ + 4 u = 4 t from rest, by hand: u = t − ½ + e⁻ᵗ (½ cos √3 t − sin √3 t / (2√3)); before the stop.
        let (t, root) = (number(one, "time"), 3.0_f64.sqrt());
        if one["dof"] == "2" && t < 1.0 {
            let exact = t - 0.5 + (-t).exp() * (0.5 * (root * t).cos() - (root * t).sin() / (2.0 * root));
            assert!((number(one, "u") - exact).abs() < 1e-5, "t = {t}: {} {exact}", one["u"]);
        }
        assert!(one["dof"] == "2" || number(one, "u") == 0.0);
    }
    let forces = by_matrix.table("forces.csv");
    assert!(number(forces.last().unwrap(), "normal_force") > 3.0, "the stop carries 8 − 4 at the end");
}

/// Two nodes opposite share a contact by their weights; explicit schemes take a consistent mass that is lumped.
#[test]
fn opposite_nodes_share_by_weight() {
    let inputs = Inputs::new(
        &[
            ("mass", "%%MatrixMarket matrix coordinate real symmetric\n3 3 3\n1 1 1\n2 2 1\n3 3 1\n"),
            ("stiffness", "%%MatrixMarket matrix coordinate real symmetric\n3 3 0\n"),
            ("contacts", "node,dofs,opposite,weights,normal,gap\na,1,2 3,0.25 0.75,1,0.1\n"),
            ("initial", "dof,v\n1,-1\n"),
        ],
        "--step 0.01 --end 0.5 --scheme cd-lagrange --lump --record 1-3",
    );
    inputs.run().unwrap();
    let motion = inputs.table("motion.csv");
    let v: Vec<f64> = motion[motion.len() - 3..].iter().map(|line| number(line, "v")).collect();
    // The impulse p acts as p on node 1, −p/4 and −3p/4 on the others: momentum is conserved, velocities as weights.
    assert!((v.iter().sum::<f64>() + 1.0).abs() < 1e-14 && (v[2] - 3.0 * v[1]).abs() < 1e-14, "{v:?}");
    // Plastic: the rate of the gap is zero.
    assert!((v[0] - 0.25 * v[1] - 0.75 * v[2]).abs() < 1e-14, "{v:?}");
}

#[test]
fn overlaps_are_refused_or_adjusted() {
    let contacts = "node,dofs,normal,gap\nfoot,1,1,-1e-3\n";
    let mass = "%%MatrixMarket matrix array real general\n1 1\n1\n";
    let stiffness = "%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 4\n";
    let files = [("mass", mass), ("stiffness", stiffness), ("contacts", contacts)];
    let sentence = Inputs::new(&files, "--step 0.1 --end 1").run().unwrap_err().to_string();
    assert!(sentence.contains("gap -1e-3") && sentence.contains("that of node foot"), "{sentence}");
    assert!(sentence.contains("contacts.csv, line 2"), "{sentence}");
    Inputs::new(&files, "--step 0.1 --end 1 --overlap adjusted").run().unwrap();
}

/// A gyroscopic C is skew: it does no work.
#[test]
fn unsymmetric_matrices_take_lu() {
    let inputs = Inputs::new(
        &[
            ("mass", "%%MatrixMarket matrix array real general\n2 1\n1\n1\n"),
            ("stiffness", "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 100\n2 2 100\n"),
            ("damping", "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n2 1 -15\n"),
            ("contacts", "node,dofs,normal,gap\nstop,1 2,1 0,10\n"),
            ("initial", "dof,u,v\n1,1,0\n2,0,20\n"),
        ],
        "--step 1e-3 --end 1 --scheme trapezoidal",
    );
    let summary = inputs.run().unwrap();
    assert!(summary.is_unsymmetric);
    let [start, end] = summary.energies;
    assert!((end.total() / start.total() - 1.0).abs() < 1e-10);
    // It whirls with ω = 20.
    let motion = inputs.table("motion.csv");
    let x = number(&motion[motion.len() - 2], "u");
    assert!((x - 20.0_f64.cos()).abs() < 1e-2, "{x}");
}

/// What is right, for the test of mistakes: a mass on a spring above a stop, two dofs.
const RIGHT: [(&str, &str); 3] = [
    ("mass", "%%MatrixMarket matrix array real general\n2 1\n1\n1\n"),
    ("stiffness", "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 4\n2 2 4\n"),
    ("contacts", "node,dofs,normal,gap\na,1 2,0 1,1\n"),
];

#[test]
fn each_mistake_has_a_sentence() {
    let time = "--step 0.1 --end 1";
    Inputs::new(&RIGHT, time).run().unwrap();
    let contacts = |line: &str| format!("node,dofs,normal,gap,friction,opposite,weights\n{line}\n");
    let general = |entries: &str| {
        let count = entries.lines().count();
        format!("%%MatrixMarket matrix coordinate real general\n2 2 {count}\n{entries}\n")
    };
    let cases: Vec<(&str, String, &str)> = vec![
        (
            "mass",
            "%%MatrixMarket matrix array real general\n3 1\n1\n1\n1\n".into(),
            "3 dofs, but the stiffness matrix has 2",
        ),
        ("mass", "%%MatrixMarket matrix array real general\n2 1\n1\n-1\n".into(), "the mass of dof 2 is -1.0"),
        ("mass", general("1 1 1\n2 2 1\n1 2 0.5"), "not symmetric: entry (1, 2) is 0.5, entry (2, 1) is 0.0"),
        ("stiffness", general("1 1 4\n2 2 4\n2 1 -1"), "one side of the diagonal alone"),
        ("stiffness", "%%MatrixMarket matrix coordinate real general\n2 3 0\n".into(), "this one is 2 × 3"),
        (
            "contacts",
            "node,dofs,normal\na,1,1\n".into(),
            "line 1: the column `gap` is missing; the columns are node, dofs",
        ),
        ("contacts", "node,dofs,normal,gap,mu\na,1,1,0,1\n".into(), "line 1: there is no column `mu`"),
        ("contacts", "node,dofs,normal,gap\na,1\n".into(), "line 2: 2 cells, but the first line names 4"),
        ("contacts", "node,dofs,normal,gap\n".into(), "the table has no contact"),
        ("contacts", contacts("a,3,1,0,,,"), "line 2: `dofs` is 3, it must be a dof from 1 to 2"),
        ("contacts", contacts("a,1 2,1,0,,,"), "line 2: 2 dofs and 1 components of the normal"),
        ("contacts", contacts("a,1 2,0 0,0,,,"), "line 2: the normal is zero"),
        ("contacts", contacts("a,1 1,0 1,0,,,"), "line 2: dof 1 is named twice"),
        ("contacts", contacts("a,1,1,NaN,,,"), "line 2: `gap` is NaN, it must be a finite number"),
        ("contacts", contacts("a,1 2,0 1,0,-1,,"), "line 2: `friction` is -1"),
        ("contacts", contacts("a,1,1,0,0.1,,"), "line 2: friction needs 2 or 3 dofs"),
        ("contacts", contacts("a,1,1,0,,2,0.5"), "line 2: 1 weights of 1 nodes with the sum 0.5"),
        ("contacts", contacts("a,1,1,0,,,\n\n# b\na,2,1,0,,,"), "line 5: the node `a` has a contact in line 2 already"),
        ("initial", "dof,u\n1,x\n".into(), "line 2: `u` is x"),
        ("initial", "dof,u\n1,0\n1,1\n".into(), "line 3: dof 1 has its motion in line 2 already"),
        ("load", "time,dof,force\n1,1,1\n1,1,2\n".into(), "line 3: time 1.0 of dof 1 is not after 1.0"),
        ("supports", "dof\n2\n2\n".into(), "line 3: dof 2 is fixed in line 2 already"),
        ("damping", "%%MatrixMarket matrix coordinate real symmetric\n1 1 0\n".into(), "1 dofs, but the stiffness"),
    ];
    for (name, content, sentence) in cases {
        let mut files: Vec<_> = RIGHT.iter().copied().filter(|file| file.0 != name).collect();
        files.push((name, &content));
        let inputs = Inputs::new(&files, time);
        let found = inputs.run().unwrap_err().to_string();
        assert!(found.contains(sentence), "{content}{found}");
        assert!(found.contains(&format!("{name}.")), "the file is not named: {found}");
    }
    for (options, sentence) in [
        ("--step 0 --end 1", "--step is 0, it must be positive"),
        ("--step 0.1 --end NaN", "--end is NaN"),
        ("--step 1e-9 --end 100", "are both in the same unit?"),
        ("--step 0.1 --end 1 --scheme rk4", "no scheme `rk4`; the names are chung-hulbert"),
        ("--step 0.1 --end 1 --correction yes", "no correction `yes`; the names are default"),
        ("--step 0.1 --end 1 --gravity 0,0,-10", "--gravity has 3 components, but 2 dofs are no multiple"),
        ("--step 0.1 --end 1 --record 1-9", "--record: `1-9` is not a dof from 1 to 2"),
        ("--step 0.1 --end 1 --every 0", "--every is 0"),
        // ω = 2: central differences are stable up to h = 1.
        ("--step 1.5 --end 3 --scheme central-difference", "beyond the stability limit"),
    ] {
        let found = Inputs::new(&RIGHT, options).run().unwrap_err().to_string();
        assert!(found.contains(sentence), "{options}: {found}");
    }
    let mut inputs = Inputs::new(&RIGHT, time);
    let missing = Path::new("nowhere").join("K.mtx").display().to_string();
    inputs.options[4] = missing.clone();
    let found = inputs.run().unwrap_err().to_string();
    assert!(found.contains(&missing) && found.contains("cannot be opened"), "{found}");
    let found = answer(&Options::parse_from(["from-matrices", "--demo", "ball", "x"])).unwrap_err().to_string();
    assert!(found.contains("no demonstration `ball`; the names are bar, bars, slide"), "{found}");
}
