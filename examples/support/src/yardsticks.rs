//! What the crate is measured against: programs of a few lines that do the same work, written for one scene, and what
//! the machine cannot do without.
#![allow(clippy::inline_always)] // what is not inlined is not compiled for the machine's vector units

use contact_dynamics::faer::Side;
use contact_dynamics::faer::perm::PermRef;
use contact_dynamics::faer::sparse::linalg::SupernodalThreshold;
use contact_dynamics::faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymmetricOrdering, factorize_symbolic_cholesky,
};
use contact_dynamics::faer::sparse::{SparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::faer::traits::pulp::{Arch, Simd, WithSimd};
use contact_dynamics::{Mass, Real, System};
use contact_dynamics_scenes::Bars;
use std::hint::black_box;

/// Entries of the Cholesky factor of a pattern in this order of elimination, those on the diagonal included. (A factor
/// in blocks stores more: their upper halves, and zeros where columns are much alike.)
pub fn entries_of_factor(pattern: SymbolicSparseColMatRef<'_, usize>, order: &[usize]) -> usize {
    let mut inverse = vec![0; order.len()];
    order.iter().enumerate().for_each(|(place, &dof)| inverse[dof] = place);
    let order = SymmetricOrdering::Custom(PermRef::new_checked(order, &inverse, order.len()));
    let parameters = CholeskySymbolicParams {
        supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
        ..Default::default()
    };
    let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, order, parameters).expect("memory");
    symbolic.len_val()
}

/// Reads so many numbers from memory, twice: what a solve would take that does nothing else.
pub fn reading<T: Real>(scalars: usize) -> impl FnMut() {
    let numbers = vec![T::one(); scalars];
    move || {
        for _ in 0..2 {
            let mut sums = [T::zero(); 16];
            for chunk in black_box(&numbers[..]).chunks_exact(16) {
                for (sum, &x) in sums.iter_mut().zip(chunk) {
                    *sum += x;
                }
            }
            black_box(sums);
        }
    }
}

/// K u as a program of a few lines has it: rows compressed, 32-bit indices, one sum a row.
pub fn gather<T: Real>(k: &SparseColMat<usize, T>) -> impl FnMut() + use<T> {
    let product = compressed_rows(k);
    let (u, mut f) = (vec![T::one(); k.nrows()], vec![T::zero(); k.nrows()]);
    move || {
        product(black_box(&u), &mut f);
        black_box(&f);
    }
}

pub fn compressed_rows<T: Real>(k: &SparseColMat<usize, T>) -> impl Fn(&[T], &mut [T]) + use<T> {
    let index = |i: &usize| u32::try_from(*i).expect("a small matrix");
    // (K is symmetric: its columns are its rows.)
    let pointers: Vec<u32> = k.col_ptr().iter().map(index).collect();
    let columns: Vec<u32> = k.row_idx().iter().map(index).collect();
    let values = k.val().to_vec();
    move |u, f| {
        for (f, range) in f.iter_mut().zip(pointers.windows(2)) {
            let range = range[0] as usize..range[1] as usize;
            let mut sum = T::zero();
            for (&column, &value) in columns[range.clone()].iter().zip(&values[range]) {
                sum += value * u[column as usize];
            }
            *f = sum;
        }
    }
}

/// A step of central differences as one writes it with arrays (velocity Verlet; [`gather`], then an expression of whole
/// vectors a line): what a scripting language with compiled vectors does, without the overhead of its calls.
pub fn explicit_by_arrays<T: Real>(k: &SparseColMat<usize, T>, mass: &[T], h: f64) -> impl FnMut() + use<T> {
    let product = compressed_rows(k);
    let inverse: Vec<T> = mass.iter().map(|m| m.recip()).collect();
    let still = || vec![T::zero(); mass.len()];
    let (mut u, mut v, mut a, mut f) = (still(), vec![T::of(1e-3); mass.len()], still(), still());
    let (whole, half) = (T::of(h), T::of(0.5 * h));
    move || {
        v.iter_mut().zip(&a).for_each(|(v, &a)| *v += half * a);
        u.iter_mut().zip(&v).for_each(|(u, &v)| *u += whole * v);
        product(&u, &mut f);
        a.iter_mut().zip(&inverse).zip(&f).for_each(|((a, &inverse), &f)| *a = -inverse * f);
        v.iter_mut().zip(&a).for_each(|(v, &a)| *v += half * a);
        black_box((&u, &v, &a));
    }
}

/// The force of an explicit step and the one pass over the vectors that it cannot do without.
pub fn explicit_limit<T: Real>(mut system: impl System<T>, h: f64) -> impl FnMut() {
    let dofs = system.dofs();
    let inverse: Vec<T> = match system.mass() {
        Mass::Lumped(mass) => mass.iter().map(|m| m.recip()).collect(),
        _ => panic!("an explicit step takes a lumped mass"),
    };
    let still = || vec![T::zero(); dofs];
    let (mut u, mut v, mut a, mut f) = (still(), still(), still(), still());
    let (whole, half) = (T::of(h), T::of(0.5 * h));
    move || {
        system.force(0.0, black_box(&u), &v, &mut f).expect("an admissible state");
        let rates = v.iter_mut().zip(&mut a).zip(inverse.iter().zip(&f));
        for (u, ((v, a), (&inverse, &f))) in u.iter_mut().zip(rates) {
            *u += whole * (*v + half * *a);
            *v += half * (*a + inverse * f);
            *a = inverse * f;
        }
        black_box((&u, &v, &a));
    }
}

/// The composite scheme's step of chains in a straight program: what a host would write for this scene alone.
/// Prediction, product with K and forward sweep are one loop, backward sweep and recovery another one.
pub fn composite_by_hand<T: Real>(bars: &Bars, h: f64) -> impl FnMut() + 'static {
    let dofs = bars.dofs();
    let mass = bars.lumped_mass::<T>();
    let zero = T::zero();
    let (diagonal, beside) = tridiagonal::<T>(bars);
    let inertia = T::of(2.5 / (h * h));
    let [lower, inverse] = factorize(inertia, &mass, &diagonal, &beside);
    let still = || vec![zero; dofs];
    let (mut u, mut u1, mut v, mut v1, mut x, mut a) = (still(), still(), still(), still(), still(), still());
    u.iter_mut().enumerate().for_each(|(i, u)| *u = T::of(1e-3 * (0.1 * i as f64).sin()));
    u1.copy_from_slice(&u);
    let [of_u, of_v, of_v1] = [0.6, 0.8 * h, 0.4 * h].map(T::of);
    let [rate_new, rate_old] = [1.5 / h, 0.5 / h].map(T::of);
    move || {
        let predicted = |i: usize| u[i] + of_u * (u[i] - u1[i]) + (of_v * v[i] - of_v1 * v1[i]);
        let (mut before, mut now, mut last) = (zero, predicted(0), zero);
        for i in 0..dofs {
            let next = if i + 1 < dofs { predicted(i + 1) } else { zero };
            let pull = diagonal[i] * now + beside[i] * next + if i > 0 { beside[i - 1] * before } else { zero };
            last = -pull - if i > 0 { lower[i - 1] * last } else { zero };
            x[i] = last;
            (before, now) = (now, next);
        }
        let mut d = zero;
        for i in (0..dofs).rev() {
            d = x[i] * inverse[i] - lower[i] * d;
            let new = u[i] + of_u * (u[i] - u1[i]) + (of_v * v[i] - of_v1 * v1[i]) + d;
            let rate = rate_new * (new - u[i]) - rate_old * (u[i] - u1[i]);
            a[i] = inertia * d;
            (u1[i], u[i]) = (u[i], new);
            (v1[i], v[i]) = (v[i], rate);
        }
        black_box((&u, &v, &a));
    }
}

/// A step of the trapezoidal rule with a Lagrange multiplier and λ_v/λ_a at the contact of two bars that loads press
/// together, as a plain program of loops over arrays has it: predict, multiply, solve, see whether the gap is closed,
/// push, update, correct. It is compiled for the units of the machine, as C is by `-O3 -march=native`.
pub fn newmark_by_hand<T: Real>(bars: &Bars, h: f64) -> impl FnMut() + 'static {
    let mut run = NewmarkByHand::<T>::new(bars, h);
    move || {
        match Arch::new() {
            // Without units for it fused multiply-add is a function call.
            Arch::Scalar => run.step(|x, l, y| x - l * y),
            arch => arch.dispatch(Fused(&mut run)),
        }
        black_box((&run.u, &run.v, &run.a));
    }
}

/// M, K and L D Lᵀ of 4 M/h² + K, and the motion.
pub struct NewmarkByHand<T> {
    mass: Vec<T>,
    diagonal: Vec<T>,
    beside: Vec<T>,
    lower: Vec<T>,
    inverse: Vec<T>,
    load: Vec<T>,
    /// The dofs of the contact, displacements by a unit force there, and what it and a unit impulse change of the gap
    /// and its rate.
    contact: [usize; 2],
    response: Vec<T>,
    compliance: T,
    jump: T,
    /// 4/h², h, h/2, h²/4.
    weights: [T; 4],
    pub u: Vec<T>,
    pub v: Vec<T>,
    pub a: Vec<T>,
    d: Vec<T>,
}

struct Fused<'a, T>(&'a mut NewmarkByHand<T>);

impl<T: Real> WithSimd for Fused<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.step(|x, l, y| T::mul_add(-l, y, x));
    }
}

impl<T: Real> NewmarkByHand<T> {
    pub fn new(bars: &Bars, h: f64) -> Self {
        let dofs = bars.dofs();
        let [left, right] = bars.contact_dofs();
        let (diagonal, beside) = tridiagonal::<T>(bars);
        let mass = bars.lumped_mass::<T>();
        let zero = T::zero();
        let inertia = T::of(4.0 / (h * h));
        let [lower, inverse] = factorize(inertia, &mass, &diagonal, &beside);
        let mut load = vec![zero; dofs];
        (load[0], load[dofs - 1]) = (T::one(), -T::one());
        let mut response = vec![zero; dofs];
        (response[left], response[right]) = (-T::one(), T::one());
        let jump = mass[left].recip() + mass[right].recip();
        // Statically compressed by the loads, and vibrating slightly.
        let shortening = bars.element_size(0) / (bars.young[0] * bars.area);
        let at_rest = |i: usize| if i <= left { (left - i) as f64 } else { -((i - right) as f64) };
        let rate = |i: usize| if i == left || i == right { 0.0 } else { 1e-3 * (0.1 * i as f64).sin() };
        let mut run = Self {
            u: (0..dofs).map(|i| T::of(shortening * at_rest(i))).collect(),
            v: (0..dofs).map(|i| T::of(rate(i))).collect(),
            a: vec![zero; dofs],
            d: response,
            weights: [4.0 / (h * h), h, 0.5 * h, 0.25 * h * h].map(T::of),
            contact: [left, right],
            response: Vec::new(),
            compliance: zero,
            jump,
            mass,
            diagonal,
            beside,
            lower,
            inverse,
            load,
        };
        run.solve(|x, l, y| x - l * y);
        run.response = run.d.clone();
        run.compliance = run.d[right] - run.d[left];
        run
    }

    /// d ← A⁻¹ d; `eliminate(x, l, y)` is x − l y.
    #[inline(always)]
    fn solve(&mut self, eliminate: impl Fn(T, T, T) -> T) {
        let Self { lower, inverse, d, .. } = self;
        let mut above = T::zero();
        let mut l_above = T::zero();
        for (d, &l) in d.iter_mut().zip(&*lower) {
            above = eliminate(*d, l_above, above);
            *d = above;
            l_above = l;
        }
        let mut behind = T::zero();
        for ((d, &l), &inverse) in d.iter_mut().zip(&*lower).zip(&*inverse).rev() {
            behind = eliminate(*d * inverse, l, behind);
            *d = behind;
        }
    }

    #[inline(always)]
    pub fn step(&mut self, eliminate: impl Fn(T, T, T) -> T) {
        let [inertia, h, half, quarter] = self.weights;
        let [left, right] = self.contact;
        let n = self.u.len();
        {
            let (u, v, a) = (&mut self.u[..n], &mut self.v[..n], &self.a[..n]);
            for i in 0..n {
                u[i] += h * v[i] + quarter * a[i];
                v[i] += half * a[i];
            }
        }
        {
            let (u, d, load) = (&self.u[..n], &mut self.d[..n], &self.load[..n]);
            let (diagonal, beside) = (&self.diagonal[..n], &self.beside[..n]);
            d[0] = load[0] - diagonal[0] * u[0] - beside[0] * u[1];
            for i in 1..n - 1 {
                d[i] = load[i] - beside[i - 1] * u[i - 1] - diagonal[i] * u[i] - beside[i] * u[i + 1];
            }
            d[n - 1] = load[n - 1] - beside[n - 2] * u[n - 2] - diagonal[n - 1] * u[n - 1];
        }
        self.solve(eliminate);
        let (u, v, a, d) = (&mut self.u[..n], &mut self.v[..n], &mut self.a[..n], &mut self.d[..n]);
        let gap = u[right] + d[right] - u[left] - d[left];
        let multiplier = (-gap / self.compliance).max(T::zero());
        if multiplier > T::zero() {
            for (d, &response) in d.iter_mut().zip(&self.response) {
                *d += multiplier * response;
            }
        }
        for i in 0..n {
            u[i] += d[i];
            a[i] = inertia * d[i];
            v[i] += half * a[i];
        }
        if multiplier > T::zero() {
            for x in [v, a] {
                let push = (x[left] - x[right]) / self.jump;
                x[left] -= push / self.mass[left];
                x[right] += push / self.mass[right];
            }
        }
    }
}

/// L D Lᵀ of `inertia` M + K: the entries of L below the diagonal, and 1/D.
fn factorize<T: Real>(inertia: T, mass: &[T], diagonal: &[T], beside: &[T]) -> [Vec<T>; 2] {
    let [mut lower, mut inverse] = [(); 2].map(|()| vec![T::zero(); mass.len()]);
    let mut above = T::zero();
    for i in 0..mass.len() {
        let pivot = inertia * mass[i] + diagonal[i] - above;
        (inverse[i], lower[i]) = (pivot.recip(), beside[i] / pivot);
        above = lower[i] * beside[i];
    }
    [lower, inverse]
}

/// The diagonal of K and the entries beside it, the last one a zero.
fn tridiagonal<T: Real>(bars: &Bars) -> (Vec<T>, Vec<T>) {
    let stiffness = bars.stiffness::<T>();
    let entry = |i: usize, j: usize| {
        let rows = stiffness.as_ref().row_idx_of_col_raw(j);
        rows.iter().position(|&row| row == i).map_or(T::zero(), |at| stiffness.val_of_col(j)[at])
    };
    let dofs = bars.dofs();
    let beside = (0..dofs).map(|i| if i + 1 < dofs { entry(i, i + 1) } else { T::zero() }).collect();
    ((0..dofs).map(|i| entry(i, i)).collect(), beside)
}
