//! Paths in the repository and links between them, with `/` between names and without a file system.

/// A path of the repository that a link in one of its files leads to. None leads out of the repository.
pub fn target(file: &str, link: &str) -> Option<String> {
    let mut names: Vec<&str> = file.split('/').collect();
    names.pop();
    for name in link.split('/') {
        match name {
            "" | "." => {}
            ".." => drop(names.pop()?),
            name => names.push(name),
        }
    }
    Some(names.join("/"))
}

/// The link in one file that leads to another.
pub fn link(from: &str, to: &str) -> String {
    let mut from: Vec<&str> = from.split('/').collect();
    from.pop();
    let to: Vec<&str> = to.split('/').collect();
    let common = from.iter().zip(&to[..to.len() - 1]).take_while(|(a, b)| a == b).count();
    let mut names = vec![".."; from.len() - common];
    names.extend(&to[common..]);
    names.join("/")
}

/// What follows the last point of a file's name.
pub fn extension(file: &str) -> Option<&str> {
    Some(file.rsplit_once('.')?.1)
}

/// Path and fragment of a link to a file; None for a link with a scheme.
pub fn local(link: &str) -> Option<(&str, Option<&str>)> {
    let (path, fragment) = match link.split_once('#') {
        Some((path, fragment)) => (path, Some(fragment)),
        None => (link, None),
    };
    let scheme = path.split_once(':').is_some_and(|(scheme, _)| scheme.chars().all(|c| c.is_ascii_alphanumeric()));
    (!scheme).then_some((path, fragment))
}

#[cfg(test)]
mod tests {
    use super::{link, local, target};

    #[test]
    fn links_are_followed_and_made() {
        assert_eq!(target("docs/tutorials/bars.md", "../theory.md").as_deref(), Some("docs/theory.md"));
        assert_eq!(target("docs/start.md", "../README.md").as_deref(), Some("README.md"));
        assert_eq!(target("README.md", "../elsewhere.md"), None);
        for (from, to) in [("a/b.md", "c/d.md"), ("a.md", "b/c.md"), ("a/b/c.md", "a/d.md"), ("a/b.md", "a/b.md")] {
            assert_eq!(target(from, &link(from, to)).as_deref(), Some(to));
        }
        assert_eq!(link("a/b/c.md", "a/d.md"), "../d.md");
    }

    #[test]
    fn schemes_are_told_from_paths() {
        assert_eq!(local("https://docs.rs/faer#x"), None);
        assert_eq!(local("theory.md#5-contact"), Some(("theory.md", Some("5-contact"))));
        assert_eq!(local("#here"), Some(("", Some("here"))));
    }
}
