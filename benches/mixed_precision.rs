//! A factor in `f32` whose solution is refined in `f64`, beside a factor in `f64`: blocks of hex8 elements.
//!
//! `cargo bench --bench mixed_precision -- [elements a side]…` (default 10 and 20; 30 takes two minutes). The crate
//! offers no such solver: this is the measurement why.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::{Automatic, Composite, Factorization, LinearSolver, LinearSystem, System};
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments};

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

fn main() {
    let arguments = Arguments::read(&[10, 20], &[4]);
    println!("best times in ms; residuals |b − A x| over |A| |x| + |b|, in the largest norms, after each sweep");
    println!(
        "{:>5} {:>9} {:>12} {:>12} {:>12} {:>12} {:>7} {:>16} residuals of the sweeps",
        "block", "Courant", "factor f64", "factor f32", "solve f64", "refined", "sweeps", "residual of f64"
    );
    for &cells in &arguments.sizes {
        for courant in [0.5, 2.0, 10.0] {
            compare(cells, courant, arguments.repeated(5));
        }
    }
}

fn compare(cells: usize, courant: f64, samples: usize) {
    let block = Solid::block([1.0; 3], [cells; 3], MATERIAL);
    let h = courant / cells as f64 / MATERIAL.wave_speed();
    let a = timing::effective(&block.stiffness::<f64>(), &block.lumped_mass(), &Composite, h);
    // Entries of about one: no number of the factor is subnormal.
    let scale = a.val().iter().fold(0.0_f64, |largest, x| largest.max(x.abs())).recip();
    let rounded = {
        let (pattern, values) = a.clone().into_parts();
        #[allow(clippy::cast_possible_truncation)]
        SparseColMat::new(pattern, values.iter().map(|x| (x * scale) as f32).collect())
    };
    let mut exact: Box<dyn Factorization<f64>> = Automatic.analyze(a.symbolic(), &[]).expect("memory");
    let mut coarse: Box<dyn Factorization<f32>> = Automatic.analyze(a.symbolic(), &[]).expect("memory");
    let of_f64 = timing::best_milliseconds(samples, || exact.factorize(a.as_ref()).expect("positive definite"));
    let of_f32 = timing::best_milliseconds(samples, || coarse.factorize(rounded.as_ref()).expect("positive definite"));

    let n = a.nrows();
    let b: Vec<f64> = (0..n).map(|i| (0.7 * i as f64).sin()).collect();
    let norm = |x: &[f64]| x.iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let of_a = (0..n).map(|j| a.val_of_col(j).iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    // The product of the crate: −A x is the force of a linear system.
    let mut system = LinearSystem::lumped(vec![1.0; n], a.clone()).expect("a symmetric matrix");
    let (still, mut product) = (vec![0.0; n], vec![0.0; n]);
    let mut residual = |x: &[f64], r: &mut [f64]| {
        system.force(0.0, x, &still, &mut product).expect("a linear system");
        r.iter_mut().zip(&b).zip(&product).for_each(|((r, b), product)| *r = b + product);
        norm(r) / (of_a * norm(x) + norm(&b))
    };

    let (mut x, mut r) = (b.clone(), vec![0.0; n]);
    let solve = timing::best_milliseconds(samples, || {
        x.copy_from_slice(&b);
        exact.solve(&mut x).expect("a direct solve");
    });
    let reached = residual(&x, &mut r);

    let mut correction = vec![0.0_f32; n];
    let mut refine = |sweeps: usize, residuals: &mut Vec<f64>| {
        residuals.clear();
        x.fill(0.0);
        r.copy_from_slice(&b);
        for _ in 0..sweeps {
            let size = norm(&r);
            #[allow(clippy::cast_possible_truncation)]
            correction.iter_mut().zip(&r).for_each(|(d, r)| *d = (r / size) as f32);
            coarse.solve(&mut correction).expect("a direct solve");
            x.iter_mut().zip(&correction).for_each(|(x, &d)| *x += size * scale * f64::from(d));
            residuals.push(residual(&x, &mut r));
        }
    };
    let mut residuals = Vec::new();
    refine(6, &mut residuals);
    let sweeps = 1 + residuals.iter().position(|&residual| residual <= 2.0 * reached).unwrap_or(residuals.len() - 1);
    let refined = timing::best_milliseconds(samples, || refine(sweeps, &mut residuals));
    let listed: Vec<String> = residuals.iter().map(|residual| format!("{residual:.0e}")).collect();
    println!(
        "{:>5} {courant:>9} {of_f64:>12.1} {of_f32:>12.1} {solve:>12.3} {refined:>12.3} {sweeps:>7} {reached:>16.0e} {}",
        format!("{cells}³"),
        listed.join(" ")
    );
}
