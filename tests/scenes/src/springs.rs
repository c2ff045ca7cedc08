//! The stiff–soft springs of Bathe and Noh (Comput. Struct. 98–99, 2012).

use contact_dynamics::LinearSystem;
use contact_dynamics::faer::sparse::{SparseColMat, Triplet};

/// Frequency with which the support is driven.
pub const FREQUENCY: f64 = 1.2;

/// A driven dof without mass, a spring of 10⁷ to a unit mass, a spring of 1 to another unit mass.
pub fn stiff_soft() -> LinearSystem<'static, f64> {
    let (stiff, soft) = (1e7, 1.0);
    let entries = [
        (0, 0, stiff),
        (0, 1, -stiff),
        (1, 0, -stiff),
        (1, 1, stiff + soft),
        (1, 2, -soft),
        (2, 1, -soft),
        (2, 2, soft),
    ];
    let triplets = entries.map(|(i, j, k)| Triplet::new(i, j, k));
    let k = SparseColMat::try_new_from_triplets(3, 3, &triplets).unwrap();
    let drive = |t: f64| {
        let (sin, cos) = (FREQUENCY * t).sin_cos();
        [sin, FREQUENCY * cos, -FREQUENCY * FREQUENCY * sin]
    };
    LinearSystem::lumped(vec![0.0, 1.0, 1.0], k).unwrap().drive(0, drive).unwrap()
}
