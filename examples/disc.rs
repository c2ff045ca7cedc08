//! An elastic disc is thrown obliquely at a floor, with friction: quads, contact forces, energies, files for ParaView.
//!
//! Copy it as the start of a program of your own; it needs this crate alone. `cargo run --release --example disc`, in a
//! checkout, runs some seconds and writes output/disc/disc_*.vtu. In ParaView open the series and apply Warp By Vector.

use contact_dynamics::{Works, prelude::*};
use std::path::Path;

const RADIUS: f64 = 0.1; // m; the disc is 1 m thick
const YOUNG: f64 = 1e8; // Pa
const POISSON: f64 = 0.3; // plane strain
const DENSITY: f64 = 1000.0; // kg/m³
const VELOCITY: [f64; 2] = [2.0, -1.0]; // m/s
const FRICTION: f64 = 0.3;
const HEIGHT: f64 = 1e-3; // m, above the floor at the start
const GRAVITY: f64 = 9.81; // m/s²
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// A square of n × n quads, drawn out to a disc: points, quads, and the points of the rim.
fn mesh(n: usize) -> (Vec<[f64; 2]>, Vec<[usize; 4]>, Vec<usize>) {
    let place = |k: usize| [k % (n + 1), k / (n + 1)];
    let point = |k: usize| {
        let [x, y] = place(k).map(|i| 2.0 * i as f64 / n as f64 - 1.0);
        [RADIUS * x * (1.0 - 0.5 * y * y).sqrt(), HEIGHT + RADIUS + RADIUS * y * (1.0 - 0.5 * x * x).sqrt()]
    };
    let all = || 0..(n + 1) * (n + 1);
    let quad = |k: usize| [k, k + 1, k + n + 2, k + n + 1];
    let quads = all().filter(|&k| place(k).iter().all(|&i| i < n)).map(quad).collect();
    let rim = all().filter(|&k| place(k).iter().any(|&i| i == 0 || i == n)).collect();
    (all().map(point).collect(), quads, rim)
}

/// Stiffness and lumped mass of a bilinear quad. Dof 2 a + i of the element is the displacement of corner a along i.
fn element(points: [[f64; 2]; 4]) -> ([[f64; 8]; 8], [f64; 4]) {
    let shear = 0.5 * YOUNG / (1.0 + POISSON);
    let lame = 2.0 * shear * POISSON / (1.0 - 2.0 * POISSON);
    let (mut stiffness, mut mass) = ([[0.0; 8]; 8], [0.0; 4]);
    for gauss in CORNERS {
        let [x, y] = gauss.map(|s| s / f64::sqrt(3.0));
        let shapes = CORNERS.map(|[a, b]| 0.25 * (1.0 + a * x) * (1.0 + b * y));
        let slopes = CORNERS.map(|[a, b]| [0.25 * a * (1.0 + b * y), 0.25 * b * (1.0 + a * x)]);
        let jacobian = |i: usize, j: usize| -> f64 { slopes.iter().zip(points).map(|(s, p)| s[i] * p[j]).sum() };
        let [[j00, j01], [j10, j11]] = [[jacobian(0, 0), jacobian(0, 1)], [jacobian(1, 0), jacobian(1, 1)]];
        let det = j00 * j11 - j01 * j10;
        let g = slopes.map(|[a, b]| [(j11 * a - j01 * b) / det, (j00 * b - j10 * a) / det]);
        for a in 0..4 {
            mass[a] += DENSITY * det * shapes[a];
            for (b, i, j) in (0..16).map(|k| (k / 4, k / 2 % 2, k % 2)) {
                let both = if i == j { g[a][0] * g[b][0] + g[a][1] * g[b][1] } else { 0.0 };
                let entry = lame * g[a][i] * g[b][j] + shear * (g[a][j] * g[b][i] + both);
                stiffness[2 * a + i][2 * b + j] += det * entry;
            }
        }
    }
    (stiffness, mass)
}

/// The state as a file for ParaView: points at rest, with displacement, velocity and contact force.
fn vtu(points: &[[f64; 2]], quads: &[[usize; 4]], run: &Simulation<'_, f64>) -> String {
    let mut forces = vec![0.0; 2 * points.len()];
    for (dof, force) in run.contact_forces().flat_map(|contact| contact.forces().collect::<Vec<_>>()) {
        forces[dof] += force;
    }
    let in_space = |x: &[f64]| x.chunks(2).map(|x| format!("{:e} {:e} 0", x[0], x[1])).collect::<Vec<_>>().join("\n");
    let numbers = |of: &dyn Fn(usize) -> String| (0..quads.len()).map(|k| of(k) + " ").collect::<String>();
    let array = |name: &str, kind: &str, count: usize, text: String| {
        format!("<DataArray Name='{name}' type='{kind}' NumberOfComponents='{count}'>\n{text}</DataArray>\n")
    };
    let places = array("points", "Float64", 3, in_space(points.as_flattened()));
    let lists = [
        ("connectivity", numbers(&|k| quads[k].map(|point| point.to_string()).join(" "))),
        ("offsets", numbers(&|k| (4 * k + 4).to_string())),
        ("types", numbers(&|_| "9".into())),
    ];
    let cells = lists.map(|(name, numbers)| array(name, "Int32", 1, numbers)).concat();
    let state = run.state();
    let fields = [("displacement", state.displacement()), ("velocity", state.velocity()), ("contact force", &forces)];
    let data = fields.map(|(name, x)| array(name, "Float64", 3, in_space(x))).concat();
    format!(
        "<VTKFile type='UnstructuredGrid' version='0.1'><UnstructuredGrid>\n\
         <Piece NumberOfPoints='{}' NumberOfCells='{}'><Points>{places}</Points><Cells>{cells}</Cells>\
         <PointData>{data}</PointData></Piece></UnstructuredGrid></VTKFile>",
        points.len(),
        quads.len()
    )
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let n = if std::env::args().any(|word| word == "--quick") { 12 } else { 40 };
    let folder = std::env::args().skip_while(|word| word != "--output").nth(1).unwrap_or("output/disc".into());
    std::fs::create_dir_all(&folder)?;

    // M and K.
    let (points, quads, rim) = mesh(n);
    let (mut entries, mut mass) = (Vec::new(), vec![0.0; 2 * points.len()]);
    for corners in &quads {
        let (stiffness, masses) = element(corners.map(|point| points[point]));
        for (row, values) in stiffness.iter().enumerate() {
            let dof = |k: usize| 2 * corners[k / 2] + k % 2;
            entries.extend(values.iter().enumerate().map(|(k, &value)| Triplet::new(dof(row), dof(k), value)));
            mass[dof(row)] += masses[row / 2];
        }
    }
    let stiffness = SparseColMat::try_new_from_triplets(mass.len(), mass.len(), &entries)?;
    let weight: Vec<f64> = mass.iter().zip([0.0, -GRAVITY].iter().cycle()).map(|(m, g)| m * g).collect();
    let whole: f64 = mass.iter().sum::<f64>() / 2.0;
    let load = move |_, force: &mut [f64]| force.copy_from_slice(&weight);
    let disc = LinearSystem::lumped(mass, stiffness)?.rayleigh(0.0, 1e-6)?.load(load); // C = 1e-6 s K
    // Every point of the rim may meet the floor.
    let dofs: Vec<_> = (0..points.len()).map(|point| [2 * point, 2 * point + 1]).collect();
    let floor = NodesOnObstacle::new(Plane::new([0.0, 0.0], [0.0, 1.0])?, &points, &dofs, &rim)?.friction(FRICTION);
    // Half the time in which a wave crosses an element.
    let wave = f64::sqrt(YOUNG * (1.0 - POISSON) / (1.0 + POISSON) / (1.0 - 2.0 * POISSON) / DENSITY);
    let h = 0.5 * 2.0 * RADIUS / n as f64 / wave;
    let run = Simulation::builder(disc, GeneralizedAlpha::default(), h).constraint(floor).energy_balance();
    let mut run = run.velocity(VELOCITY.repeat(points.len())).build()?;

    let start = run.energy().total();
    let (mut impulse, mut largest, mut files) = ([0.0; 2], 0.0_f64, 0);
    println!("  t [ms]  force [N]  closed  energy/start");
    while run.time() < 5e-3 {
        run.step()?;
        for (dof, on_dof) in run.impulses_on_dofs().iter().enumerate() {
            impulse[dof % 2] += on_dof;
        }
        let contacts = run.state().contacts();
        let force: f64 = contacts.forces().iter().sum();
        largest = largest.max(force);
        if run.time() >= 1e-4 * f64::from(files) {
            let closed = contacts.closed().iter().filter(|&&closed| closed).count();
            std::fs::write(Path::new(&folder).join(format!("disc_{files:03}.vtu")), vtu(&points, &quads, &run))?;
            println!("{:8.3} {force:10.1} {closed:7} {:13.5}", 1e3 * run.time(), run.energy().total() / start);
            files += 1;
        }
    }
    println!("largest force {largest:.1} N; {files} files in {folder}/");
    let [along, up] = impulse.map(|given| given / (whole * VELOCITY[1].abs()));
    println!("momentum that the floor gave, over m v: {up:.3} up, {along:.3} along");
    assert!((along.abs() / up / FRICTION - 1.0).abs() < 1e-6, "it slides all the time");
    // Where the energy went: docs/energies.md.
    let energy = run.energy();
    println!("energy over that at the start: {:.4} left", energy.total() / start);
    let works = energy.works.ok_or("no energy balance")?;
    let names = ["weight", "damping", "friction", "impacts", "corrections", "scheme"];
    let Works { load, damping, friction, impacts, corrections, remainder, .. } = works;
    for (name, work) in names.iter().zip([load, damping, friction, impacts, corrections, remainder]) {
        println!("  {name:<11} {:+.5}", work / start);
    }
    Ok(())
}
