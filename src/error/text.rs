//! Parts of messages: rounded numbers, and remedies that depend on the case.

/// The text for a number of bytes.
pub(super) fn bytes_requested(bytes: Option<usize>) -> String {
    bytes.map_or_else(String::new, |bytes| format!(": {bytes} bytes were asked for"))
}

/// A number as printed in messages: four significant digits.
pub(crate) fn few(x: f64) -> f64 {
    rounded(x, 3)
}

/// A time as printed in messages: nine significant digits, enough to distinguish steps.
pub(super) fn moment(t: f64) -> f64 {
    rounded(t, 8)
}

fn rounded(x: f64, decimals: usize) -> f64 {
    format!("{x:.decimals$e}").parse().ok().filter(|rounded: &f64| rounded.is_finite()).unwrap_or(x)
}

/// The remedy for an indefinite tangent in this iteration.
pub(super) fn tangent_remedy(iteration: usize) -> &'static str {
    match iteration {
        1 => {
            "nothing has moved yet: check the sign of the tangent with `verify::tangent`; if it is right, take smaller \
             steps"
        }
        _ => "the stiffness there is too negative for this step; take smaller steps",
    }
}
