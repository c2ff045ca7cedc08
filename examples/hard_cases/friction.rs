//! Friction of elastic bodies against closed forms: F1 (slabs thrown obliquely), F2 (a bar on a rough bed), F6 (partial
//! slip), F10 (bodies that turn together).

use crate::Extent;
use crate::table::Bound::AtMost;
use crate::table::{Outcome, Row, each, rows};
use crate::tried::corrected;
use contact_dynamics::contact::{ContactConstraint, Contacts, NodeToFacet};
use contact_dynamics::{Error, Preset, Result};
use contact_dynamics_scenes::bed::Bed;
use contact_dynamics_scenes::combinations::{Combination, plain};
use contact_dynamics_scenes::mindlin::Press;
use contact_dynamics_scenes::slabs::{Impact, Slab};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::two_slabs::TwoSlabs;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    let mut all = slabs(extent);
    all.extend(two_slabs(extent));
    all.extend(bed(extent));
    all.extend(partial_slip(extent));
    all.extend(turning());
    all
}

/// Speeds along the wall at which a slab sticks and slides.
const ALONG: [f64; 2] = [0.02, 0.05];

fn slabs(extent: &Extent) -> Vec<Row> {
    let meshes: &[(usize, f64)] =
        if extent.quick { &[(20, 1e-3)] } else { &[(20, 1e-3), (20, 2e-4), (50, 1e-3), (50, 2e-4), (100, 1e-3)] };
    let phases = extent.phases.len();
    // Errors are those of the front, some elements wide: they are given over the share of an element.
    let of = |n: usize, h: f64, slab: &Slab, found: Impact| {
        let share = (1.0 / n as f64).max(h * slab.speeds[0] / slab.length);
        let [_, friction] = slab.forces();
        let expected = slab.velocity[1] - friction * slab.contact_time() / (slab.density * slab.length);
        let speed = (found.velocity[1] - expected).abs() / slab.velocity[1];
        [found.error[0] / share, found.error[1] / share, found.largest, speed / share]
    };
    let run = |row: &Combination| {
        let mut all = Vec::new();
        for &(n, h) in meshes {
            for along in ALONG {
                let slab = Slab::thrown(n, along);
                let run = |gap| slab.lumped(row.integrator()?, row.correctors(0.0)?, h, gap);
                match Impact::mean(&slab, h, phases, run) {
                    // (The finest mesh, of Courant number 1, is beyond the limit of some explicit schemes.)
                    Err(Error::BeyondStability { .. }) => {}
                    found => all.push(of(n, h, &slab, found?)),
                }
            }
        }
        Ok(all)
    };
    let mut outcomes = each(&corrected(), run);
    for (name, preset) in [
        ("preset smooth", Preset::smooth()),
        ("preset conservative", Preset::conservative()),
        ("preset explicit", Preset::explicit()),
    ] {
        let figures = || {
            let mut all = Vec::new();
            // Their Courant number is at most 1.
            for &(n, h) in meshes.iter().filter(|(n, h)| h * 100.0 * *n as f64 / 10.0 < 0.95) {
                for along in ALONG {
                    let slab = Slab::thrown(n, along);
                    let found = Impact::mean(&slab, h, phases, |gap| slab.preset(preset, h, gap))?;
                    all.push(of(n, h, &slab, found));
                }
            }
            Ok(all)
        };
        let figures: Result<_> = figures();
        outcomes.push(Outcome { name: name.into(), figures: figures.map_err(|error| error.to_string()) });
    }
    let asked = [
        ("slab thrown obliquely, sticks and slides: mean error of the pressure, over h_e/L or Δt c/L", AtMost(1.0)),
        ("mean error of the friction, over that", AtMost(1.1)),
        ("largest friction over its exact value", AtMost(1.2)),
        ("velocity along the wall afterwards, error over that", AtMost(1.0)),
    ];
    rows("F1", asked, &outcomes)
}

fn two_slabs(extent: &Extent) -> Vec<Row> {
    let (n, phases) = if extent.quick { (20, 2) } else { (50, extent.phases.len()) };
    let pair = TwoSlabs::new(n);
    let h = 1e-3;
    let run = |row: &Combination| {
        let run = |gap| pair.run(row.integrator()?, row.correctors(0.0)?, h, gap);
        let [pressure, friction, largest] = pair.measured(phases, h, run)?;
        Ok(vec![[pressure, friction, largest]])
    };
    let asked = [
        ("two slabs, stick and slip in turn: mean error of the pressure", AtMost(0.042)),
        ("mean error of the friction", AtMost(0.07)),
        ("largest friction over that at the impact", AtMost(1.15)),
    ];
    rows("F1", asked, &each(&corrected(), run))
}

fn bed(extent: &Extent) -> Vec<Row> {
    let n = if extent.quick { 60 } else { 240 };
    let run = |courant: f64| {
        move |row: &Combination| {
            let bed = Bed::new(n);
            let mut run = bed.run(row.integrator()?, row.correctors(0.0)?, courant)?;
            let [way, variation] = bed.measure(&mut run)?;
            Ok(vec![[(way - 1.0).abs(), variation]])
        }
    };
    let exact = [
        ("bar pushed on a rough bed, Courant number 1: error of the way", AtMost(1e-3)),
        ("variation of friction after the stop, over the push", AtMost(1e-6)),
    ];
    let cd_lagrange = plain(|| Ok(Box::new(contact_dynamics::CdLagrange)));
    let mut all = rows("F2", exact, &each(&[cd_lagrange], run(1.0)));
    let (way, variation) = if extent.quick { (0.05, 15.0) } else { (0.022, 20.0) };
    let asked = [
        ("Courant number ½, 240 elements (quick: 60): error of the way", AtMost(way)),
        ("variation of friction after the stop, over the push", AtMost(variation)),
    ];
    all.extend(rows("F2", asked, &each(&corrected(), run(0.5))));
    all
}

/// Cattaneo and Mindlin: statics, by one scheme.
fn partial_slip(extent: &Extent) -> Vec<Row> {
    let (across, steps) = if extent.quick { (4, 5) } else { (8, 5) };
    let press = Press::new(across, 0.3);
    let figures = press.moved(steps).map(|loads| {
        let of = |(step, load): (u32, contact_dynamics_scenes::mindlin::Loaded)| {
            let way = f64::from(step) / f64::from(steps);
            let force = load.tangential / (press.friction * load.normal);
            let stick = load.stick / load.radius - (1.0 - force).cbrt();
            [(force / (1.0 - (1.0 - way).powf(1.5)) - 1.0).abs(), stick.abs()]
        };
        (1..).zip(loads).take(steps as usize - 1).map(of).collect::<Vec<_>>()
    });
    let outcome =
        Outcome { name: "Chung–Hulbert(0), statics".into(), figures: figures.map_err(|error| error.to_string()) };
    let asked = [
        ("ball pressed and moved sideways (Cattaneo, Mindlin): error of the force by the way", AtMost(0.02)),
        ("error of the stick radius over the contact radius (a ring of nodes)", AtMost(0.5 / across as f64)),
    ];
    rows("F6", asked, &[outcome])
}

/// Two bodies that turn together do not slip on each other: the tangential rows on the velocity of a rotation.
fn turning() -> Vec<Row> {
    let material = Material { young: 1e6, poisson: 0.3, density: 1.0 };
    let figures = || -> Result<Vec<[f64; 1]>> {
        let solid = Solid::block([1.0; 3], [2, 2, 1], material)
            .with(Solid::block([0.6, 0.6, 1.0], [1, 1, 1], material).moved([0.13, 0.21, 1.0]));
        let axis = [0.3, -0.5, 0.8];
        let mut all = Vec::new();
        for angle in [0.0, 0.7, 2.0, 3.1] {
            let turned = solid.clone().rotated(axis, angle);
            let quads = |inside: &dyn Fn(usize, f64) -> bool| -> Vec<[usize; 4]> {
                let sides = solid.boundary().into_iter();
                let sides = sides.filter(|side| side.iter().all(|&n| inside(n, solid.nodes[n][2])));
                sides.map(|side| [side[0], side[1], side[2], side[3]]).collect()
            };
            let (below, above) = (quads(&|n, z| n < 18 && z > 0.999), quads(&|n, z| n >= 18 && z < 1.001));
            let mut contact = NodeToFacet::new(&solid.nodes, &solid.node_dofs(), above, below)?.friction(0.3);
            let (mut u, mut v) = (vec![0.0; solid.dofs()], vec![0.0; solid.dofs()]);
            for (node, (x, start)) in turned.nodes.iter().zip(&solid.nodes).enumerate() {
                let w =
                    [axis[1] * x[2] - axis[2] * x[1], axis[2] * x[0] - axis[0] * x[2], axis[0] * x[1] - axis[1] * x[0]];
                for k in 0..3 {
                    (u[3 * node + k], v[3 * node + k]) = (x[k] - start[k], w[k]);
                }
            }
            let dofs = contact.dofs().to_vec();
            let [u, v] = [u, v].map(|x| dofs.iter().map(|&dof| x[dof]).collect::<Vec<_>>());
            contact.search(0.0, &u, &v, 0.0)?;
            let contacts = Contacts::of(&contact);
            let slip = |tangent: &[(usize, f64)]| tangent.iter().map(|&(place, weight)| weight * v[place]).sum::<f64>();
            let slips = (0..contacts.len())
                .flat_map(|row| contacts.tangents(row).iter().map(|tangent| slip(tangent).abs()).collect::<Vec<_>>());
            all.push([slips.fold(f64::NAN, f64::max)]);
        }
        Ok(all)
    };
    let outcome = Outcome { name: "node to facet".into(), figures: figures().map_err(|error| error.to_string()) };
    let asked = [("two bodies that turn together: slip over the speed of their rims", AtMost(1e-12))];
    rows("F10", asked, &[outcome])
}
