//! The program from outside: what it computes against closed forms, restarts, and what it says to bad input.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A directory of a test, removed at its end.
struct Directory(PathBuf);

impl Directory {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("drop_test_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str, content: &str) -> String {
        std::fs::write(self.0.join(name), content).unwrap();
        self.path(name)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// The columns of history.csv in a directory below this one.
    fn history(&self, run: &str) -> Vec<Vec<f64>> {
        let text = std::fs::read_to_string(self.0.join(run).join("history.csv")).unwrap();
        let rows = text.lines().skip(1).map(|line| line.split(',').map(|x| x.parse().unwrap()).collect());
        rows.collect()
    }
}

impl Drop for Directory {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_drop-test")).args(arguments).output().unwrap()
}

/// Runs and returns what was printed.
fn succeed(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap() + &String::from_utf8(output.stderr).unwrap()
}

fn shipped(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes").join(name).to_str().unwrap().to_owned()
}

/// A block of hexahedra in Gmsh's format 4.1: `size` in millimeters.
fn block(size: [f64; 3], cells: [usize; 3]) -> String {
    let points = cells.map(|n| n + 1);
    let count: usize = points.iter().product();
    let mut text = format!("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {count} 1 {count}\n3 1 0 {count}\n");
    (1..=count).for_each(|tag| writeln!(text, "{tag}").unwrap());
    for k in 0..count {
        let at = [k % points[0], k / points[0] % points[1], k / points[0] / points[1]];
        let x = [0, 1, 2].map(|i| size[i] * at[i] as f64 / cells[i] as f64);
        writeln!(text, "{} {} {}", x[0], x[1], x[2]).unwrap();
    }
    let elements: usize = cells.iter().product();
    write!(text, "$EndNodes\n$Elements\n1 {elements} 1 {elements}\n3 1 5 {elements}\n").unwrap();
    for e in 0..elements {
        let at = [e % cells[0], e / cells[0] % cells[1], e / cells[0] / cells[1]];
        let node = |d: [usize; 3]| {
            let [i, j, k] = [at[0] + d[0], at[1] + d[1], at[2] + d[2]];
            1 + i + points[0] * (j + points[1] * k)
        };
        let corners =
            [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]].map(node);
        let corners = corners.map(|corner| corner.to_string()).join(" ");
        writeln!(text, "{} {corners}", e + 1).unwrap();
    }
    text + "$EndElements\n"
}

/// E, ν = 0 and ρ of a bar whose waves are those of one dimension: c = 1000 m/s.
const BAR: &str = "E=1e9,nu=0,rho=1000";

#[test]
fn the_force_of_a_bar_is_that_of_its_wave() {
    let directory = Directory::new("bar");
    let mesh = directory.file("bar.msh", &block([5.0, 5.0, 100.0], [1, 1, 40]));
    for model in ["linear", "neo-hookean"] {
        let output = directory.path(model);
        let common = ["--material", BAR, "--gravity", "0", "--speed", "1", "--height", "0.001", "--model", model];
        let words =
            [&[mesh.as_str()], &common[..], &["--steps", "200", "--step", "1.25e-6", "--output", &output]].concat();
        succeed(&words);
        let rows = directory.history(model);
        // F₀ = ρ c A v for 2 L/c; linear strains. (At large ones waves of compression are a little faster.)
        let (exact, duration) = (1000.0 * 1000.0 * 25e-6, 0.2 / 1000.0);
        let first = rows.iter().find(|row| row[3] > 0.0).unwrap()[0];
        let plateau: Vec<f64> = rows
            .iter()
            .filter(|row| row[0] > first + 0.1 * duration && row[0] < first + 0.9 * duration)
            .map(|row| row[3])
            .collect();
        let mean = plateau.iter().sum::<f64>() / plateau.len() as f64;
        assert!((mean / exact - 1.0).abs() < 0.01, "{model}: {mean} {exact}");
        assert!(plateau.iter().all(|f| (f / exact - 1.0).abs() < 0.1), "{model}: {plateau:?}");
        // The impulse turns the motion around, but for what the impact of the lowest nodes and the scheme take.
        let impulse: f64 = rows.windows(2).map(|w| 0.5 * (w[0][3] + w[1][3]) * (w[1][0] - w[0][0])).sum();
        assert!((impulse / (2.0 * 2.5e-3) - 1.0).abs() < 0.03, "{model}: {impulse}");
        assert!(rows.iter().all(|row| row[1].abs() < 1e-6 * exact && row[2].abs() < 1e-6 * exact));
    }
}

#[test]
fn a_block_slides_down_a_slope_as_coulomb_says() {
    // After the impact along the slope; the run begins at contact with no height to fall through.
    let directory = Directory::new("slope");
    let mesh = directory.file("block.msh", &block([20.0, 10.0, 5.0], [4, 2, 1]));
    let output = directory.path("run");
    let words = [
        &mesh,
        "--material",
        "rubber",
        "--height",
        "0",
        "--slope",
        "30",
        "--turn",
        "0,30,0",
        "--friction",
        "0.3",
        "--steps",
        "400",
        "--step",
        "5e-5",
        "--output",
        &output,
    ];
    succeed(&words);
    let rows = directory.history("run");
    // On average the friction is μ times the normal force, along the slope.
    let (s, c) = 30.0_f64.to_radians().sin_cos();
    let late = &rows[200..];
    let mean = |f: &dyn Fn(&[f64]) -> f64| late.iter().map(|row| f(row)).sum::<f64>() / late.len() as f64;
    let normal = mean(&|row| s * row[1] + c * row[3]);
    let along = mean(&|row| c * row[1] - s * row[3]);
    assert!((along / normal + 0.3).abs() < 1e-3, "{along} {normal}");
    let weight = 1100.0 * 1e-6 * 9.81;
    assert!((normal / (weight * c) - 1.0).abs() < 0.05, "{normal} {}", weight * c);
    // Energy that the motion has lost is what friction has taken, but for what the scheme damps. (The work of friction is
    // that of the trapezoidal rule, and of the impulses in steps in which nodes come down again: of order h.)
    let total = |row: &[f64]| row[5] + row[6] + row[7];
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);
    let lost = total(first) - total(last);
    assert!(last[8] > 0.0 && lost >= last[8] * (1.0 - 1e-3), "{lost} {}", last[8]);
}

#[test]
fn a_run_goes_on_bit_for_bit() {
    let directory = Directory::new("restart");
    let (jack, cup) = (shipped("jack.msh"), shipped("cup.msh"));
    let scene = [
        jack.as_str(),
        "--onto",
        &cup,
        "--material",
        "nylon",
        "--target-material",
        "abs",
        "--friction",
        "0.2",
        "--speed",
        "3",
        "--offset",
        "0.038,0",
        "--turn",
        "10,20,0",
        "--frames",
        "2",
    ];
    let [whole, half, rest] = ["whole", "half", "rest"].map(|name| directory.path(name));
    succeed(&[&scene[..], &["--steps", "40", "--output", &whole]].concat());
    succeed(&[&scene[..], &["--steps", "17", "--output", &half]].concat());
    let checkpoint = directory.path("half/checkpoint.bin");
    succeed(&["--restart", &checkpoint, "--steps", "23", "--frames", "2", "--output", &rest]);
    let (expected, found) = (directory.history("whole"), directory.history("rest"));
    assert!(expected.iter().any(|row| row[4] > 0.0), "nothing has touched");
    assert_eq!(expected.len(), found.len());
    for (a, b) in expected.iter().zip(&found) {
        assert_eq!(a[..8], b[..8]);
        // Works count from the start of a run: a sum of two sums, and a first step that knows no slip before it.
        assert!((a[8] - b[8]).abs() <= 1e-6 * a[8].abs(), "{} {}", a[8], b[8]);
    }
    // The list of pictures goes on as well.
    let list = std::fs::read_to_string(directory.0.join("rest/series.pvd")).unwrap();
    assert_eq!(list.matches("<DataSet").count(), 5);

    // A mesh that has changed since, and a file that is damaged.
    let mut bytes = std::fs::read(&checkpoint).unwrap();
    let end = bytes.len() / 2;
    bytes.truncate(end);
    std::fs::write(directory.0.join("damaged.bin"), &bytes).unwrap();
    refused(&["--restart", &directory.path("damaged.bin")], "is damaged");
    let mesh = directory.file("block.msh", &block([10.0; 3], [1; 3]));
    let output = directory.path("changed");
    succeed(&[&mesh, "--steps", "2", "--output", &output]);
    directory.file("block.msh", &block([11.0; 3], [1; 3]));
    refused(&["--restart", &directory.path("changed/checkpoint.bin")], "a mesh has changed");
}

/// The program refuses the arguments with a sentence that has these words.
fn refused(arguments: &[&str], words: &str) {
    let output = run(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{arguments:?} is accepted");
    assert!(said.contains(words) && !said.contains("panicked"), "{arguments:?}: {said}");
}

#[test]
fn bad_input_is_refused_with_what_to_do() {
    let directory = Directory::new("bad");
    let out = directory.path("out");
    let with_output =
        |output: &str, arguments: &[&str], words| refused(&[arguments, &["--output", output]].concat(), words);
    let refused = |arguments: &[&str], words| with_output(&out, arguments, words);
    let cup = shipped("cup.msh");
    let good = block([1.0; 3], [1; 3]);
    let file = |name, content: &str| directory.file(name, content);
    refused(&["missing.msh"], "missing.msh cannot be read");
    refused(&[], "required");
    refused(&[&cup, "--unit", "furlong"], "possible values: m, cm, mm, in");
    refused(&[&cup, "--material", "cheese"], "take one of steel");
    refused(&[&cup, "--onto", "sand"], "neither `plane` nor `ball`");
    refused(&[&cup, "--onto", "gone.msh"], "gone.msh cannot be read");
    refused(&[&cup, "--friction", "-1"], "from 0");
    refused(&[&cup, "--friction", "NaN"], "from 0");
    refused(&[&cup, "--turn", "1,2"], "3 numbers");
    refused(&[&cup, "--steps", "0"], "--steps is 0");
    refused(&[&cup, "--step", "-1e-6"], "positive");
    refused(&[&cup, "--onto", "ball", "--offset", "1,0"], "falls past");
    refused(&[&cup, "--gravity", "0"], "never touches");
    refused(&[&cup, "--scheme", "cd-lagrange", "--step", "1"], "stab");
    refused(&["--restart", &cup], "is no checkpoint");
    refused(&["--restart", "gone.bin", "--friction", "0.1"], "cannot be used with");
    refused(&[&file("text.msh", "solid cube")], "is no Gmsh mesh");
    refused(&[&file("old.msh", &good.replace("4.1 0 8", "2.2 0 8"))], "format 2.2");
    for head in ["4.1 0 8999999999999999999999", "4.1 0 3", "4.1 7 8", "4.1 0"] {
        refused(&[&file("head.msh", &good.replace("4.1 0 8", head))], "its second line");
    }
    refused(&[&file("short.msh", &good[..good.len() / 2])], "is damaged");
    refused(
        &[&file("flat.msh", &good.replace("3 1 5 1\n1 1 2", "3 1 5 1\n1 2 1"))],
        "element 1, a hexahedron, is turned",
    );
    refused(&[&file("node.msh", &good.replace("3 1 5 1\n1 1 2", "3 1 5 1\n1 1 99"))], "names node 99");
    refused(&[&file("prism.msh", &good.replace("3 1 5 1\n1 1 2 4 3 5 6 8 7", "3 1 6 1\n1 1 2 4 5 6 8"))], "prisms");
    refused(
        &[&file("second.msh", &good.replace("3 1 5 1\n1 1 2 4 3 5 6 8 7", "3 1 11 1\n1 1 2 4 3 5 6 8 7 1 2"))],
        "-order 1",
    );
    refused(&[&file("lines.msh", &good.replace("3 1 5 1\n1 1 2 4 3 5 6 8 7", "1 1 1 1\n1 1 2"))], "no tetrahedra");
    std::fs::write(directory.0.join("blocked"), "").unwrap();
    let blocked = directory.path("blocked/below");
    with_output(&blocked, &[&cup], "cannot be made");
}

#[test]
fn runs_say_what_is_doubtful() {
    let directory = Directory::new("doubt");
    let mesh = directory.file("block.msh", &block([20.0; 3], [2; 3]));
    let output = directory.path("run");
    // So short a run that nothing touches: it begins four steps before.
    let said = succeed(&[&mesh, "--steps", "2", "--output", &output]);
    assert!(said.contains("nothing has touched in 2 steps"), "{said}");
    // A soft block that lands on an edge and tips over by linear strains.
    let words = [
        &mesh,
        "--material",
        "E=2e5,nu=0.3,rho=1000",
        "--turn",
        "0,30,0",
        "--speed",
        "2",
        "--height",
        "0.001",
        "--steps",
        "300",
        "--output",
        &output,
    ];
    let said = succeed(&words);
    assert!(said.contains("take --model neo-hookean"), "{said}");
}

#[test]
fn parts_meet_each_other_and_balls() {
    let directory = Directory::new("others");
    let (jack, cup, bracket) = (shipped("jack.msh"), shipped("cup.msh"), shipped("bracket.msh"));
    let scenes: [&[&str]; 3] = [
        &[&jack, "--onto", "ball", "--material", "rubber", "--model", "neo-hookean", "--steps", "60", "--step", "2e-5"],
        &[&bracket, "--onto", &cup, "--friction", "0.3", "--turn", "0,90,0", "--steps", "60"],
        &[&jack, "--scheme", "cd-lagrange", "--model", "neo-hookean", "--material", "abs", "--steps", "400"],
    ];
    for (index, scene) in scenes.iter().enumerate() {
        let name = format!("run{index}");
        let output = directory.path(&name);
        succeed(&[scene, &["--frames", "1", "--output", &output][..]].concat());
        let rows = directory.history(&name);
        assert!(rows.iter().any(|row| row[4] > 0.0), "{scene:?}: nothing has touched");
        let total = |row: &[f64]| row[5] + row[6] + row[7];
        let kinetic = rows[0][5];
        assert!(rows.iter().all(|row| total(row) < total(&rows[0]) + 0.01 * kinetic), "{scene:?} gains energy");
        assert!(total(&rows[rows.len() - 1]) > total(&rows[0]) - 0.3 * kinetic, "{scene:?} loses energy");
        // Upward on the part.
        assert!(rows.iter().map(|row| row[3]).sum::<f64>() > 0.0);
    }
}
