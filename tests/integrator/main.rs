//! Schemes: order, stability, accuracy and momentum, against the literature and `docs/schemes.md`.

mod bathe_forms;
mod explicit_contact;
mod momentum;
mod order;
mod ranges;
mod schemes_page;
mod spectral;
mod stiff_soft;
