//! The laws of all rows, and their common properties: a phase that no law needs costs nothing.

use crate::contact::ContactLaw;

/// The laws of the rows, in their order.
#[derive(Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each of them is a question of its own")]
pub(crate) struct Laws {
    list: Vec<ContactLaw>,
    /// Whether the condition of any row depends on the gap at the start of the stage.
    pub(crate) read_start: bool,
    /// Whether any row is compliant, predictive, or compliant with inertia.
    pub(crate) compliant: bool,
    pub(crate) predictive: bool,
    pub(crate) inertial: bool,
    /// Whether the force of any row depends on the rate of its gap.
    pub(crate) damped: bool,
    /// Whether any row rebounds.
    pub(crate) rebound: bool,
    /// Whether any row is bilateral.
    pub(crate) equality: bool,
    /// The largest number of augmentations of a row.
    pub(crate) augmentations: usize,
}

impl Laws {
    /// Forgets all rows.
    pub(crate) fn clear(&mut self) {
        *self = Self { list: std::mem::take(&mut self.list), ..Self::default() };
        self.list.clear();
    }

    /// Appends the law of a row.
    pub(crate) fn push(&mut self, law: ContactLaw) {
        self.list.push(law);
        self.read_start |= law.reads_start();
        self.compliant |= law.is_compliant();
        self.predictive |= law.is_predictive();
        self.inertial |= law.inertia() != 0.0;
        self.damped |= law.is_damped();
        self.rebound |= law.rebounds();
        self.equality |= law.is_equality();
        self.augmentations = self.augmentations.max(law.augmentations());
    }

    /// Whether every row constrains the quantity of the scheme, with the weight of d of the scheme.
    pub(crate) fn are_uniform(&self) -> bool {
        !self.compliant && !self.read_start
    }
}

impl std::ops::Deref for Laws {
    type Target = [ContactLaw];

    fn deref(&self) -> &[ContactLaw] {
        &self.list
    }
}
