//! Bodies squeezed between walls and levers: rows that depend on one another, and that contradict each other once a
//! wall has closed.

use contact_dynamics::contact::GapOffset;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};
use contact_dynamics::{LinearRows, LinearSystem};

/// A row `G u + gap + rate t ≥ 0`.
#[derive(Clone, Debug)]
pub struct Row {
    pub entries: Vec<(usize, f64)>,
    pub gap: f64,
    pub rate: f64,
}

impl Row {
    fn new(entries: &[(usize, f64)], gap: f64, rate: f64) -> Self {
        Self { entries: entries.to_vec(), gap, rate }
    }

    fn scaled(&self, by: f64) -> Self {
        let entries = self.entries.iter().map(|&(dof, weight)| (dof, by * weight)).collect();
        Self { entries, gap: by * self.gap, rate: by * self.rate }
    }

    /// The sum of two rows: it holds wherever both do.
    fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        for &(dof, weight) in &other.entries {
            match sum.entries.iter_mut().find(|entry| entry.0 == dof) {
                Some(entry) => entry.1 += weight,
                None => sum.entries.push((dof, weight)),
            }
        }
        sum.gap += other.gap;
        sum.rate += other.rate;
        sum
    }

    /// The gap at t, over the sizes of its terms.
    pub fn share(&self, t: f64, u: &[f64]) -> f64 {
        let product = self.entries.iter().map(|&(dof, weight)| weight * u[dof]);
        let size: f64 = product.clone().map(f64::abs).sum();
        let own = self.gap + self.rate * t;
        (product.sum::<f64>() + own) / (size + self.gap.abs() + (self.rate * t).abs())
    }
}

/// Masses in a row with springs between them, and the rows that act on them.
#[derive(Clone, Debug)]
pub struct Squeeze {
    pub masses: Vec<f64>,
    /// From each mass to the next.
    pub springs: Vec<f64>,
    pub rows: Vec<Row>,
    pub h: f64,
    /// Until when the walls leave room.
    pub until: f64,
}

/// Whether the walls leave room.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Walls {
    /// The first wall goes as far as the last one allows, and on.
    Close,
    /// The last wall goes before the first.
    Yield,
}

impl Squeeze {
    /// Two masses, a wall that pushes the light one, a lever between them and a stop.
    pub fn smallest() -> Self {
        let lever = 0.634;
        let rows = vec![
            Row::new(&[(0, 1.0)], 0.0, -1.0),
            Row::new(&[(1, 1.0), (0, -lever)], 0.0, 0.0),
            Row::new(&[(1, -1.0)], 0.0525 * lever, 0.0),
        ];
        Self { masses: vec![0.0206, 57.4], springs: vec![4.65], rows, h: 0.01, until: 0.0525 }
    }

    /// Two to six masses, levers or ties between neighbors, and sums of rows beside the rows; masses and stiffnesses
    /// lie within the factor `ratio`. `random` gives numbers in [0, 1).
    pub fn random(random: &mut impl FnMut() -> f64, ratio: f64, walls: Walls) -> Self {
        let mut within = |low: f64, high: f64| low + (high - low) * random();
        let size = within(2.0, 7.0) as usize;
        let masses: Vec<f64> = (0..size).map(|_| ratio.powf(within(-0.5, 0.5))).collect();
        let springs = (1..size).map(|_| 10.0 * ratio.powf(within(-0.5, 0.5))).collect();
        // What the first mass may move until the chain of levers reaches the stop.
        let room = within(0.02, 0.1);
        let mut rows = vec![Row::new(&[(0, 1.0)], 0.0, -1.0)];
        let mut reached = 1.0;
        for i in 1..size {
            let lever = within(0.3, 1.5);
            reached *= lever;
            rows.push(Row::new(&[(i, 1.0), (i - 1, -lever)], 0.0, 0.0));
        }
        let (gap, rate) = if walls == Walls::Close { (room * reached, 0.0) } else { (0.1 * room * reached, reached) };
        rows.push(Row::new(&[(size - 1, -1.0)], gap, rate));
        for _ in 0..within(0.0, 4.0) as usize {
            let first = rows[within(0.0, rows.len() as f64) as usize].scaled(within(0.2, 3.0));
            let other = rows[within(0.0, rows.len() as f64) as usize].scaled(within(0.2, 3.0));
            rows.push(if within(0.0, 1.0) < 0.4 { first } else { first.plus(&other) });
        }
        // In any order.
        for i in (1..rows.len()).rev() {
            rows.swap(i, within(0.0, (i + 1) as f64) as usize);
        }
        let until = if walls == Walls::Close { room } else { f64::INFINITY };
        Self { masses, springs, rows, h: 0.01, until }
    }

    pub fn system(&self) -> LinearSystem<'static, f64> {
        let size = self.masses.len();
        let ends = |(i, &k): (usize, &f64)| {
            [(i, i, k), (i, i + 1, -k), (i + 1, i, -k), (i + 1, i + 1, k)].map(|(i, j, k)| Triplet::new(i, j, k))
        };
        let triplets: Vec<_> = self.springs.iter().enumerate().flat_map(ends).collect();
        let k = SparseColMat::try_new_from_triplets(size, size, &triplets).unwrap();
        LinearSystem::lumped(self.masses.clone(), k).unwrap()
    }

    pub fn contact(&self) -> LinearRows<'static, f64> {
        self.rows.iter().fold(LinearRows::new(), |contact, row| {
            let (gap, rate) = (row.gap, row.rate);
            contact.unilateral(&row.entries, GapOffset::moving(move |t| [gap + rate * t, rate, 0.0]))
        })
    }

    /// The worst violation of a row at t, over the sizes of its terms; 0 if there is none.
    pub fn violation(&self, t: f64, u: &[f64]) -> f64 {
        self.rows.iter().fold(0.0, |worst: f64, row| worst.max(-row.share(t, u)))
    }
}
