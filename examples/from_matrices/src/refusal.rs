//! What is wrong with an input, in a sentence for the one who gave it.

use contact_dynamics::Error;
use contact_dynamics::contact::ContactId;
use std::fmt::{Display, Formatter};
use std::path::Path;

/// A sentence that says what is wrong, where, and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal(String);

pub type Result<T> = std::result::Result<T, Refusal>;

impl Display for Refusal {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refusal {}

impl Refusal {
    pub fn new(sentence: impl Into<String>) -> Self {
        Self(sentence.into())
    }

    /// About a file as a whole.
    pub fn of(path: &Path, what: impl Display) -> Self {
        Self(format!("{}: {what}", path.display()))
    }

    /// About a line of a file, counted from 1.
    pub fn at(path: &Path, line: u64, what: impl Display) -> Self {
        Self(format!("{}, line {line}: {what}", path.display()))
    }

    /// What the crate refuses. It counts dofs from 0, and knows contacts by their place in the table.
    pub fn by_crate(error: &Error, name: impl Fn(usize) -> Option<String>) -> Self {
        let contact = contact_of(error)
            .and_then(|id| name(id.feature))
            .map_or(String::new(), |name| format!("; the contact is {name}"));
        Self(format!("{error}{contact} (in this message dofs, rows and columns count from 0)"))
    }
}

/// The contact that an error names, if it names one.
fn contact_of(error: &Error) -> Option<ContactId> {
    match error {
        Error::EmptyContact { contact }
        | Error::ContradictoryContacts { contact, .. }
        | Error::Jammed { contact, .. }
        | Error::Contact { contact, .. }
        | Error::ContactUnsettled { contact, .. }
        | Error::InitialViolation { contact, .. }
        | Error::ContactNotFinite { contact, .. } => Some(*contact),
        _ => None,
    }
}
