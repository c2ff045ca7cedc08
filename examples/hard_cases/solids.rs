//! H20: a soft disc that falls on a floor.

use crate::Extent;
use crate::table::Bound::AtMost;
use crate::table::{Row, each, rows};
use crate::tried::{corrected, massless, presets};
use contact_dynamics_scenes::combinations::Combination;
use contact_dynamics_scenes::disc::SoftDisc;
use contact_dynamics_scenes::masses::Takers;
use example_support::collisions::disc;

pub(crate) fn cases(extent: &Extent) -> Vec<Row> {
    let (cells, until) = if extent.quick { (8, 20.0) } else { (24, 40.0) };
    let body = SoftDisc::new(cells);
    let run = |row: &Combination| {
        let found = disc(row, &body, until)?;
        let of = |name: &str| found.iter().find(|of| of.name == name).map_or(f64::NAN, |of| of.worst);
        Ok(vec![[of("energy_rise"), of("pressure_ratio"), of("penetration")]])
    };
    let asked = [
        ("soft disc: highest energy − that of the start, over that of the fall", AtMost(1e-3)),
        ("largest over median pressure when the force is largest", AtMost(1.3)),
        ("penetration over the way of a step", AtMost(1e-9)),
    ];
    let claims = [corrected(), presets(), massless(Takers::Tapered)].concat();
    rows("H20", asked, &each(&claims, run))
}
