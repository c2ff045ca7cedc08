//! Whether KaTeX takes the formulas of pages and of doc comments.

use crate::markdown::{self, Formula};
use katex::{KatexContext, Settings};

/// Why KaTeX refuses formulas, with the line of each.
pub fn refused(formulas: &[Formula]) -> Vec<(usize, String)> {
    let context = KatexContext::default();
    let settings = Settings::builder().display_mode(true).throw_on_error(true).build();
    let refusal = |formula: &Formula| {
        let error = katex::render_to_string(&context, &formula.latex, &settings).err()?;
        Some((formula.line, error.to_string()))
    };
    formulas.iter().filter_map(refusal).collect()
}

/// The formulas in the doc comments of a Rust file.
pub fn of_source(text: &str) -> Vec<Formula> {
    // Lines of code become empty ones: lines keep their numbers.
    let comment = |line: &str| {
        let line = line.trim_start();
        let comment = line.strip_prefix("///").or_else(|| line.strip_prefix("//!")).unwrap_or_default();
        comment.strip_prefix(' ').unwrap_or(comment).to_string() + "\n"
    };
    markdown::read(&text.lines().map(comment).collect::<String>()).formulas
}

#[cfg(test)]
mod tests {
    use super::{of_source, refused};

    #[test]
    fn wrong_formulas_are_found_in_sources() {
        let good = "/// ```math\n/// \\begin{align*} a &= \\frac12 \\tag{12'} \\end{align*}\n/// ```\nfn f() {}\n";
        assert!(refused(&of_source(good)).is_empty());
        let bad = good.replace("frac12", "frak{");
        let refused = refused(&of_source(&bad));
        assert_eq!(refused.len(), 1);
        assert_eq!(refused[0].0, 1);
    }
}
