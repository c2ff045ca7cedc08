//! Functions whose mutants have known ends.

/// Seen by a test.
pub fn sum(numbers: &[f64]) -> f64 {
    let mut total = 0.0;
    for number in numbers {
        total += number;
    }
    total
}

/// Ends for no other step than one: a test is late.
pub fn steps(mut rest: u64) -> u64 {
    let mut count = 0;
    while rest != 0 {
        rest = rest.wrapping_sub(1);
        count += 1;
    }
    count
}

/// Called by no test.
pub fn forgotten(x: f64) -> f64 {
    -x
}

/// Called by a test that looks at nothing.
pub fn overlooked(x: f64) -> bool {
    x > 3.0
}

/// A sign that cannot be turned.
pub fn text(one: String, other: &str) -> String {
    one + other
}
