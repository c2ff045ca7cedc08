//! The rooms of the sources, and where the tests of each are.

/// Files that belong together.
pub struct Room {
    pub name: &'static str,
    /// Files and folders, below `src/`, without `.rs`; a star stands for the rest of a name.
    files: &'static [&'static str],
    /// Test binaries that look at this room in the first place; unit tests, `lib`, are always among them.
    tests: &'static [&'static str],
}

/// A file belongs to the first room that has it.
pub const ROOMS: [Room; 17] = [
    Room { name: "contact solver", files: &["contact_solver"], tests: &["contact_solver", "friction"] },
    Room { name: "corrections", files: &["corrector"], tests: &["corrector"] },
    Room {
        name: "contact step",
        files: &[
            "simulation/rows",
            "simulation/stage/contact",
            "simulation/build/admitted",
            "simulation/start/overclosures",
            "simulation/start/rate_check",
            "simulation/step/jumps",
            "simulation/operator/interface",
            "simulation/operator/contact_path",
            "simulation/operator/responses",
            "simulation/operator/delassus",
        ],
        tests: &["simulation", "contact"],
    },
    Room {
        name: "stages, Newton",
        files: &[
            "simulation/stage/newton*",
            "simulation/stage/vectors",
            "simulation/stage/linear",
            "simulation/stage/path",
            "simulation/stage/supports",
            "simulation/step/finite",
            "simulation/operator",
            "simulation/build",
            "system",
        ],
        tests: &["simulation", "system"],
    },
    Room { name: "changes of the step", files: &["simulation/step", "simulation/run/advance"], tests: &["simulation"] },
    Room {
        name: "state, history, clock",
        files: &["state", "simulation/start/past"],
        tests: &["simulation", "checkpoint"],
    },
    Room {
        name: "starts, dofs without mass",
        files: &["simulation/start", "simulation/stage"],
        tests: &["simulation"],
    },
    Room { name: "energy, stability", files: &["simulation/watch", "simulation/run"], tests: &["simulation"] },
    Room { name: "schemes, analysis", files: &["integrator", "tableau", "analysis"], tests: &["integrator"] },
    Room { name: "mass", files: &["mass"], tests: &["mass"] },
    Room { name: "surfaces", files: &["contact/surface"], tests: &["contact"] },
    Room { name: "mortar", files: &["contact/mortar"], tests: &["contact"] },
    Room {
        name: "nodes on facets, edges",
        files: &["contact/node_to_facet", "contact/edge_to_edge", "contact/body_contact"],
        tests: &["contact"],
    },
    Room { name: "obstacles, rows, laws, ties", files: &["contact"], tests: &["contact", "friction"] },
    Room {
        name: "linear solvers",
        files: &["linear_solver", "kernels", "sparse", "dense"],
        tests: &["linear_solver", "threads"],
    },
    Room { name: "reduction", files: &["reduction"], tests: &["reduction"] },
    Room { name: "partitioned", files: &["partitioned"], tests: &["partitioned"] },
];

/// The one room of `sample`, the package on which this program is tested.
pub const SAMPLE: [Room; 1] = [Room { name: "sample", files: &["lib"], tests: &["sums"] }];

impl Room {
    /// Whether a file, relative to the folder of the package, is of this room.
    pub fn has(&self, path: &str) -> bool {
        let Some(file) = path.strip_prefix("src/").and_then(|file| file.strip_suffix(".rs")) else {
            return false;
        };
        self.files.iter().any(|own| match own.strip_suffix('*') {
            Some(start) => file.starts_with(start),
            None => file == *own || file.strip_prefix(own).is_some_and(|rest| rest.starts_with('/')),
        })
    }

    pub fn tests_with(&self, binary: &str) -> bool {
        binary == "lib" || self.tests.contains(&binary)
    }
}
