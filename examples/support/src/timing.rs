//! Timing for benches: operations beside each other, their samples interleaved, ratios to the bare ones of the same
//! run.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Automatic, Factorization, LinearSolver, Real, System, TimeIntegrator};
use std::hint::black_box;
use std::time::Instant;

/// What the command line of a bench says.
#[derive(Clone, Debug)]
pub struct Arguments {
    /// `cargo test --benches` passes `--test`: run once, on small scenes, to see that it works.
    pub quick: bool,
    /// The numbers given, or the defaults.
    pub sizes: Vec<usize>,
}

impl Arguments {
    /// Reads them; without numbers `sizes` are taken, in quick mode always `quick`.
    pub fn read(sizes: &[usize], quick: &[usize]) -> Self {
        let given: Vec<usize> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
        if std::env::args().any(|argument| argument == "--test") {
            return Self { quick: true, sizes: quick.to_vec() };
        }
        Self { quick: false, sizes: if given.is_empty() { sizes.to_vec() } else { given } }
    }

    /// So many samples or calls, or one in quick mode.
    pub fn repeated(&self, times: usize) -> usize {
        if self.quick { 1 } else { times.max(1) }
    }
}

/// The unit in which times are printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    Micro,
    Milli,
}

impl Unit {
    fn name(self) -> &'static str {
        match self {
            Self::Micro => "µs",
            Self::Milli => "ms",
        }
    }

    /// How many make a second.
    fn count(self) -> f64 {
        match self {
            Self::Micro => 1e6,
            Self::Milli => 1e3,
        }
    }

    fn digits(self) -> usize {
        match self {
            Self::Micro => 2,
            Self::Milli => 3,
        }
    }
}

/// A column of ratios: times of rows over the sum of those of the named references.
#[derive(Clone, Copy, Debug)]
pub struct Ratio {
    pub heading: &'static str,
    pub to: &'static [&'static str],
}

struct Row<'a> {
    name: String,
    /// Gone once its figures are known.
    run: Option<Box<dyn FnMut() + 'a>>,
    is_reference: bool,
    /// Seconds a call.
    samples: Vec<f64>,
    ratios: Vec<f64>,
}

/// Operations that are timed beside each other.
pub struct Table<'a> {
    rows: Vec<Row<'a>>,
    unit: Unit,
    ratios: &'static [Ratio],
}

impl<'a> Table<'a> {
    pub fn new(unit: Unit, ratios: &'static [Ratio]) -> Self {
        Self { rows: Vec::new(), unit, ratios }
    }

    /// An operation that is sampled whenever others are.
    pub fn reference(&mut self, name: impl Into<String>, run: impl FnMut() + 'a) {
        self.push(name.into(), Box::new(run), true);
    }

    /// An operation that takes part in the next [`sample`](Self::sample).
    pub fn row(&mut self, name: impl Into<String>, run: impl FnMut() + 'a) {
        self.push(name.into(), Box::new(run), false);
    }

    fn push(&mut self, name: String, run: Box<dyn FnMut() + 'a>, is_reference: bool) {
        self.rows.push(Row { name, run: Some(run), is_reference, samples: Vec::new(), ratios: Vec::new() });
    }

    /// Times the references and the rows added since the last time, `calls` calls a sample, one sample of each in turn:
    /// what else the machine does disturbs all of them. The rows are then dropped with the memory they hold, so that
    /// scenes which do not fit beside each other are sampled one by one.
    pub fn sample(&mut self, samples: usize, calls: usize) {
        let mut live: Vec<_> = self.rows.iter_mut().filter(|row| row.run.is_some()).collect();
        let first: Vec<usize> = live.iter().map(|row| row.samples.len()).collect();
        for sample in 0..=samples {
            for row in &mut live {
                let Some(run) = &mut row.run else { continue };
                let start = Instant::now();
                (0..calls).for_each(|_| run());
                // The first one warms up.
                if sample > 0 {
                    row.samples.push(start.elapsed().as_secs_f64() / calls as f64);
                }
            }
        }
        let medians: Vec<_> =
            live.iter().zip(first).map(|(row, first)| (row.name.clone(), median(&row.samples[first..]))).collect();
        for (row, (_, own)) in live.into_iter().zip(&medians) {
            let time = |name: &&str| {
                medians.iter().find(|(other, _)| other.starts_with(name)).map_or(f64::NAN, |(_, median)| *median)
            };
            row.ratios = self.ratios.iter().map(|ratio| own / ratio.to.iter().map(time).sum::<f64>()).collect();
            if !row.is_reference {
                row.run = None;
            }
        }
    }

    /// Seconds of a row whose name begins so; the median.
    pub fn median(&self, name: &str) -> f64 {
        self.rows.iter().find(|row| row.name.starts_with(name)).map_or(f64::NAN, |row| median(&row.samples))
    }

    /// Prints all rows.
    pub fn print(&self) {
        let width = self.rows.iter().map(|row| row.name.chars().count()).max().unwrap_or(0).max(36);
        let unit = self.unit.name();
        print!("{:<width$} {:>10} {:>10}", "", format!("median {unit}"), format!("best {unit}"));
        for ratio in self.ratios {
            print!(" {:>15}", ratio.heading);
        }
        println!();
        let digits = self.unit.digits();
        for row in &self.rows {
            let best = row.samples.iter().copied().fold(f64::INFINITY, f64::min);
            let [median, best] = [median(&row.samples), best].map(|seconds| seconds * self.unit.count());
            print!("{:<width$} {median:>10.digits$} {best:>10.digits$}", row.name);
            for ratio in &row.ratios {
                print!(" {ratio:>15.2}");
            }
            println!();
        }
    }
}

/// Milliseconds, the best of so many calls after a first one: on a shared machine what is least disturbed.
pub fn best_milliseconds(samples: usize, mut work: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e3
    };
    (0..=samples).map(time).skip(1).fold(f64::INFINITY, f64::min)
}

/// The median.
pub fn median(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The effective matrix of an integrator's first stage, w_ā/h² M + w_ū K, with a lumped mass.
pub fn effective<T: Real>(
    k: &SparseColMat<usize, T>,
    mass: &[T],
    integrator: &dyn TimeIntegrator,
    h: f64,
) -> SparseColMat<usize, T> {
    let balance = integrator.tableau().stages[0].balance;
    let (inertia, stiffness) = (T::of(balance.a.z / (h * h)), T::of(balance.u.z));
    let (pattern, mut values) = k.clone().into_parts();
    values.iter_mut().for_each(|value| *value *= stiffness);
    for (dof, &m) in mass.iter().enumerate() {
        let columns = pattern.as_ref().col_range(dof);
        let at = pattern.row_idx()[columns.clone()].binary_search(&dof).expect("a diagonal entry");
        values[columns.start + at] += inertia * m;
    }
    SparseColMat::new(pattern, values)
}

/// A factor of a matrix, with these dofs eliminated last.
pub fn factor<T: Real>(a: &SparseColMat<usize, T>, last: &[usize]) -> Box<dyn Factorization<T>> {
    let mut factor = Automatic.analyze(a.symbolic(), last).expect("memory");
    factor.factorize(a.as_ref()).expect("positive definite");
    factor
}

/// A solve with a factor of a matrix of so many dofs.
pub fn solve<T: Real>(mut factor: Box<dyn Factorization<T>>, dofs: usize) -> impl FnMut() {
    let mut x = vec![T::one(); dofs];
    move || {
        x.fill(T::one());
        factor.solve(&mut x).expect("a direct solve");
        black_box(&x);
    }
}

/// One evaluation of the force: for a linear system one product with K.
pub fn force<T: Real>(mut system: impl System<T>) -> impl FnMut() {
    let dofs = system.dofs();
    let (u, v, mut f) = (vec![T::one(); dofs], vec![T::zero(); dofs], vec![T::zero(); dofs]);
    move || {
        system.force(0.0, black_box(&u), &v, &mut f).expect("an admissible state");
        black_box(&f);
    }
}
