//! Reciprocal masses: frequencies, critical steps, distorted elements, what is refused, bars that collide at a frame.

use contact_dynamics::faer::sparse::SparseColMat;
use contact_dynamics::partitioned::{Frame, Side};
use contact_dynamics::{Automatic, Error, mass};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::random::xorshift;
use contact_dynamics_scenes::solids::{Material, Solid};
use contact_dynamics_scenes::sparse::{block, factorized, matrix, product, springs};

type Matrix = SparseColMat<usize, f64>;

/// The mass of a bar element, `share` of it consistent, the rest lumped, and r of the alternating motion.
fn blended(mass: f64, share: f64) -> ([f64; 4], f64) {
    let off = share * mass / 6.0;
    let diagonal = 0.5 * mass - off;
    ([diagonal, off, off, diagonal], 0.5 * mass / (diagonal - off))
}

/// Shares of the consistent mass: lumped, of fourth order, consistent.
const SHARES: [f64; 3] = [0.0, 0.375, 1.0];

/// A free bar of n elements of length 1/n, ρA = EA = 1: C of a share of consistent mass, and K.
fn free_bar(n: usize, share: f64) -> (Matrix, Matrix) {
    let nodes = || (0..n).map(|e| [e, e + 1]);
    let c = mass::reciprocal(nodes().map(|dofs| (dofs, blended(1.0 / n as f64, share).0)), n + 1).unwrap();
    (c, matrix(n + 1, springs(n + 1, n as f64)))
}

#[test]
fn reciprocal_masses_of_a_bar_have_the_frequencies_of_the_closed_form() {
    let n = 12;
    for share in SHARES {
        let r = blended(1.0, share).1;
        let (c, k) = free_bar(n, share);
        for mode in 0..=n {
            let theta = std::f64::consts::PI * mode as f64 / n as f64;
            let shape: Vec<f64> = (0..=n).map(|i| (theta * i as f64).cos()).collect();
            let square = 4.0 * (0.5 * theta).sin().powi(2) * (0.5 * (1.0 + r) + 0.5 * (1.0 - r) * theta.cos());
            let found = product(c.as_ref(), &product(k.as_ref(), &shape));
            let scale = (n * n) as f64;
            assert!(found.iter().zip(shape).all(|(x, s)| (x - scale * square * s).abs() < 1e-12 * scale), "{mode}");
        }
        // The error of the first frequency, by the Rayleigh quotient of its shape.
        let error = |n: usize| {
            let (c, k) = free_bar(n, share);
            let shape: Vec<f64> = (0..=n).map(|i| (std::f64::consts::PI * i as f64 / n as f64).cos()).collect();
            product(c.as_ref(), &product(k.as_ref(), &shape))[0].sqrt() / std::f64::consts::PI - 1.0
        };
        let (coarse, kh) = (error(20), std::f64::consts::PI / 20.0);
        let leading = 0.5 * (0.25 * r - 1.0 / 3.0) * kh * kh;
        assert!((coarse - leading).abs() < 0.2 * kh.powi(4), "{share}: {coarse:e} {leading:e}");
        let order = (coarse / error(40)).abs().log2();
        assert!((order - if (share - 0.375).abs() < 1e-9 { 4.0 } else { 2.0 }).abs() < 0.02, "{share}: order {order}");
    }
}

#[test]
fn fixed_ends_lose_their_rows_and_columns() {
    for share in SHARES {
        // The first frequency of the free part, by inverse iteration.
        let error = |n: usize| {
            let (c, k) = free_bar(n, share);
            let free = |a: &Matrix| factorized(&Automatic, &block(&(1..n + 1), &[(1.0, a)]));
            let (mut c, mut k) = (free(&c), free(&k));
            let (mut x, mut growth) = (vec![1.0; n], 0.0);
            for _ in 0..40 {
                c.solve(&mut x).unwrap();
                k.solve(&mut x).unwrap();
                growth = x[n - 1];
                for x in &mut x {
                    *x /= growth;
                }
            }
            (1.0 / f64::sqrt(growth)) / std::f64::consts::FRAC_PI_2 - 1.0
        };
        let (coarse, fine) = (error(20), error(40));
        let order = (coarse / fine).abs().log2();
        println!("share {share}: fixed at one end, error {coarse:.2e}, order {order:.2}");
        assert!(coarse.abs() < 0.01 && order > 1.9, "{share}: {coarse:e}, order {order}");
    }
}

/// The largest step of central differences, 2/ω, ω² the largest eigenvalue of the operator.
fn critical_step(n: usize, mut operator: impl FnMut(&[f64]) -> Vec<f64>) -> f64 {
    let mut random = xorshift(3);
    let mut x: Vec<f64> = (0..n).map(|_| random() - 0.5).collect();
    let mut square = 0.0;
    for _ in 0..20_000 {
        let y = operator(&x);
        square = y.iter().map(|y| y * y).sum::<f64>().sqrt();
        x = y.into_iter().map(|y| y / square).collect();
    }
    2.0 / f64::sqrt(square)
}

#[test]
fn critical_steps_of_reciprocal_masses() {
    let n = 20;
    let reciprocal = SHARES.map(|share| {
        let (c, k) = free_bar(n, share);
        n as f64 * critical_step(n + 1, |x| product(c.as_ref(), &product(k.as_ref(), x)))
    });
    let (_, k) = free_bar(n, 0.0);
    let entries = (0..n).flat_map(|e| {
        let [a, b, _, d] = blended(1.0 / n as f64, 1.0).0;
        [(e, e, a), (e + 1, e + 1, d), (e, e + 1, b), (e + 1, e, b)]
    });
    let mut consistent = factorized(&Automatic, &matrix(n + 1, entries));
    let consistent = n as f64
        * critical_step(n + 1, |x| {
            let mut y = product(k.as_ref(), x);
            consistent.solve(&mut y).unwrap();
            y
        });
    println!("Courant numbers at the limit: reciprocal {reciprocal:?} for shares {SHARES:?}, consistent {consistent}");
    // Courant numbers c h/h_e at the limit.
    for (found, share) in reciprocal.into_iter().zip(SHARES) {
        assert!((found * blended(1.0, share).1.sqrt() - 1.0).abs() < 1e-6, "{share}: {found}");
    }
    assert!((consistent * 3.0_f64.sqrt() - 1.0).abs() < 1e-6, "{consistent}");
}

#[test]
fn reciprocal_masses_of_distorted_elements_are_exact_for_translation() {
    let material = Material { young: 1.0, poisson: 0.3, density: 7.0 };
    let plate = Solid::rectangle([3.0, 2.0], [6, 4], material);
    let plate = plate.mapped(|[x, y]| [x + 0.07 * (5.0 * y + x).sin(), y + 0.06 * (4.0 * x - y).cos()]);
    let n = plate.dofs();
    let element = |corners: &Vec<usize>| {
        let nodes = corners.iter().map(|&node| plate.nodes[node]).collect();
        let alone = Solid { nodes, elements: vec![(0..4).collect()], material };
        let m = alone.consistent_mass().to_dense();
        let dofs: Vec<usize> = corners.iter().flat_map(|node| [2 * node, 2 * node + 1]).collect();
        (dofs, (0..64).map(|k| m[(k / 8, k % 8)]).collect::<Vec<f64>>())
    };
    let elements: Vec<_> = plate.elements.iter().map(element).collect();
    let c = mass::reciprocal(elements.iter().map(|(dofs, m)| (dofs, m)), n).unwrap();
    let lumped = plate.lumped_mass::<f64>();
    for direction in [[1.0, 0.0], [0.0, 1.0], [0.6, -2.0]] {
        let v: Vec<f64> = plate.uniform(direction);
        let p: Vec<f64> = v.iter().zip(&lumped).map(|(v, m)| v * m).collect();
        assert!(product(c.as_ref(), &p).iter().zip(&v).all(|(x, y)| (x - y).abs() < 1e-13));
    }
    for j in 0..n {
        for (&i, &x) in c.as_ref().row_idx_of_col_raw(j).iter().zip(c.as_ref().val_of_col(j)) {
            assert_eq!(x.to_bits(), c[(j, i)].to_bits());
            assert_eq!(i % 2, j % 2, "directions do not couple");
        }
    }
    // Positive definite.
    let _ = factorized(&Automatic, &c);
    // Lumped elements give the lumped inverse.
    let lump = |m: &[f64]| {
        (0..64).map(|k| if k % 9 == 0 { m[k / 8 * 8..k / 8 * 8 + 8].iter().sum() } else { 0.0 }).collect::<Vec<f64>>()
    };
    let c = mass::reciprocal(elements.iter().map(|(dofs, m)| (dofs, lump(m))), n).unwrap();
    assert_eq!(c.val().len(), n);
    assert!(c.val().iter().zip(&lumped).all(|(c, m)| (c * m - 1.0).abs() < 1e-13));
}

#[test]
fn reciprocal_masses_refuse_what_they_cannot_invert() {
    let refused = |elements: &[(Vec<usize>, Vec<f64>)]| {
        let elements = elements.iter().map(|(dofs, m)| (dofs, m));
        mass::reciprocal(elements, 3).map(|_| ()).unwrap_err()
    };
    let good = (vec![0, 1], vec![2.0, 1.0, 1.0, 2.0]);
    let with = |dofs: &[usize], m: &[f64]| refused(&[good.clone(), (dofs.to_vec(), m.to_vec())]);
    assert!(matches!(refused(std::slice::from_ref(&good)), Error::Mass { dof: 2, .. }));
    assert!(matches!(with(&[1, 3], &[2.0, 1.0, 1.0, 2.0]), Error::MissingDof { dof: 3, dofs: 3, .. }));
    assert!(matches!(with(&[1, 2], &[2.0]), Error::Dimension { expected: 4, found: 1, .. }));
    assert!(matches!(with(&[1, 2], &[2.0, 1.0, 0.5, 2.0]), Error::Asymmetric { row: 2, column: 1, .. }));
    let not_finite = with(&[1, 2], &[2.0, f64::NAN, 1.0, 2.0]);
    assert!(matches!(not_finite, Error::MatrixNotFinite { row: 1, column: 2, .. }));
    assert!(matches!(with(&[1, 2], &[2.0, -2.0, -2.0, 2.0]), Error::Mass { dof: 1, .. }));
    for indefinite in [[1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 2.0, 1.0]] {
        assert!(matches!(with(&[1, 2], &indefinite), Error::Singular { matrix: "mass matrix of an element", .. }));
    }
}

/// Two bars with reciprocal masses in codes of their own: p ← p + h (f + Gᵀl), v = C p, u ← u + h v.
struct Explicit {
    c: Matrix,
    k: Matrix,
    u: Vec<f64>,
    p: Vec<f64>,
    /// The contact dof, and the sign of a compressive force on it.
    contact: (usize, f64),
}

#[test]
fn bars_with_reciprocal_masses_collide() {
    // Force RMS over the contact interval and largest energy, for each share at 0.9 of its critical step.
    for (share, bound) in SHARES.into_iter().zip([0.03, 0.15, 0.28]) {
        let bars = Bars::paper(50);
        let (n, size) = (bars.elements[0], bars.element_size(0));
        let (element, r) = blended(bars.density[0] * bars.area * size, share);
        let wave = (bars.young[0] / bars.density[0]).sqrt();
        let h = 0.9 * size / wave / r.sqrt();
        let mut lumped = vec![0.0; n + 1];
        (0..n).for_each(|e| [e, e + 1].iter().for_each(|&i| lumped[i] += element[0] + element[1]));
        let elements = || (0..n).map(|e| ([e, e + 1], element));
        let mut bodies = [0, 1].map(|number| {
            let c = mass::reciprocal(elements(), n + 1).unwrap();
            let k = block(&[0..n + 1, n + 1..2 * n + 2][number], &[(1.0, &bars.stiffness())]);
            let p = lumped.iter().map(|m| m * bars.velocity[number]).collect();
            Explicit { c, k, u: vec![0.0; n + 1], p, contact: [(n, -1.0), (0, 1.0)][number] }
        });
        let flexibility = bodies.each_ref().map(|body| h * h * body.c[(body.contact.0, body.contact.0)]);
        let mut frame = Frame::new(1).unwrap();
        let energy = |bodies: &[Explicit; 2], before: &[Vec<f64>; 2]| {
            let of = |(body, before): (&Explicit, &Vec<f64>)| {
                let p: Vec<f64> = body.p.iter().zip(before).map(|(p, q)| 0.5 * (p + q)).collect();
                let [v, f] = [product(body.c.as_ref(), &p), product(body.k.as_ref(), &body.u)];
                let pairs = p.iter().zip(v).chain(body.u.iter().zip(f));
                pairs.map(|(x, y)| 0.5 * x * y).sum::<f64>()
            };
            bodies.iter().zip(before).map(of).sum::<f64>()
        };
        let before = bodies.each_ref().map(|body| body.p.clone());
        let start = energy(&bodies, &before);
        let plateau = bars.density[0] * wave * bars.area * bars.velocity[0];
        let (mut square, mut count, mut most, mut impulse, mut last) = (0.0, 0, 0.0_f64, 0.0, start);
        let mut t = 0.0;
        while t < 0.4 {
            t += h;
            let before = bodies.each_ref().map(|body| body.p.clone());
            for Explicit { k, u, p, .. } in &mut bodies {
                let f = product(k.as_ref(), u);
                p.iter_mut().zip(f).for_each(|(p, f)| *p -= h * f);
            }
            let free = bodies.each_ref().map(|body| {
                let dof = body.contact.0;
                [body.u[dof] + h * product(body.c.as_ref(), &body.p)[dof]]
            });
            let sides = [0, 1].map(|s| Side::new(&free[s], &flexibility[s..=s]));
            let force = frame.solve(sides, &[bars.gap]).unwrap().forces()[0];
            for Explicit { p, contact: (dof, sign), .. } in &mut bodies {
                p[*dof] += h * *sign * force;
            }
            impulse += h * force;
            last = energy(&bodies, &before);
            most = most.max(last / start);
            for Explicit { c, u, p, .. } in &mut bodies {
                let v = product(c.as_ref(), p);
                u.iter_mut().zip(v).for_each(|(u, v)| *u += h * v);
            }
            if t > 0.1 + 2.0 * h && t < 0.3 {
                square += (force / plateau - 1.0).powi(2);
                count += 1;
            } else if t < 0.1 {
                assert!(force == 0.0);
            }
        }
        let rms = (square / f64::from(count)).sqrt();
        println!(
            "share {share}: h {h:.2e}, force RMS {rms:.3}, energy at most {most:.4}, at the end {:.4}",
            last / start
        );
        assert!(
            rms < bound && most < 1.0 + 1e-9 && last / start > 0.98,
            "share {share}: {rms} {most} {}",
            last / start
        );
        // Momentum of each body in the lumped masses: what the contact has given, and no more.
        for (Explicit { c, p, contact, .. }, v) in bodies.iter().zip(bars.velocity) {
            let v_now = product(c.as_ref(), p);
            let found: f64 = v_now.iter().zip(&lumped).map(|(v, m)| v * m).sum();
            let expected = v * lumped.iter().sum::<f64>() + contact.1 * impulse;
            assert!((found - expected).abs() < 1e-13 * impulse, "{found} {expected}");
        }
    }
}
