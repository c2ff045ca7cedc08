//! The tables of `docs/schemes.md` are those that the code prints.

#[allow(clippy::pedantic, reason = "numerics, with the lints of tests/scenes")]
#[path = "../../examples/schemes/tables.rs"]
mod tables;

const PAGE: &str = include_str!("../../docs/schemes.md");

#[test]
fn tables_of_the_page_are_those_of_the_code() {
    for table in [tables::accuracy(), tables::conservation()] {
        for line in table.lines() {
            assert!(PAGE.lines().any(|written| written == line), "docs/schemes.md lacks this line:\n{line}");
        }
    }
}

/// Corrected runs only: raw ones of schemes without damping are chaotic, and other processors sum in another order.
#[test]
fn contact_figures_of_the_page_are_those_of_the_code() {
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect::<Vec<_>>();
    let section = PAGE.split("## 3.").nth(1).unwrap().split("## 4.").next().unwrap();
    let computed = tables::contact();
    for line in computed.lines().skip(2) {
        let computed = cells(line);
        let written = section.lines().map(cells).find(|row| row[0] == computed[0]).expect(&computed[0]);
        for (written, computed) in written[4..].iter().zip(&computed[4..]).filter(|(_, computed)| *computed != "–") {
            let number = |text: &String| text.parse::<f64>().unwrap();
            assert!((number(written) / number(computed) - 1.0).abs() < 0.03, "{line}: {written}");
        }
    }
}
