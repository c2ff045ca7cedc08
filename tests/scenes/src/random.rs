//! Numbers for random scenes, the same in every run.

/// Numbers in [0, 1) from a seed that is not zero (xorshift of Marsaglia, J. Stat. Softw. 8, 2003).
pub fn xorshift(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        (seed >> 11) as f64 / (1_u64 << 53) as f64
    }
}
