//! Tests of which some see more than others.

use sample::{overlooked, steps, sum, text};

#[test]
fn sums_are_exact() {
    assert_eq!(sum(&[1.0, 2.0]), 3.0);
    assert_eq!(text("a".into(), "b"), "ab");
}

#[test]
fn steps_are_counted() {
    assert_eq!(steps(3), 3);
}

#[test]
fn nothing_is_looked_at() {
    let _ = overlooked(2.0);
}
