//! Compiles the C side with the compiler wrapper of the MPI that is installed, and links MUMPS.

use std::env::var;
use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=src/shim.c");
    println!("cargo::rerun-if-env-changed=MPICC");
    let mpicc = var("MPICC").unwrap_or_else(|_| "mpicc".into());
    let out = var("OUT_DIR").expect("cargo sets it");
    let object = Path::new(&out).join("shim.o");
    run(Command::new(&mpicc).args(["-c", "-O2", "-fPIC", "-Wall", "-Wextra", "src/shim.c", "-o"]).arg(&object));
    run(Command::new("ar").arg("crs").arg(Path::new(&out).join("libshim.a")).arg(&object));
    println!("cargo::rustc-link-search=native={out}");
    println!("cargo::rustc-link-lib=static=shim");
    println!("cargo::rustc-link-lib=dmumps");
    // What the wrapper links a program with: `-show` is understood by Open MPI and MPICH.
    let shown = Command::new(&mpicc).arg("-show").output().expect("the compiler wrapper of MPI");
    for word in String::from_utf8_lossy(&shown.stdout).split_whitespace() {
        if let Some(folder) = word.strip_prefix("-L") {
            println!("cargo::rustc-link-search=native={folder}");
        } else if let Some(library) = word.strip_prefix("-l") {
            println!("cargo::rustc-link-lib={library}");
        }
    }
}

fn run(command: &mut Command) {
    let status = command.status().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(status.success(), "{command:?} failed: are libmumps-dev and an MPI installed?");
}
