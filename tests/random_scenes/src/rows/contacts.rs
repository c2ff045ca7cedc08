//! Contacts of random scenes: obstacles, pairs, levers, rows that follow from others, rows that hold both ways.

use super::bodies::Bodies;
use super::recipe::{Row, Terms};
use crate::surfaces::{decades, pick};
use contact_dynamics::ContactLaw;
use contact_dynamics_scenes::random::Congruential;
use contact_dynamics_scenes::schemes::Listed;

/// What contacts are like.
#[derive(Clone, Copy, Debug)]
pub(super) struct Setting {
    /// Ways of bodies in a step, and how far some rows swing.
    pub(super) way: f64,
    pub(super) h: f64,
    pub(super) moves: bool,
    pub(super) rubs: bool,
    pub(super) law: ContactLaw,
    pub(super) starts_closed: bool,
    /// Between bodies alone, so that nothing acts from outside.
    pub(super) free: bool,
}

impl Setting {
    fn row(&self, terms: Terms, tangents: Vec<Terms>, random: &mut Congruential) -> Row {
        let touches = self.starts_closed && pick(&[true, false], random);
        let [near, far] = [1.0, 12.0].map(|ways| random.within(0.0, ways));
        let gap = if touches { 0.0 } else { self.way * pick(&[near, far], random) };
        let mut row = Row { terms, gap, amplitude: 0.0, frequency: 0.0, law: ContactLaw::Rigid, friction: None };
        if self.moves && pick(&[true, false], random) {
            row.frequency = random.within(0.01, 0.3) / self.h;
            row.amplitude = self.way * random.within(0.0, 3.0);
        }
        if pick(&[true, true, false], random) {
            row.law = self.law;
        }
        let takes = matches!(row.law, ContactLaw::Rigid | ContactLaw::Penalty { .. } | ContactLaw::PowerLaw { .. });
        if self.rubs && takes && !tangents.is_empty() {
            let coefficient = pick(&[0.0, 0.1, 0.3, 0.8, 2.0, 1e6], random);
            row.friction = Some((coefficient, tangents));
        }
        row
    }

    /// Rows of a scene of these bodies.
    pub(super) fn rows(&self, bodies: &Bodies, random: &mut Congruential) -> Vec<Row> {
        let nodes: Vec<usize> = bodies.outside.iter().step_by(bodies.axes).map(|dof| dof / bodies.axes).collect();
        let count = pick(&[1, 2, 3, 5, 8], random);
        let mut rows: Vec<Row> = Vec::new();
        for _ in 0..count {
            let one = pick(&nodes, random);
            let other = pick(&nodes, random);
            let kind = pick(&[0, 0, 1, 1, 2, 3, 3], random);
            let row = match kind {
                // A row that follows from others, or is there twice.
                3 if !rows.is_empty() => {
                    let summed = pick(&[true, false], random);
                    let first = pick(&(0..rows.len()).collect::<Vec<_>>(), random);
                    let second = pick(&(0..rows.len()).collect::<Vec<_>>(), random);
                    let with = if summed { random.within(0.2, 3.0) } else { 0.0 };
                    sum(&rows[first], &rows[second], [random.within(0.2, 3.0), with])
                }
                2 if !self.free => {
                    let terms = (0..bodies.axes).flat_map(|axis| {
                        [(bodies.axes * one + axis, random.signed()), (bodies.axes * other + axis, random.signed())]
                    });
                    let terms = merged(terms.collect());
                    self.row(terms, Vec::new(), random)
                }
                1 if one != other => self.between(bodies.axes, Some([one, other]), one, random),
                _ if self.free && one == other => continue,
                _ if self.free => self.between(bodies.axes, Some([one, other]), one, random),
                _ => self.between(bodies.axes, None, one, random),
            };
            rows.push(row);
        }
        rows
    }

    /// From one node to another one, or to an obstacle, by a normal by chance.
    fn between(&self, axes: usize, pair: Option<[usize; 2]>, node: usize, random: &mut Congruential) -> Row {
        let frame = frame(axes, random);
        let direction = |along: &[f64]| -> Terms {
            let of = |node: usize, sign: f64| along.iter().enumerate().map(move |(a, x)| (axes * node + a, sign * x));
            match pair {
                Some([one, other]) => of(one, 1.0).chain(of(other, -1.0)).filter(|term| term.1 != 0.0).collect(),
                None => of(node, 1.0).filter(|term| term.1 != 0.0).collect(),
            }
        };
        let tangents = frame[1..].iter().map(|tangent| direction(tangent)).collect();
        self.row(direction(&frame[0]), tangents, random)
    }

    /// A wall that pushes the first mass, levers from each mass to the next, a stop behind the last one, and sums of
    /// these rows: what follows from others, and contradicts them once the wall has gone too far.
    pub(super) fn levers(&self, masses: usize, random: &mut Congruential) -> Vec<Row> {
        let mut rows = vec![self.row(vec![(0, 1.0)], Vec::new(), random)];
        rows[0].amplitude = -self.way * random.within(0.0, 10.0);
        rows[0].frequency = random.within(0.01, 0.1) / self.h;
        for i in 1..masses {
            let lever = random.within(0.3, 1.5);
            rows.push(self.row(vec![(i, 1.0), (i - 1, -lever)], Vec::new(), random));
        }
        rows.push(self.row(vec![(masses - 1, -1.0)], Vec::new(), random));
        for _ in 0..pick(&[0, 1, 3], random) {
            let [one, other] = [0, 0].map(|_: usize| (random.unit() * rows.len() as f64) as usize);
            let by = [random.within(0.2, 3.0), random.within(0.2, 3.0)];
            rows.push(sum(&rows[one], &rows[other], by));
        }
        rows
    }

    /// Each box on the one below, the lowest on the floor; walls beside some of them.
    pub(super) fn stacked(&self, boxes: usize, random: &mut Congruential) -> Vec<Row> {
        let mut rows = Vec::new();
        for upper in 0..boxes {
            let pair = |axis: usize| -> Terms {
                let below = upper.checked_sub(1).map(|lower| (2 * lower + axis, -1.0));
                std::iter::once((2 * upper + axis, 1.0)).chain(below).collect()
            };
            rows.push(self.row(pair(1), vec![pair(0)], random));
            if pick(&[true, false, false], random) {
                let side = pick(&[1.0, -1.0], random);
                rows.push(self.row(vec![(2 * upper, side)], vec![vec![(2 * upper + 1, 1.0)]], random));
            }
        }
        rows
    }

    /// Every node of the lower side above a floor; the last axis is up.
    pub(super) fn floor(&self, bodies: &Bodies, random: &mut Congruential) -> Vec<Row> {
        let axes = bodies.axes;
        let nodes = bodies.outside.iter().step_by(axes).map(|dof| dof / axes);
        let gap = self.way * random.within(0.0, 12.0);
        let tilt = pick(&[0.0, 0.0, 1.0], random);
        nodes
            .map(|node| {
                let up = vec![(axes * node + axes - 1, 1.0)];
                let along = (0..axes - 1).map(|axis| vec![(axes * node + axis, 1.0)]).collect();
                let row = self.row(up, along, random);
                Row { gap: gap + tilt * row.gap, ..row }
            })
            .collect()
    }
}

/// Orthonormal vectors by chance, or those of the axes.
fn frame(axes: usize, random: &mut Congruential) -> Vec<Vec<f64>> {
    let slanted = pick(&[true, false], random);
    let mut frame: Vec<Vec<f64>> = Vec::new();
    let first = pick(&[0, 1, 2], random) % axes;
    let sign = pick(&[1.0, -1.0], random);
    for k in 0..axes {
        let mut x: Vec<f64> = (0..axes)
            .map(|axis| if slanted { random.signed() } else { sign * f64::from(u8::from((first + k) % axes == axis)) })
            .collect();
        for other in &frame {
            let along: f64 = x.iter().zip(other).map(|(x, y)| x * y).sum();
            x.iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
        }
        let size = x.iter().map(|x| x * x).sum::<f64>().sqrt();
        frame.push(x.iter().map(|x| x / size).collect());
    }
    frame
}

/// Each dof once.
fn merged(terms: Terms) -> Terms {
    let mut all: Terms = Vec::new();
    for (dof, weight) in terms {
        match all.iter_mut().find(|term| term.0 == dof) {
            Some(term) => term.1 += weight,
            None => all.push((dof, weight)),
        }
    }
    all
}

/// A row that holds where both do, as both move.
fn sum(one: &Row, other: &Row, [by, with]: [f64; 2]) -> Row {
    let scaled = |row: &Row, by: f64| row.terms.iter().map(|&(dof, x)| (dof, by * x)).collect::<Terms>();
    // (Rows that swing at two frequencies are not summed.)
    let with = if other.amplitude == 0.0 && other.law == one.law { with } else { 0.0 };
    let other_terms = if with > 0.0 { scaled(other, with) } else { Terms::new() };
    let terms = merged([scaled(one, by), other_terms].concat());
    let terms: Terms = terms.into_iter().filter(|term| term.1.abs() > 1e-9).collect();
    if terms.is_empty() {
        return Row { friction: None, ..one.clone() };
    }
    let gap = by * one.gap + with * other.gap;
    Row { terms, gap, amplitude: by * one.amplitude, friction: None, ..one.clone() }
}

/// A law by chance, with stiffnesses in units of `k` and masses in those of k h².
pub(super) fn law(k: f64, h: f64, scheme: &Listed, random: &mut Congruential) -> ContactLaw {
    let on_velocities = !scheme.takes_corrections();
    let stiffness = k * decades(-2.0, 2.0, random);
    match pick(&[0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8], random) {
        0 => ContactLaw::Rigid,
        1 => ContactLaw::Equality,
        2 if on_velocities => ContactLaw::Restitution { coefficient: random.unit() },
        2 => ContactLaw::RateCondition,
        3 => ContactLaw::PersistencySwitch,
        4 => ContactLaw::Penalty { stiffness },
        5 => ContactLaw::PowerLaw { stiffness, exponent: pick(&[1.5, 2.0, 1.1], random) },
        6 => ContactLaw::Bipenalty { stiffness, mass: stiffness * h * h * random.within(0.1, 0.5) },
        7 => ContactLaw::StabilizedBipenalty { stiffness },
        _ => ContactLaw::AugmentedLagrangian { stiffness, augmentations: pick(&[0, 1, 3], random) },
    }
}
