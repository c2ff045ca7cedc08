//! All mutants of a file in one text: `if crate::mutant::is(7) { mutated } else { original }`.

use crate::find::{Form, Mutant};
use std::ops::Range;

/// Where a mutant is in the text that was written.
pub struct Place {
    pub number: usize,
    /// With both branches.
    pub whole: Range<usize>,
    /// The branch that is mutated.
    pub mutated: Range<usize>,
}

/// Writes mutants, which have their numbers, into the text of a file.
pub fn write(text: &str, mutants: &[(usize, &Mutant)]) -> (String, Vec<Place>) {
    let mut sorted = mutants.to_vec();
    // From the outer to the inner ones.
    sorted.sort_by_key(|(number, mutant)| (mutant.range.start, usize::MAX - mutant.range.end, *number));
    let mut writer = Writer { text, written: String::new(), places: Vec::new() };
    writer.fill(0..text.len(), &sorted);
    (writer.written, writer.places)
}

struct Writer<'t> {
    text: &'t str,
    written: String,
    places: Vec<Place>,
}

impl Writer<'_> {
    /// Writes a range of the text with the mutants that are within it.
    fn fill(&mut self, range: Range<usize>, mutants: &[(usize, &Mutant)]) {
        let (mut at, mut rest) = (range.start, mutants);
        while let Some(((number, mutant), others)) = rest.split_first() {
            let inner = others.iter().take_while(|(_, inner)| inner.range.start < mutant.range.end).count();
            self.written.push_str(&self.text[at..mutant.range.start]);
            self.wrap(*number, mutant, &others[..inner]);
            at = mutant.range.end;
            rest = &others[inner..];
        }
        self.written.push_str(&self.text[at..range.end]);
    }

    fn wrap(&mut self, number: usize, mutant: &Mutant, inner: &[(usize, &Mutant)]) {
        let start = self.written.len();
        let mutated = match mutant.form {
            Form::Expression => {
                self.written.push_str(&format!("(if crate::mutant::is({number}) {{ "));
                let from = self.written.len();
                self.written.push_str(&mutant.mutated);
                let mutated = from..self.written.len();
                self.written.push_str(" } else { ");
                self.fill(mutant.range.clone(), inner);
                self.written.push_str(" })");
                mutated
            }
            Form::Statement => {
                self.written.push_str(&format!("if !crate::mutant::is({number}) {{ "));
                self.fill(mutant.range.clone(), inner);
                self.written.push_str(" }");
                start..start
            }
        };
        self.places.push(Place { number, whole: start..self.written.len(), mutated });
    }
}

/// The mutant that an error at a place of the written text comes from: the one whose mutated branch has it, else the
/// innermost around it, else the nearest.
pub fn culprit(places: &[Place], at: &Range<usize>) -> Option<usize> {
    let within = |range: &Range<usize>| range.start <= at.start && at.end <= range.end;
    let distance = |range: &Range<usize>| range.start.saturating_sub(at.end).max(at.start.saturating_sub(range.end));
    let innermost = |key: fn(&Place) -> &Range<usize>| {
        places.iter().filter(|place| within(key(place))).min_by_key(|place| key(place).len())
    };
    let found = innermost(|place| &place.mutated).or_else(|| innermost(|place| &place.whole));
    found.or_else(|| places.iter().min_by_key(|place| distance(&place.whole))).map(|place| place.number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::find;

    #[test]
    fn nested_mutants_stand_in_the_original_branch() {
        let text = "fn f() { let x = a + 1; }";
        let all = find::mutants("src/f.rs", text).expect("code");
        let numbered: Vec<_> = all.iter().enumerate().map(|(at, mutant)| (at + 1, mutant)).collect();
        let (written, places) = write(text, &numbered);
        let sum = "(if crate::mutant::is(1) { (a) - (1) } else { a + (if crate::mutant::is(2) { 2 } else { 1 }) })";
        assert_eq!(written, format!("fn f() {{ let x = {sum}; }}"));
        let at = |what: &str| {
            let start = written.find(what).expect(what);
            culprit(&places, &(start..start + what.len()))
        };
        assert_eq!([at("(a)"), at("{ 2 }"), at("a +"), at("fn")], [Some(1), Some(2), Some(1), Some(1)]);
    }

    #[test]
    fn statements_are_left_out() {
        let text = "fn f() { g(); }";
        let all = find::mutants("src/f.rs", text).expect("code");
        let (written, _) = write(text, &[(3, &all[0])]);
        assert_eq!(written, "fn f() { if !crate::mutant::is(3) { g(); } }");
    }
}
