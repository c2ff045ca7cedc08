//! Vectors of the plane and of space.

/// x − y.
pub fn minus<const D: usize>(x: [f64; D], y: [f64; D]) -> [f64; D] {
    std::array::from_fn(|i| x[i] - y[i])
}

/// x + c y.
pub fn along<const D: usize>(x: [f64; D], c: f64, y: [f64; D]) -> [f64; D] {
    std::array::from_fn(|i| x[i] + c * y[i])
}

pub fn dot<const D: usize>(x: [f64; D], y: [f64; D]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

pub fn norm<const D: usize>(x: [f64; D]) -> f64 {
    dot(x, x).sqrt()
}

pub fn cross(x: [f64; 3], y: [f64; 3]) -> [f64; 3] {
    [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
}
