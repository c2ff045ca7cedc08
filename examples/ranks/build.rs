//! Compiles the C side with the compiler wrapper of the MPI that is installed, and links MUMPS, and PETSc if asked for.

use std::env::{var, var_os};
use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=src/c");
    println!("cargo::rerun-if-env-changed=MPICC");
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    let mpicc = var("MPICC").unwrap_or_else(|_| "mpicc".into());
    let out = var("OUT_DIR").expect("cargo sets it");
    let petsc = var_os("CARGO_FEATURE_PETSC").map(|_| {
        let mut asked = Command::new("pkg-config");
        shown(asked.args(["--cflags", "--libs", "PETSc"]))
    });
    let mut archive = Command::new("ar");
    archive.arg("crs").arg(Path::new(&out).join("libshim.a"));
    let parts = [Some("mpi"), Some("mumps"), petsc.as_ref().map(|_| "petsc")];
    for part in parts.into_iter().flatten() {
        let object = Path::new(&out).join(part).with_extension("o");
        let mut compiler = Command::new(&mpicc);
        compiler.args(["-c", "-O2", "-fPIC", "-Wall", "-Wextra"]);
        let headers = petsc.iter().flat_map(|flags| flags.split_whitespace()).filter(|flag| flag.starts_with("-I"));
        run(compiler.args(headers).arg(format!("src/c/{part}.c")).arg("-o").arg(&object));
        archive.arg(&object);
    }
    run(&mut archive);
    println!("cargo::rustc-link-search=native={out}");
    println!("cargo::rustc-link-lib=static=shim");
    println!("cargo::rustc-link-lib=dmumps");
    if let Some(flags) = &petsc {
        link(flags);
    }
    // What the wrapper links a program with: `-show` is understood by Open MPI and MPICH.
    link(&shown(Command::new(&mpicc).arg("-show")));
}

/// Tells cargo the libraries among the flags of a linker.
fn link(flags: &str) {
    for word in flags.split_whitespace() {
        if let Some(folder) = word.strip_prefix("-L") {
            println!("cargo::rustc-link-search=native={folder}");
        } else if let Some(library) = word.strip_prefix("-l") {
            println!("cargo::rustc-link-lib={library}");
        }
    }
}

/// What a command prints.
fn shown(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?} failed: is what it looks for installed?");
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn run(command: &mut Command) {
    let status = command.status().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(status.success(), "{command:?} failed: are libmumps-dev and an MPI installed?");
}
