//! Cost of an explicit step of a host that computes its force element by element, without any assembled K, beside its
//! limit: one evaluation of the force and one pass over the vectors.
//!
//! `cargo bench --bench assembly_free -- [elements a side]…` (default 10, 20 and 40; chains of 100 to a million
//! elements a bar come first, a plate of 300 × 300 after them)

use contact_dynamics::faer::sparse::{SymbolicSparseColMat, SymbolicSparseColMatRef};
use contact_dynamics::{
    CdLagrange, CentralDifference, LinearRows, Linearity, Mass, Real, Result, Simulation, System, TangentWeights,
    TimeIntegrator,
};
use contact_dynamics_scenes::Bars;
use contact_dynamics_scenes::solids::{Material, Solid};
use example_support::timing::{self, Arguments, Ratio, Table, Unit};
use example_support::yardsticks;

const MATERIAL: Material = Material { young: 1.0, poisson: 0.3, density: 1.0 };

const RATIOS: &[Ratio] =
    &[Ratio { heading: "/ force", to: &["force alone"] }, Ratio { heading: "/ limit", to: &["force and one pass"] }];

fn main() {
    let arguments = Arguments::read(&[10, 20, 40], &[4]);
    for n in if arguments.quick { vec![100] } else { vec![100, 1_000, 10_000, 100_000, 1_000_000] } {
        chain::<f64>("f64", n, &arguments);
        chain::<f32>("f32", n, &arguments);
    }
    let cells = if arguments.quick { 8 } else { 300 };
    let plate = Solid::rectangle([1.0; 2], [cells; 2], MATERIAL);
    let one = Solid::rectangle([1.0 / cells as f64; 2], [1; 2], MATERIAL);
    solid::<f64, 2, 8>(&format!("plate of {cells}² quad4, f64"), &plate, &one, cells, &arguments);
    solid::<f32, 2, 8>(&format!("plate of {cells}² quad4, f32"), &plate, &one, cells, &arguments);
    for &n in &arguments.sizes {
        let (block, one) =
            (Solid::block([1.0; 3], [n; 3], MATERIAL), Solid::block([1.0 / n as f64; 3], [1; 3], MATERIAL));
        solid::<f64, 3, 24>(&format!("block of {n}³ hex8, f64"), &block, &one, n, &arguments);
        solid::<f32, 3, 24>(&format!("block of {n}³ hex8, f32"), &block, &one, n, &arguments);
    }
}

/// A host whose force is a loop over its elements.
trait Elements<T>: Clone + Send + 'static {
    fn add_force(&self, u: &[T], out: &mut [T]);
}

/// A body of such elements with a lumped mass and constant loads.
#[derive(Clone)]
struct Host<T, E> {
    elements: E,
    mass: Vec<T>,
    /// One entry a dof, or none at all.
    load: Vec<T>,
    /// No entry: an explicit scheme never asks for a tangent.
    pattern: SymbolicSparseColMat<usize>,
}

impl<T: Real, E: Elements<T>> Host<T, E> {
    fn new(elements: E, mass: Vec<T>, load: Vec<T>) -> Self {
        let dofs = mass.len();
        let pattern = SymbolicSparseColMat::new_checked(dofs, dofs, vec![0; dofs + 1], None, Vec::new());
        Self { elements, mass, load, pattern }
    }
}

impl<T: Real, E: Elements<T>> System<T> for Host<T, E> {
    fn dofs(&self) -> usize {
        self.mass.len()
    }
    fn linearity(&self) -> Linearity {
        Linearity::Linear
    }
    fn mass(&self) -> Mass<'_, T> {
        Mass::Lumped(&self.mass)
    }
    fn force(&mut self, _t: f64, u: &[T], _v: &[T], out: &mut [T]) -> Result<()> {
        match self.load.is_empty() {
            true => out.fill(T::zero()),
            false => out.copy_from_slice(&self.load),
        }
        self.elements.add_force(u, out);
        Ok(())
    }
    fn pattern(&self) -> SymbolicSparseColMatRef<'_, usize> {
        self.pattern.as_ref()
    }
    fn tangent(&mut self, _t: f64, _u: &[T], _v: &[T], _w: TangentWeights<T>, _out: &mut [T]) -> Result<()> {
        unreachable!("an explicit scheme without damping needs none")
    }
}

/// Two bars, one behind the other.
#[derive(Clone, Copy)]
struct Rods<T> {
    elements: [usize; 2],
    /// EA/l of either.
    stiffness: [T; 2],
}

impl<T: Real> Elements<T> for Rods<T> {
    fn add_force(&self, u: &[T], out: &mut [T]) {
        let (left, right) = (self.elements[0] + 1, self.elements[1] + 1);
        let (first, second) = out.split_at_mut(left);
        for (k, u, out) in [(self.stiffness[0], &u[..left], first), (self.stiffness[1], &u[left..left + right], second)]
        {
            // The normal force of an element pulls at both its ends.
            let mut before = T::zero();
            for (ends, out) in u.windows(2).zip(out.iter_mut()) {
                let normal = k * (ends[1] - ends[0]);
                *out += normal - before;
                before = normal;
            }
            if let Some(last) = out.last_mut() {
                *last -= before;
            }
        }
    }
}

/// Elements of one shape with N dofs each.
#[derive(Clone)]
struct Alike<T, const N: usize> {
    dofs: Vec<[u32; N]>,
    /// Minus the stiffness of an element, column by column.
    minus: [[T; N]; N],
}

impl<T: Real, const N: usize> Alike<T, N> {
    /// Those of a mesh, all of them like `one`.
    fn new<const D: usize>(mesh: &Solid<D>, one: &Solid<D>) -> Self {
        let places = |element: &[usize]| -> [usize; N] { std::array::from_fn(|k| D * element[k / D] + k % D) };
        let (k, own) = (one.stiffness::<T>(), places(&one.elements[0]));
        let minus = own.map(|column| own.map(|row| -*k.as_ref().get(row, column).expect("a full matrix")));
        let narrow = |dof: usize| u32::try_from(dof).expect("a small mesh");
        Self { dofs: mesh.elements.iter().map(|element| places(element).map(narrow)).collect(), minus }
    }
}

impl<T: Real, const N: usize> Elements<T> for Alike<T, N> {
    fn add_force(&self, u: &[T], out: &mut [T]) {
        for dofs in &self.dofs {
            let mut force = [T::zero(); N];
            for (column, &dof) in self.minus.iter().zip(dofs) {
                let u = u[dof as usize];
                for (force, &entry) in force.iter_mut().zip(column) {
                    *force += entry * u;
                }
            }
            for (force, &dof) in force.into_iter().zip(dofs) {
                out[dof as usize] += force;
            }
        }
    }
}

fn chain<T: Real>(scalar: &str, n: usize, arguments: &Arguments) {
    let bars = Bars::paper(n);
    // 0.9 of the critical step.
    let h = 0.9 * bars.element_size(0) / 100.0;
    let stiffness = [0, 1].map(|bar| T::of(bars.young[bar] * bars.area / bars.element_size(bar)));
    let rods = Rods { elements: bars.elements, stiffness };
    let dofs = bars.dofs();
    // Statically compressed by forces at the far ends: u falls linearly from there to the contact.
    let ends = 1.0;
    let load: Vec<T> = (0..dofs)
        .map(|i| {
            T::of(if i == 0 {
                ends
            } else if i + 1 == dofs {
                -ends
            } else {
                0.0
            })
        })
        .collect();
    let [left, right] = bars.contact_dofs();
    let shortening = ends / (bars.young[0] * bars.area) * bars.element_size(0);
    let u: Vec<T> = (0..dofs)
        .map(|i| T::of(if i <= left { shortening * (left - i) as f64 } else { -shortening * (i - right) as f64 }))
        .collect();
    let contact = LinearRows::new().unilateral(&[(left, -T::one()), (right, T::one())], T::zero());
    let free = Host::new(rods, bars.lumped_mass::<T>(), Vec::new());
    let pressed = Host::new(rods, bars.lumped_mass::<T>(), load);
    let scene = Scene { free, pressed, u, v: wave(dofs), contacts: vec![contact], h };
    println!("two bars of {n} elements, {dofs} dofs, {scalar}");
    table(scene, Unit::Micro, arguments.repeated(6_000_000 / n).clamp(1, 60), arguments.repeated(200_000 / n));
}

fn solid<T: Real, const D: usize, const N: usize>(
    name: &str,
    mesh: &Solid<D>,
    one: &Solid<D>,
    cells: usize,
    arguments: &Arguments,
) {
    let h = 0.3 / cells as f64 / MATERIAL.wave_speed();
    let dofs = mesh.dofs();
    let elements = Alike::<T, N>::new(mesh, one);
    let mass = mesh.lumped_mass::<T>();
    let weight = (0..dofs).map(|dof| if dof % D == D - 1 { T::of(-1e-3) * mass[dof] } else { T::zero() }).collect();
    let floor: Vec<usize> = (0..mesh.nodes.len()).filter(|&node| mesh.nodes[node][D - 1] == 0.0).collect();
    let contact = |pressed: usize| {
        floor.iter().enumerate().fold(LinearRows::new(), |rows, (k, &node)| {
            // Evenly over the face; the other nodes are far above the floor.
            let touches = (k + 1) * pressed / floor.len() > k * pressed / floor.len();
            rows.unilateral(&[(Solid::<D>::dof(node, D - 1), T::one())], T::of(if touches { 0.0 } else { 1e3 }))
        })
    };
    let contacts = [1, 100].into_iter().filter(|&k| k < floor.len()).chain([floor.len()]).map(contact).collect();
    let free = Host::new(elements.clone(), mass.clone(), Vec::new());
    let pressed = Host::new(elements, mass, weight);
    let scene = Scene { free, pressed, u: vec![T::zero(); dofs], v: wave(dofs), contacts, h };
    println!("{name}, {dofs} dofs");
    table(scene, Unit::Milli, arguments.repeated(2_000_000 / dofs).clamp(1, 41), arguments.repeated(20_000 / dofs));
}

/// Velocities of some motion.
fn wave<T: Real>(dofs: usize) -> Vec<T> {
    (0..dofs).map(|i| T::of(1e-3 * (i as f64 * 0.1).sin())).collect()
}

struct Scene<T: Real, E> {
    free: Host<T, E>,
    pressed: Host<T, E>,
    /// Where the pressed body starts.
    u: Vec<T>,
    /// Velocities of the free one.
    v: Vec<T>,
    contacts: Vec<LinearRows<'static, T>>,
    h: f64,
}

fn table<T: Real, E: Elements<T>>(scene: Scene<T, E>, unit: Unit, samples: usize, calls: usize) {
    let Scene { free, pressed, u, v, contacts, h } = scene;
    let mut table = Table::new(unit, RATIOS);
    table.reference("force alone", timing::force(free.clone()));
    table.reference("force and one pass over the vectors", yardsticks::explicit_limit(free.clone(), h));
    let schemes: [fn() -> Box<dyn TimeIntegrator>; 2] = [|| Box::new(CentralDifference), || Box::new(CdLagrange)];
    for scheme in schemes {
        let builder = Simulation::builder(free.clone(), scheme(), h).velocity(v.clone());
        let mut run = builder.build().expect("a well-posed scene");
        table.row(format!("{}, free", scheme().name()), move || run.step().expect("a well-posed step"));
    }
    for contact in contacts {
        let builder = Simulation::builder(pressed.clone(), CdLagrange, h).displacement(u.clone()).constraint(contact);
        let mut run = builder.build().expect("a well-posed scene");
        for _ in 0..5 {
            run.step().expect("a well-posed step");
        }
        let closed = run.state().contacts().closed();
        let count = closed.iter().filter(|&&closed| closed).count();
        let name = format!("{}, {count} of {} contacts closed", CdLagrange.name(), closed.len());
        table.row(name, move || run.step().expect("a well-posed step"));
    }
    table.sample(samples, calls);
    table.print();
    println!();
}
