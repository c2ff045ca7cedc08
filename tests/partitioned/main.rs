//! Bodies factorized on their own, and bodies in codes of their own, against the monolithic form.

mod assemblies;
mod body;
mod by_body;
mod many;
mod scene;
