//! The pages in `docs/` whose programs are compiled and run as documentation tests. The page of the errors is the
//! documentation of [`Error`](crate::Error) and is tested there.

/// Includes pages as documentation of items that exist only for doctests.
macro_rules! pages {
    ($($(#[$condition:meta])? $name:ident = $page:literal;)*) => {$(
        #[cfg(doctest)]
        $(#[$condition])?
        #[doc = include_str!(concat!("../", $page))]
        struct $name;
    )*};
}

pages! {
    Readme = "README.md";
    Start = "docs/start.md";
    Choosing = "docs/choosing.md";
    Energies = "docs/energies.md";
    #[cfg(feature = "mesh-contact")]
    ContactObstacles = "docs/contact/obstacles.md";
    #[cfg(feature = "mesh-contact")]
    ContactMeshes = "docs/contact/meshes.md";
    #[cfg(feature = "mesh-contact")]
    ContactTies = "docs/contact/ties.md";
    ComingFrom = "docs/coming_from.md";
    Friction = "docs/friction.md";
    Gradients = "docs/gradients.md";
    Performance = "docs/performance.md";
    Reduction = "docs/reduction.md";
    Bars = "docs/tutorials/bars.md";
    OwnSystem = "docs/tutorials/own_system.md";
    OwnConstraint = "docs/tutorials/own_constraint.md";
    OwnCorrector = "docs/tutorials/own_corrector.md";
    OwnIntegrator = "docs/tutorials/own_integrator.md";
    OwnLinearSolver = "docs/tutorials/own_linear_solver.md";
    BlockOnIncline = "docs/tutorials/friction.md";
    #[cfg(feature = "serde")]
    Restart = "docs/tutorials/restart.md";
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    /// README.md and all pages in docs/: their paths from the root of the package, and their texts.
    fn pages() -> Vec<(String, String)> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let (mut folders, mut files) = (vec![root.join("docs")], vec![root.join("README.md")]);
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                match path.is_dir() {
                    true => folders.push(path),
                    false => files.push(path),
                }
            }
        }
        let name = |path: &PathBuf| path.strip_prefix(root).unwrap().to_str().unwrap().replace('\\', "/");
        files.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
        files.iter().map(|path| (name(path), std::fs::read_to_string(path).unwrap())).collect()
    }

    /// Code blocks of a page: the info string after the opening marks, and the lines.
    fn blocks(text: &str) -> Vec<(String, Vec<&str>)> {
        let (mut blocks, mut open) = (Vec::new(), None);
        for line in text.lines() {
            match (line.trim_start().strip_prefix("```"), open.take()) {
                (Some(kind), None) => open = Some((kind.to_owned(), Vec::new())),
                (Some(_), Some(block)) => blocks.push(block),
                (None, Some((kind, mut lines))) => {
                    lines.push(line);
                    open = Some((kind, lines));
                }
                (None, None) => {}
            }
        }
        blocks
    }

    #[test]
    fn every_program_of_a_page_is_run_and_asserts() {
        let (here, errors) = (include_str!("book.rs"), include_str!("error.rs"));
        let mut programs = 0;
        for (page, text) in pages() {
            let rust: Vec<_> = blocks(&text).into_iter().filter(|(kind, _)| kind.starts_with("rust")).collect();
            let is_run = here.contains(&format!("= \"{page}\";")) || errors.contains(&format!("\"../{page}\""));
            assert!(rust.is_empty() || is_run, "{page} has Rust that nothing compiles: add it to src/book.rs");
            for (kind, lines) in rust {
                assert_eq!(kind, "rust", "{page}: a program that is not compiled and run");
                assert!(lines.iter().any(|line| line.contains("assert")), "{page} shows a program that cannot fail");
                programs += 1;
            }
        }
        assert!(programs > 20);
    }

    /// Whoever reads a page in the package finds the files that it names there, or is told that they are in the
    /// repository, as for the commands that need it.
    #[test]
    fn pages_say_which_files_and_commands_are_in_the_repository_alone() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let manifest = std::fs::read_to_string(root.join("Cargo.toml")).unwrap();
        let is_packaged = |path: &str| {
            let folder = path.starts_with("src/") || path.starts_with("docs/");
            (folder || manifest.contains(&format!("    \"{path}\",\n"))) && root.join(path).exists()
        };
        let folders = ["src/", "docs/", "examples/", "tests/", "benches/", "bindings/", ".ci/"];
        // A new project of the reader has its own src/main.rs.
        let is_path = |word: &str| {
            let is_inside = folders.iter().any(|folder| word.starts_with(folder));
            is_inside && !word.contains([' ', '*']) && word != "src/main.rs"
        };
        let flags = ["--example", "--bench", "--test", "--workspace", " -p "];
        let mut said = 0;
        for (page, text) in pages() {
            let visible: String = text.split("<!--").map(|part| part.rsplit("-->").next().unwrap_or("")).collect();
            let words = visible.split_whitespace().collect::<Vec<_>>().join(" ");
            let paths = words.split('`').skip(1).step_by(2).filter(|word| is_path(word) && !is_packaged(word));
            let is_command = |line: &&str| line.contains("cargo ") && flags.iter().any(|flag| line.contains(flag));
            let commands = visible.lines().filter(is_command);
            let needing: Vec<_> = paths.chain(commands).collect();
            let says = ["in the repository", "In the repository", "In a checkout", "in a checkout"];
            assert!(needing.is_empty() || says.iter().any(|say| words.contains(say)), "{page}: {needing:?}");
            said += usize::from(!needing.is_empty());
        }
        assert!(said > 10);
    }

    /// Rustdoc would compile an unmarked block of these pages as Rust.
    #[test]
    fn blocks_of_pages_say_what_they_are() {
        let here = include_str!("book.rs");
        for (page, text) in pages().iter().filter(|(page, _)| here.contains(&format!("= \"{page}\";"))) {
            assert!(blocks(text).iter().all(|(kind, _)| !kind.is_empty()), "{page}");
        }
    }

    #[test]
    fn tutorials_are_short() {
        let mut tutorials = 0;
        for (page, text) in pages().iter().filter(|(page, _)| page.starts_with("docs/tutorials/")) {
            for (_, lines) in blocks(text).iter().filter(|(kind, _)| kind == "rust") {
                assert!(lines.len() < 60, "{page}: {} lines", lines.len());
                assert!(!lines.iter().any(|line| line.starts_with("# ")), "{page} hides lines");
                tutorials += 1;
            }
        }
        assert!(tutorials >= 8);
    }
}
