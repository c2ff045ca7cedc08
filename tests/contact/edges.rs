//! Edges on edges: gaps and rows against closed forms, momentum, impacts, edges that slide, what is refused.

use contact_dynamics::contact::{
    ContactConstraint, ContactLaw, Contacts, EdgeToEdge, GapRates, Stride, SurfaceSettings,
};
use contact_dynamics::{Composite, Error, Newmark, PersistencyCorrection, Real, Simulation, TimeIntegrator, verify};
use contact_dynamics_scenes::OnSystem;
use contact_dynamics_scenes::falls::{Fall, Keeps, Landing};
use contact_dynamics_scenes::random::{Congruential, xorshift};
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::stacks::Stack;
use contact_dynamics_scenes::vectors::{along as sum, cross, dot};

type Vector = [f64; 3];

/// Name, gap, normal, and (dof, weight) pairs of a row.
type Found = ((usize, usize), f64, Vector, Vec<(usize, f64)>);

/// A rotation by two angles.
fn turned([a, b]: [f64; 2], [x, y, z]: Vector) -> Vector {
    let (x, y) = (a.cos() * x - a.sin() * y, a.sin() * x + a.cos() * y);
    [x, b.cos() * y - b.sin() * z, b.sin() * y + b.cos() * z]
}

/// The facets of a tetrahedron, seen from outside.
fn tetrahedron(first: usize, x: &[Vector]) -> [[usize; 3]; 4] {
    let [a, b, c, d] = [0, 1, 2, 3].map(|k| x[first + k]);
    let volume = dot(sum(b, -1.0, a), cross(sum(c, -1.0, a), sum(d, -1.0, a)));
    let facets = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
    facets.map(|[i, j, k]| if volume > 0.0 { [i, j, k] } else { [i, k, j] }.map(|node| first + node))
}

/// Two tetrahedra, ridge across ridge: the first one, of the nodes 0 to 3, stands on its ridge 0–1 above the ridge 4–5
/// of the other one.
#[derive(Clone)]
struct Pair {
    nodes: Vec<Vector>,
}

impl Pair {
    /// Ridges of length 2 that cross at an angle, at these shares of them, so far apart.
    fn new(angle: f64, [s, t]: [f64; 2], gap: f64) -> Self {
        let (along, other) = ([angle.cos(), angle.sin(), 0.0], [1.0, 0.0, 0.0]);
        let point = |along: Vector, share: f64, height: f64| sum([0.0, 0.0, height], 2.0 * share, along);
        let base = |along: Vector, middle: f64, height: f64, side: f64| {
            sum(sum([0.0, 0.0, height], middle, along), side, cross([0.0, 0.0, 1.0], along))
        };
        let nodes = vec![
            point(along, -s, gap),
            point(along, 1.0 - s, gap),
            base(along, 1.0 - 2.0 * s, gap + 1.0, -0.8),
            base(along, 1.0 - 2.0 * s, gap + 1.0, 0.8),
            point(other, -t, 0.0),
            point(other, 1.0 - t, 0.0),
            base(other, 1.0 - 2.0 * t, -1.0, -0.8),
            base(other, 1.0 - 2.0 * t, -1.0, 0.8),
        ];
        Self { nodes }
    }

    fn mapped(mut self, map: impl Fn(Vector) -> Vector) -> Self {
        self.nodes.iter_mut().for_each(|x| *x = map(*x));
        self
    }

    fn dofs() -> Vec<[usize; 3]> {
        (0..8).map(|node| [3 * node, 3 * node + 1, 3 * node + 2]).collect()
    }

    fn contact<T: Real>(&self) -> EdgeToEdge<T> {
        let nodes: Vec<[T; 3]> = self.nodes.iter().map(|x| x.map(T::of)).collect();
        let [one, other] = [tetrahedron(0, &self.nodes), tetrahedron(4, &self.nodes)];
        EdgeToEdge::new(&nodes, &Self::dofs(), one, other).unwrap()
    }

    /// Name, gap, normal and row of the pair of ridges, the row by (dof, weight).
    fn rows(contact: &mut EdgeToEdge<f64>) -> Vec<Found> {
        contact.search_on(0.0, &[0.0; 24], &[0.0; 24], 0.0).unwrap();
        let dofs = contact.dofs().to_vec();
        let found = Contacts::of(&*contact);
        let mut gaps = vec![0.0; found.len()];
        contact.gap(0.0, &[0.0; 24], &mut gaps);
        let row = |k: usize| {
            // (What a row acts on is known beforehand.)
            assert!(found.row(k).all(|(place, _)| !contact.only_reads(place)));
            let mut row: Vec<_> = found.row(k).map(|(place, weight)| (dofs[place], weight)).collect();
            row.sort_unstable_by_key(|&(dof, _)| dof);
            row
        };
        let is_ridges = |k: &usize| {
            let ends = contact.edges();
            let (one, other) = found.name(*k);
            let mut ridges = [ends[0][one], ends[1][other]];
            ridges.sort_unstable();
            ridges == [[0, 1], [4, 5]]
        };
        let rows = (0..found.len()).filter(is_ridges);
        rows.map(|k| (found.name(k), gaps[k], found.normal(k).unwrap(), row(k))).collect()
    }
}

/// The row of the ridges.
fn ridges(contact: &EdgeToEdge<f64>) -> Option<usize> {
    let (found, ends) = (Contacts::of(contact), contact.edges());
    (0..found.len()).find(|&row| {
        let (one, other) = found.name(row);
        [ends[0][one], ends[1][other]] == [[0, 1], [4, 5]]
    })
}

/// The same after a search, with its gap.
fn ridges_at(contact: &mut EdgeToEdge<f64>, u: &[f64], v: &[f64]) -> (usize, f64) {
    contact.search_on(0.0, u, v, 0.0).unwrap();
    let row = ridges(contact).unwrap();
    let mut gaps = vec![0.0; contact.candidates()];
    contact.gap(0.0, u, &mut gaps);
    (row, gaps[row])
}

/// Its entry for a dof of the system.
fn entry(contact: &EdgeToEdge<f64>, row: usize, dof: usize) -> f64 {
    let place = contact.dofs().iter().position(|&other| other == dof).unwrap();
    Contacts::of(contact).row(row).find(|entry| entry.0 == place).map_or(0.0, |entry| entry.1)
}

#[test]
fn gaps_and_rows_are_those_of_two_crossed_lines() {
    let mut random = Congruential(3);
    for case in 0..200 {
        let angle = random.within(0.06, 3.08);
        let shares = [random.within(0.02, 0.98), random.within(0.02, 0.98)];
        let gap = random.within(-0.0015, 0.3);
        let (turn, by) = ([random.signed(), random.signed()], [random.signed(), random.signed(), random.signed()]);
        let pair = Pair::new(angle, shares, gap).mapped(|x| sum(turned(turn, x), 1.0, by));
        let mut contact = pair.contact::<f64>();
        let ridge = contact.edges().map(|edges| edges.iter().position(|edge| *edge == [0, 1] || *edge == [4, 5]));
        let rows = Pair::rows(&mut contact);
        let name = (ridge[0].unwrap(), ridge[1].unwrap());
        let row = rows.iter().find(|row| row.0 == name);
        // A corner of a ridge may be nearer to a side of the other body than the ridges are: no normal there.
        let Some((_, found, normal, row)) = row else { panic!("{case}: {angle} {shares:?} {gap}: {rows:?}") };
        let up = turned(turn, [0.0, 0.0, 1.0]);
        assert!((found - gap).abs() < 1e-13 && dot(*normal, up) > 1.0 - 1e-13, "{case}: {found} {gap}");
        let [s, t] = shares;
        for (node, weight) in [(0, 1.0 - s), (1, s), (4, t - 1.0), (5, -t)] {
            for (axis, up) in up.into_iter().enumerate() {
                let entry = row.iter().find(|(dof, _)| *dof == 3 * node + axis).map_or(0.0, |entry| entry.1);
                assert!((entry - weight * up).abs() < 1e-12, "{case}");
            }
        }
    }
}

#[test]
fn what_has_no_common_normal_has_no_row() {
    // (Ridges that may come to meet within a step have a row that is open by more than the lines are.)
    let count = |pair: &Pair| Pair::rows(&mut pair.contact()).iter().filter(|row| row.1 < 0.1 + 1e-12).count();
    assert_eq!(count(&Pair::new(1.0, [0.5, 0.5], 0.1)), 1);
    // Beyond the ends of either.
    assert_eq!(count(&Pair::new(1.0, [1.05, 0.5], 0.1)), 0);
    assert_eq!(count(&Pair::new(1.0, [0.5, -0.05], 0.1)), 0);
    // Parallel within 2.9 degrees.
    assert_eq!(count(&Pair::new(0.049, [0.5, 0.5], 0.1)), 0);
    assert_eq!(count(&Pair::new(0.051, [0.5, 0.5], 0.1)), 1);
    // Beyond the reach, which is the mean size of the facets.
    assert_eq!(count(&Pair::new(1.0, [0.5, 0.5], 2.5)), 0);
    // Tilted so far that the ridge lies in the other body's facet.
    let tilted = |angle: f64| {
        let mut pair = Pair::new(1.57, [0.5, 0.5], 0.1);
        for x in &mut pair.nodes[..4] {
            let [along, height] = [x[1], x[2] - 0.1];
            (x[1], x[2]) =
                (angle.cos() * along - angle.sin() * height, 0.1 + angle.sin() * along + angle.cos() * height);
        }
        pair
    };
    // (The roof below falls by 51.3 degrees.)
    assert_eq!([0.85, 1.05].map(|angle| count(&tilted(angle))), [1, 0]);
}

#[test]
fn rows_and_rates_are_derivatives_of_gaps() {
    let mut random = Congruential(11);
    for _ in 0..20 {
        let shares = [random.within(0.2, 0.8), random.within(0.2, 0.8)];
        let pair = Pair::new(random.within(0.3, 2.8), shares, random.within(0.05, 0.2));
        let (u, v) = (random.vector(24, 0.05), random.vector(24, 1.0));
        let mut contact = pair.contact::<f64>().friction(0.3);
        let ridges = |contact: &mut EdgeToEdge<f64>, along: &[f64], by: f64| {
            let x: Vec<f64> = u.iter().zip(along).map(|(u, v)| u + by * v).collect();
            ridges_at(contact, &x, &v)
        };
        for dof in 0..24 {
            let mut along = vec![0.0; 24];
            along[dof] = 1.0;
            let [before, after] = [-1e-5, 1e-5].map(|by| ridges(&mut contact, &along, by).1);
            let (row, _) = ridges(&mut contact, &along, 0.0);
            assert!(((after - before) / 2e-5 - entry(&contact, row, dof)).abs() < 1e-8, "{dof}");
        }
        let step = 1e-4;
        let [before, now, after] = [-step, 0.0, step].map(|by| ridges(&mut contact, &v, by).1);
        let (row, _) = ridges(&mut contact, &v, 0.0);
        let mut rates = vec![GapRates::default(); contact.candidates()];
        contact.rates_on(0.0, &u, &v, &mut rates);
        let difference = (after - 2.0 * now + before) / (step * step);
        assert!((rates[row].acceleration - difference).abs() < 1e-4 * (1.0 + difference.abs()), "{difference}");
        let error = verify::gap_jacobian(&mut contact, 0.0, &u, &v, 1e-6).unwrap();
        assert!(error.jacobian < 1e-6 && error.tangents < 1e-12 && error.unreported == 0, "{error:?}");
    }
}

/// Beyond an end, of either edge, the gap opens, and rows are its derivatives.
#[test]
fn beyond_an_end_rows_are_derivatives_too() {
    for shares in [[-0.03, 0.5], [1.03, 0.4], [0.6, -0.03], [0.5, 1.03]] {
        let pair = Pair::new(1.1, shares, 0.1);
        let mut contact = pair.contact::<f64>();
        let at = |contact: &mut EdgeToEdge<f64>, dof: usize, by: f64| {
            let mut u = vec![0.0; 24];
            u[dof] = by;
            ridges_at(contact, &u, &[0.0; 24])
        };
        assert!(at(&mut contact, 0, 0.0).1 > 0.1, "{shares:?}");
        for dof in 0..24 {
            let [before, after] = [-1e-6, 1e-6].map(|by| at(&mut contact, dof, by).1);
            let (row, _) = at(&mut contact, dof, 0.0);
            let entry = entry(&contact, row, dof);
            assert!(((after - before) / 2e-6 - entry).abs() < 1e-7, "{shares:?}, {dof}: {entry}");
        }
    }
}

#[test]
fn forces_keep_both_momenta_far_from_the_origin_too() {
    for far in [0.0, 1e6] {
        let pair = Pair::new(0.7, [0.3, 0.6], 0.05).mapped(|x| sum(turned([0.3, 1.1], x), far, [1.0, -0.6, 0.3]));
        let rows = Pair::rows(&mut pair.contact());
        assert_eq!(rows.len(), 1);
        let (_, gap, normal, row) = &rows[0];
        // Rounding of the coordinates, over the sine of the angle.
        let rounding = 1e-13 + 8.0 * f64::EPSILON * far;
        assert!((gap - 0.05).abs() < rounding, "{gap}");
        let (mut force, mut moment) = ([0.0; 3], [0.0; 3]);
        for node in 0..8 {
            let mut f = [0.0; 3];
            row.iter().filter(|(dof, _)| dof / 3 == node).for_each(|&(dof, weight)| f[dof % 3] = weight);
            force = sum(force, 1.0, f);
            moment = sum(moment, 1.0, cross(sum(pair.nodes[node], -1.0, pair.nodes[0]), f));
        }
        assert!(dot(force, force).sqrt() < 1e-15 * 8.0 && dot(moment, moment).sqrt() < 8.0 * rounding, "{moment:?}");
        assert!((dot(*normal, *normal) - 1.0).abs() < 1e-14);
    }
}

#[test]
fn rows_depend_neither_on_units_nor_on_the_order_of_facets() {
    let pair = Pair::new(0.9, [0.4, 0.55], 0.03).mapped(|x| turned([0.4, -0.8], x));
    let rows = Pair::rows(&mut pair.contact());
    for unit in [1e-6, 1e6] {
        let scaled = Pair::rows(&mut pair.clone().mapped(|x| x.map(|x| unit * x)).contact());
        assert_eq!(rows.len(), scaled.len());
        for (row, same) in rows.iter().zip(&scaled) {
            assert!(row.0 == same.0 && (unit * row.1 - same.1).abs() < 1e-14 * unit, "{} {}", row.1, same.1);
            assert!(row.3.iter().zip(&same.3).all(|(x, y)| x.0 == y.0 && (x.1 - y.1).abs() < 1e-13));
        }
    }
    let [mut one, mut other] = [tetrahedron(0, &pair.nodes), tetrahedron(4, &pair.nodes)];
    one.reverse();
    other.rotate_left(2);
    for facet in &mut one {
        facet.rotate_left(1);
    }
    let mut again = EdgeToEdge::new(&pair.nodes, &Pair::dofs(), one, other).unwrap();
    assert_eq!(again.edges(), pair.contact::<f64>().edges());
    assert_eq!(format!("{:?}", Pair::rows(&mut again)), format!("{rows:?}"));
    // The other way round: the same gap, the normal turned.
    let mut swapped = EdgeToEdge::new(&pair.nodes, &Pair::dofs(), other, one).unwrap();
    let swapped = Pair::rows(&mut swapped);
    assert!(rows.len() == 1 && swapped.len() == 1 && (swapped[0].1 - rows[0].1).abs() < 1e-15);
    assert!(dot(swapped[0].2, rows[0].2) < -1.0 + 1e-14);
}

#[test]
fn single_precision_finds_the_same_rows() {
    let pair = Pair::new(0.9, [0.4, 0.55], 0.03);
    let (mut contact, mut single) = (pair.contact::<f64>(), pair.contact::<f32>());
    contact.search_on(0.0, &[0.0; 24], &[0.0; 24], 0.0).unwrap();
    single.search_on(0.0, &[0.0; 24], &[0.0; 24], 0.0).unwrap();
    let (found, again) = (Contacts::of(&contact), Contacts::of(&single));
    assert!(!found.is_empty() && found.len() == again.len());
    let (mut gaps, mut singles) = (vec![0.0; found.len()], vec![0.0_f32; found.len()]);
    contact.gap(0.0, &[0.0; 24], &mut gaps);
    single.gap(0.0, &[0.0; 24], &mut singles);
    for row in 0..found.len() {
        assert!(found.name(row) == again.name(row) && (gaps[row] - f64::from(singles[row])).abs() < 1e-5);
        let same = |x: (usize, f64), y: (usize, f32)| x.0 == y.0 && (x.1 - f64::from(y.1)).abs() < 1e-5;
        assert!(found.row(row).zip(again.row(row)).all(|(x, y)| same(x, y)));
    }
}

/// The first tetrahedron goes down by a way in a step, with these flags of the row.
fn step_down(contact: &mut EdgeToEdge<f64>, way: Vector, closed: [bool; 2]) -> Option<Error> {
    let dofs = contact.dofs().to_vec();
    let start = vec![0.0; dofs.len()];
    let moved = |dof: usize| if dof < 12 { way[dof % 3] } else { 0.0 };
    let end: Vec<f64> = dofs.iter().map(|&dof| moved(dof)).collect();
    contact.search(0.0, &start, &end, 1.0).unwrap();
    // (The flags of the ridges, which a search so far ahead finds.)
    let (found, ends) = (Contacts::of(&*contact), contact.edges());
    let is_ridges = |row: usize| {
        let (one, other) = found.name(row);
        [ends[0][one], ends[1][other]] == [[0, 1], [4, 5]]
    };
    let flags = closed.map(|closed| (0..found.len()).map(|row| closed && is_ridges(row)).collect::<Vec<_>>());
    contact.inspect(&Stride::new([0.0, 1.0], [&start, &end], &end, [&flags[0], &flags[1]])).err()
}

#[test]
fn steps_through_an_edge_are_refused_in_any_unit() {
    for unit in [1e-3, 1.0, 1e3] {
        let refused = |gap: f64, way: Vector, closed: [bool; 2]| {
            let pair = Pair::new(1.1, [0.5, 0.5], gap).mapped(|x| x.map(|x| unit * x));
            match step_down(&mut pair.contact(), way.map(|x| unit * x), closed) {
                None => false,
                Some(Error::PassedThrough { way: found, .. }) => {
                    assert!((found / (unit * dot(way, way).sqrt()) - 1.0).abs() < 1e-12);
                    true
                }
                Some(error) => panic!("{error}"),
            }
        };
        let open = [false; 2];
        // Straight through, and by so fast a way that it was out of reach.
        assert!(refused(0.2, [0.0, 0.0, -0.6], open) && refused(7.0, [0.0, 0.0, -20.0], open));
        // Up to the edge, beside it, away from it, along it.
        assert!(!refused(0.6, [0.0, 0.0, -0.6], open) && !refused(0.2, [0.0, 5.0, -0.6], open));
        assert!(!refused(0.01, [0.0, 0.0, 0.6], open) && !refused(0.01, [0.3, 0.0, 0.0], open));
        // In by less than a tenth of the way, and by more.
        assert!(!refused(0.6, [0.0, 0.0, -0.65], open) && refused(0.6, [0.0, 0.0, -0.7], open));
        // Stopped away from the edge, and beyond its end; stopped where it is.
        let stops = [false, true];
        assert!(refused(0.9, [0.0, 0.0, -0.6], stops) && refused(0.6, [3.0, 0.0, -0.6], stops));
        assert!(!refused(0.6, [0.0, 0.0, -0.6], stops) && !refused(0.64, [0.0, 0.0, -0.6], stops));
    }
}

/// Rows of edges that turn until they are parallel, which have no common normal, go on as they were last.
#[test]
fn rows_of_edges_that_become_parallel_stay_as_they_were() {
    let angle = 0.3;
    let pair = Pair::new(angle, [0.45, 0.6], 0.04);
    let mut contact = pair.contact::<f64>();
    contact.search_on(0.0, &[0.0; 24], &[0.0; 24], 0.0).unwrap();
    let row = ridges(&contact).unwrap();
    let seen = |contact: &mut EdgeToEdge<f64>, u: &[f64]| {
        let mut gaps = vec![0.0; contact.candidates()];
        contact.gap(0.0, u, &mut gaps);
        let found = Contacts::of(&*contact);
        (gaps[row], found.name(row), found.normal(row), found.row(row).collect::<Vec<_>>())
    };
    // The first body turns about the upright axis through the ridges' closest points, and comes down.
    let turned_by = |by: f64, down: f64| -> Vec<f64> {
        let moved = |node: usize| {
            let x = pair.nodes[node];
            let to = turned([by, 0.0], x);
            if node < 4 { sum(sum(to, -1.0, x), -down, [0.0, 0.0, 1.0]) } else { [0.0; 3] }
        };
        (0..8).flat_map(moved).collect()
    };
    let still = vec![0.0; 24];
    let (gap, name, normal, weights) = seen(&mut contact, &still);
    assert!((gap - 0.04).abs() < 1e-13);
    let dofs = contact.dofs().to_vec();
    let parallel = turned_by(-angle, 0.01);
    contact.follow_on(0.0, &parallel).unwrap();
    let affine = gap + weights.iter().map(|&(place, weight)| weight * parallel[dofs[place]]).sum::<f64>();
    let after = seen(&mut contact, &parallel);
    assert!((after.0 - affine).abs() < 1e-15, "{} {affine}", after.0);
    assert_eq!((after.1, after.2, &after.3), (name, normal, &weights));
    // And as they are where they cross again.
    let crossed = turned_by(0.1, 0.01);
    contact.follow_on(0.0, &crossed).unwrap();
    let again = seen(&mut contact, &crossed);
    assert!((again.0 - 0.03).abs() < 1e-13 && again.1 == name && again.3.len() == weights.len(), "{}", again.0);
}

#[test]
fn the_reach_is_a_distance_of_edges_whichever_way_they_lean() {
    for angles in [[0.0, 0.0], [0.4, -0.8], [1.0, 0.9]] {
        for (gap, near) in [(0.095, true), (0.105, false)] {
            let pair = Pair::new(0.9, [0.4, 0.55], gap).mapped(|x| turned(angles, x));
            let rows = Pair::rows(&mut pair.contact().with(SurfaceSettings::new().reach(0.1)).unwrap());
            assert_eq!(rows.len(), usize::from(near), "{angles:?} {gap}");
        }
    }
}

#[test]
fn edges_that_may_come_to_meet_have_rows() {
    // The lines are closest beyond the end of the one, and velocities lead them over each other within the step.
    let pair = Pair::new(1.3, [0.5, -0.3], 0.2);
    let mut contact = pair.contact::<f64>();
    let v: Vec<f64> = (0..24).map(|dof| if dof < 12 { [1.6, 0.0, -0.4][dof % 3] } else { 0.0 }).collect();
    contact.search_on(0.0, &[0.0; 24], &v, 0.0).unwrap();
    assert_eq!(ridges(&contact), None);
    contact.search_on(0.0, &[0.0; 24], &v, 0.7).unwrap();
    let row = ridges(&contact).unwrap();
    // As far away as they are, whichever of the two flies.
    for flies in [0..12, 12..24] {
        let mut far = Pair::new(1.3, [0.5, 0.4], 9.0).contact::<f64>().with(SurfaceSettings::new().reach(0.1)).unwrap();
        let down = if flies.start == 0 { -10.0 } else { 10.0 };
        let v: Vec<f64> = (0..24).map(|dof| if flies.contains(&dof) && dof % 3 == 2 { down } else { 0.0 }).collect();
        far.search_on(0.0, &[0.0; 24], &v, 0.8).unwrap();
        assert_eq!(ridges(&far), None);
        far.search_on(0.0, &[0.0; 24], &v, 1.0).unwrap();
        assert!(ridges(&far).is_some());
    }
    // Where they do not meet the gap is open by more; where they do it is that of the lines.
    for (time, meets) in [(0.0, false), (0.1, false), (0.45, true), (0.1, false), (0.55, true)] {
        let u: Vec<f64> = v.iter().map(|v| time * v).collect();
        contact.follow_on(time, &u).unwrap();
        let mut gaps = vec![0.0; contact.candidates()];
        contact.gap(time, &u, &mut gaps);
        let lines = 0.2 - 0.4 * time;
        let found = gaps[row];
        assert!(if meets { (found - lines).abs() < 1e-13 } else { found > lines + 0.01 }, "{time}: {found}");
    }
}

/// Two triangles in a plane below a ridge that crosses their common side. The side has a row when the plane folds
/// there, by more than the given angle, and none when it is flat again or folds the other way.
#[test]
fn a_side_becomes_an_edge_where_its_surface_folds() {
    let coordinates = [
        [-1.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.1],
        [0.0, 1.0, 0.1],
        [-1.0, 0.0, 1.1],
        [1.0, 0.0, 1.1],
    ];
    let (plane, ridge) = ([[0, 1, 3], [1, 0, 2]], [[4, 5, 7], [5, 4, 6]]);
    let contact = || EdgeToEdge::new(&coordinates, &Pair::dofs(), ridge, plane).unwrap();
    let wide = contact().with(SurfaceSettings::new().sharp(0.4)).unwrap();
    for (mut contact, least) in [(contact(), 0.01), (wide, 0.4)] {
        for angle in [0.0, 0.5, 0.5 * least, 1.01 * least, -0.5, 1.5 * least, 0.0_f64] {
            // Both triangles turn about their common side.
            let mut u = [0.0; 24];
            for (node, side) in [(2, -1.0), (3, 1.0)] {
                u[3 * node + 1] = side * ((0.5 * angle).cos() - 1.0);
                u[3 * node + 2] = -(0.5 * angle).sin();
            }
            contact.search_on(0.0, &u, &[0.0; 24], 0.0).unwrap();
            let found = Contacts::of(&contact);
            assert_eq!(found.len(), usize::from(angle > least), "{angle} of {least}");
            if angle > least {
                let mut gap = [0.0];
                contact.gap(0.0, &u, &mut gap);
                assert!((gap[0] - 0.1_f64).abs() < 1e-14 && found.normal(0) == Some([0.0, 0.0, 1.0]));
            }
        }
    }
}

#[test]
fn absurd_input_is_refused() {
    let pair = Pair::new(1.0, [0.5, 0.5], 0.1);
    for angle in [-0.1, 3.2, f64::NAN] {
        assert!(matches!(
            pair.contact::<f64>().with(SurfaceSettings::new().sharp(angle)),
            Err(Error::Parameter { .. })
        ));
    }
    assert!(
        pair.contact::<f64>().with(SurfaceSettings::new().reach(0.0)).is_err()
            && pair.contact::<f64>().with(SurfaceSettings::new().skin(f64::NAN)).is_err()
    );
    let [one, other] = [tetrahedron(0, &pair.nodes), tetrahedron(4, &pair.nodes)];
    let contact = EdgeToEdge::new(&pair.nodes, &Pair::dofs(), one, one);
    assert!(matches!(contact, Err(Error::Incompatible { .. })));
    let contact = EdgeToEdge::new(&pair.nodes, &Pair::dofs(), [[0, 1]], other);
    assert!(matches!(contact, Err(Error::Dimension { .. })));
    // No edge turns by more than 180 degrees.
    let flat = SurfaceSettings::new().sharp(std::f64::consts::PI);
    assert!(Pair::rows(&mut pair.contact::<f64>().with(flat).unwrap()).is_empty());
    // Trial states that are not finite: an error where a step begins, gaps that say so within.
    let mut contact = pair.contact::<f64>();
    contact.search_on(0.0, &[0.0; 24], &[0.0; 24], 0.0).unwrap();
    let mut u = vec![0.0; 24];
    u[2] = f64::NAN;
    contact.follow_on(0.0, &u).unwrap();
    let mut gaps = vec![0.0; contact.candidates()];
    contact.gap(0.0, &u, &mut gaps);
    assert!(gaps.iter().any(|gap| gap.is_nan()));
    assert!(matches!(contact.search_on(0.0, &u, &u, 0.0), Err(Error::NotFinite { .. })));
}

const MATERIAL: Material = Material { young: 100.0, poisson: 0.3, density: 1.0 };

/// Two square rods that stand on their edges, the upper one across the lower one, so far apart, and the edges of the
/// upper one against those of the lower one.
fn rods(angle: f64, shift: [f64; 2], gap: f64) -> Stack<3> {
    // (An odd number of elements: edges cross inside.)
    let rod = || {
        let block = Solid::block([2.0, 0.5, 0.5], [5, 1, 1], MATERIAL).moved([-1.0, -0.25, -0.25]);
        block.rotated([1.0, 0.0, 0.0], std::f64::consts::FRAC_PI_4)
    };
    let height = 0.5 * 2.0_f64.sqrt() + gap;
    let above = rod().rotated([0.0, 0.0, 1.0], angle).moved([shift[0], shift[1], height]);
    Stack::of_whole_surfaces([rod(), above])
}

#[test]
fn rods_that_fall_across_each_other_keep_momentum_and_gain_no_energy() {
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(Composite), || Box::new(Newmark::trapezoidal())];
    for (make, phases) in schemes.into_iter().zip([8, 4]) {
        for phase in 0..phases {
            for angle in [std::f64::consts::FRAC_PI_2, 0.6] {
                let h = 0.2 / MATERIAL.wave_speed();
                let speed = 0.5;
                let gap = 0.004 + speed * h * f64::from(phase) / f64::from(phases);
                let rods = rods(angle, [0.03, -0.02], gap);
                let mut run = Simulation::builder(rods.solid.system::<f64>(), make(), h)
                    .velocity(rods.velocity_of_upper([0.0, 0.0, -speed]))
                    .constraint(rods.nodes_on_facets(2).unwrap())
                    .constraint(rods.edges().unwrap())
                    .corrector(PersistencyCorrection::with_history_projection())
                    .build()
                    .unwrap();
                let up: Vec<f64> = (0..rods.solid.dofs()).map(|dof| f64::from(u8::from(dof % 3 == 2))).collect();
                let (energy, momentum) = (run.energy().total(), run.momentum(&up).unwrap());
                let (mut highest, mut pressed) = (energy, 0);
                let mut checker = rods.edges().unwrap().with_law(ContactLaw::Penalty { stiffness: 1.0 });
                while run.time() < 1.0 {
                    run.step().unwrap();
                    highest = highest.max(run.energy().total());
                    let contacts = run.state().contacts();
                    // Edges alone press, at one place.
                    for (id, force) in contacts.ids().iter().zip(contacts.raw_forces()) {
                        if *force > 0.0 {
                            assert_eq!(id.constraint, 1);
                            pressed += 1;
                        }
                    }
                    checker.search_on(run.time(), run.state().displacement(), run.state().velocity(), 0.0).unwrap();
                    let mut gaps = vec![0.0; checker.candidates()];
                    checker.gap(run.time(), run.state().displacement(), &mut gaps);
                    assert!(gaps.iter().all(|gap| *gap > -1e-12), "{gaps:?}");
                }
                let what = format!("{}, {angle}, {phase}", make().name());
                assert!(highest < energy * (1.0 + 1e-3), "{what}: {}", highest / energy);
                assert!((run.momentum(&up).unwrap() / momentum - 1.0).abs() < 1e-12, "{what}");
                // They part: the lower rod goes down faster than the upper one.
                let below: Vec<f64> =
                    (0..rods.solid.dofs()).map(|dof| if dof < 3 * rods.split { up[dof] } else { 0.0 }).collect();
                let open = run.state().contacts().raw_forces().iter().all(|force| *force == 0.0);
                assert!(pressed > 0 && open && run.momentum(&below).unwrap() / momentum > 0.5, "{what}");
            }
        }
    }
}

#[test]
fn without_edges_rods_go_through_each_other() {
    let rods = rods(1.57, [0.03, -0.02], 0.01);
    let depth = |with_edges: bool| {
        let builder = Simulation::builder(rods.solid.system::<f64>(), Composite, 0.02)
            .velocity(rods.velocity_of_upper([0.0, 0.0, -0.5]))
            .constraint(rods.nodes_on_facets(2).unwrap());
        let builder = if with_edges { builder.constraint(rods.edges().unwrap()) } else { builder };
        let mut run = builder.build().unwrap();
        let spring = ContactLaw::Penalty { stiffness: 1.0 };
        let (mut checker, mut deepest) = (rods.edges().unwrap().with_law(spring), 0.0_f64);
        while run.time() < 0.3 {
            run.step().unwrap();
            checker.search_on(run.time(), run.state().displacement(), run.state().velocity(), 0.0).unwrap();
            let mut gaps = vec![0.0; checker.candidates()];
            checker.gap(run.time(), run.state().displacement(), &mut gaps);
            deepest = gaps.into_iter().fold(deepest, |deepest, gap| deepest.max(-gap));
        }
        deepest
    };
    assert!(depth(false) > 0.05 && depth(true) < 1e-12, "{} {}", depth(false), depth(true));
}

#[test]
fn edges_that_slide_over_each_other_and_off_their_ends() {
    // The upper rod is drawn along, tilted to neither side, and pressed down lightly: over four of its nodes.
    for friction in [0.0, 0.2] {
        let rods = rods(std::f64::consts::FRAC_PI_2, [0.03, 0.45], 1e-6);
        let mass = rods.solid.lumped_mass::<f64>();
        let weight = 0.05;
        let upper = 3 * rods.split;
        let masses = mass.clone();
        let mut system = rods.solid.system::<f64>().load(move |_, f| {
            f.iter_mut().zip(&masses).enumerate().skip(upper).filter(|(dof, _)| dof % 3 == 2).for_each(
                |(_, (f, m))| {
                    *f = -weight * m;
                },
            );
        });
        for node in 0..rods.split {
            for axis in 0..3 {
                system = system.fix(3 * node + axis).unwrap();
            }
        }
        let mut run = Simulation::builder(system, Composite, 0.02)
            .velocity(rods.velocity_of_upper([0.0, -0.5, 0.0]))
            .constraint(rods.edges().unwrap().friction(friction))
            .build()
            .unwrap();
        let energy = run.energy().total();
        let (mut pairs, mut highest) = (Vec::new(), 0.0_f64);
        while run.time() < 1.5 {
            run.step().unwrap();
            let sunk: f64 = (upper + 2..rods.solid.dofs())
                .step_by(3)
                .map(|dof| weight * mass[dof] * run.state().displacement()[dof])
                .sum();
            let now = (run.energy().total() + sunk) / energy;
            highest = highest.max(now);
            let contacts = run.state().contacts();
            for (id, force) in contacts.ids().iter().zip(contacts.raw_forces()) {
                if *force > 0.0 && pairs.last() != Some(&id.feature) && !pairs.contains(&id.feature) {
                    pairs.push(id.feature);
                }
            }
        }
        assert!(highest < 1.0 + 1e-3, "{friction}: {highest}");
        assert!(pairs.len() >= 3, "{friction}: {pairs:?}");
        let along: f64 =
            (upper + 1..rods.solid.dofs()).step_by(3).map(|dof| mass[dof] * run.state().velocity()[dof]).sum();
        let whole: f64 = (upper + 1..rods.solid.dofs()).step_by(3).map(|dof| mass[dof]).sum();
        // Without friction it goes on as it came, but for what it loses where one pair takes over from another.
        let kept = along / whole / -0.5;
        assert!(if friction == 0.0 { (kept - 1.0).abs() < 5e-3 } else { kept < 0.99 }, "{friction}: {kept}");
    }
}

#[test]
fn blocks_that_fall_edge_on_face_gain_no_energy() {
    let mut random = xorshift(77);
    for fall in 0..5 {
        let scene = Fall::new(Landing::Edge, &mut random);
        let courant = 0.5 + random();
        let figures = scene.run(Keeps::TwoPassesAndEdges, Box::new(Composite), courant, 2.5).unwrap();
        assert!(figures.highest < 1.01 && figures.momentum < 1e-10, "{fall}: {figures:?}");
    }
}

/// The falls of a landing by their numbers, until some time.
fn check_falls(landing: Landing, keeps: Keeps, seed: u64, falls: &[usize], until: f64) {
    let mut random = xorshift(seed);
    for fall in 0..=falls.iter().copied().max().unwrap() {
        let scene = Fall::new(landing, &mut random);
        let courant = 0.5 + random();
        if !falls.contains(&fall) {
            continue;
        }
        let figures = scene.run(keeps, Box::new(Composite), courant, until).unwrap();
        assert!(figures.highest < 1.01 && figures.momentum < 1e-10, "{landing:?} {fall}: {figures:?}");
        assert!(figures.node_depth < 0.02 * scene.element, "{landing:?} {fall}: {figures:?}");
    }
}

#[test]
fn corners_in_the_dents_that_they_make_gain_no_energy() {
    // With one row a node they were in one side of the dent or the other, and came out at once: 1.03, 0.05 elements.
    check_falls(Landing::Corner, Keeps::TwoPasses, 77, &[10, 19], 4.5);
}

#[test]
fn corners_of_one_surface_keep_their_rows() {
    // The node under a corner had the row of both, slid off the corner, and let it in: 1.05 and 1.10, 0.2 elements.
    check_falls(Landing::Corner, Keeps::Itself, 77, &[9, 13], 4.0);
}

#[test]
fn edges_that_end_on_edges_gain_no_energy() {
    // Rows of edges and of nodes that are nearly the same saw pasts that contradict each other: 1.02 and 1.29.
    check_falls(Landing::Across, Keeps::TwoPassesAndEdges, 77, &[7], 3.8);
    check_falls(Landing::Beside, Keeps::TwoPassesAndEdges, 3, &[7], 4.7);
}

#[test]
fn edges_that_are_inside_come_out_slowly() {
    // Found inside by 0.01, of ridges of length 2: out by 0.0002 in a step.
    let mut contact = Pair::new(1.2, [0.5, 0.5], -0.01).contact::<f64>();
    assert!((Pair::rows(&mut contact)[0].1 + 0.01).abs() < 1e-14);
    let row = ridges(&contact).unwrap();
    assert!((Contacts::of(&contact).recovery(row) - 0.0002).abs() < 1e-15);
}
