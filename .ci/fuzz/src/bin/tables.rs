//! Files of `from-matrices` (Matrix Market and CSV) with bytes changed: refused with a sentence, or run.

#![no_main]

use clap::Parser;
use from_matrices::options::Options;
use fuzz::{Input, folder};
use libfuzzer_sys::fuzz_target;

const FILES: [(&str, &str); 7] = [
    ("mass", "%%MatrixMarket matrix coordinate real symmetric\n4 4 4\n1 1 1.0\n2 2 1.0\n3 3 2.0\n4 4 2.0\n"),
    (
        "stiffness",
        "%%MatrixMarket matrix coordinate real general\n% a comment\n4 4 6\n1 1 9\n3 3 9\n1 3 -4e0\n3 1 -4\n2 2 1\n4 4 1\n",
    ),
    ("contacts", "node,dofs,normal,gap,friction\nfoot,1 2,0 1,0.05,0.3\nhead,3 4,0 1,0.1,0\n"),
    ("initial", "dof,u,v\n1,0,1\n2,0,-1\n4,0.01,-2\n"),
    ("load", "time,dof,force\n0,2,-1\n0.1,2,-2\n0,4,-1\n"),
    ("supports", "dof\n3\n"),
    ("damping", "%%MatrixMarket matrix array real general\n4 4\n1\n0\n0\n0\n0\n1\n0\n0\n0\n0\n1\n0\n0\n0\n0\n1\n"),
];

fuzz_target!(|bytes: &[u8]| {
    let mut input = Input(bytes);
    let folder = folder();
    let mut arguments: Vec<_> =
        ["from-matrices", "--step", "0.05", "--end", "0.2", "--output"].map(String::from).into();
    arguments.push(folder.join("out").display().to_string());
    for (k, (name, text)) in FILES.into_iter().enumerate() {
        // The first three are needed.
        if k >= 3 && !input.flag() {
            continue;
        }
        let path = folder.join(name);
        let file = if input.below(3) == 0 { input.edited(text.as_bytes()) } else { text.as_bytes().to_vec() };
        std::fs::write(&path, file).expect("a file");
        arguments.extend([format!("--{name}"), path.display().to_string()]);
    }
    if input.flag() {
        arguments.push("--lump".into());
    }
    if input.flag() {
        let schemes = ["central-difference", "composite", "bathe", "moreau-jean", "nonsense"];
        arguments.extend(["--scheme".into(), schemes[input.below(schemes.len())].into()]);
    }
    if input.flag() {
        let recorded = ["all", "1,3-4", "4-1", "0", "9-", "-", "1,,2"];
        arguments.push(format!("--record={}", recorded[input.below(recorded.len())]));
    }
    if input.flag() {
        arguments.push(format!("--every={}", input.byte()));
    }
    if input.below(4) == 0 {
        arguments.push(format!("--gravity={},{}", input.number(), input.number()));
    }
    if let Ok(options) = Options::try_parse_from(arguments) {
        if let Err(refusal) = from_matrices::answer(&options) {
            assert!(!refusal.to_string().is_empty());
        }
    }
});
