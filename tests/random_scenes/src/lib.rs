//! Random scenes from seeds: `rows` draws bodies with rows of contact, `surfaces` bodies whose surfaces meet. Not
//! published.

pub mod rows;
pub mod surfaces;

pub use rows::Nonlinear;
