//! Bodies factorized on their own, and bodies in codes of their own that meet at a frame, against the monolithic form.

mod assemblies;
mod body;
mod by_body;
mod frames;
mod many;
mod scene;
