//! Models with exact solutions as input files, so that a user sees the formats.

use crate::matrix_market::{diagonal, symmetric};
use crate::options::Options;
use crate::output::Summary;
use crate::refusal::{Refusal, Result};
use clap::{Parser, ValueEnum};
use contact_dynamics_bars::reference::{Bar, CollidingBars};
use std::fmt::Write;
use std::path::Path;

/// Which model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Demo {
    /// An elastic bar flies against a rigid wall: consistent mass, a coordinate file.
    Bar,
    /// Two elastic bars collide: lumped mass, an array; a contact of two nodes.
    Bars,
    /// A block slides over a floor until friction has stopped it: gravity and friction.
    Slide,
}

/// Axial stiffness EA, mass per length ρA, length and speed of the bars, their distance from what they meet.
const AXIAL: f64 = 25.0;
const LINE_MASS: f64 = 0.0025;
const LENGTH: f64 = 10.0;
const SPEED: f64 = 0.05;
const GAP: f64 = 0.005;

/// The block: mass, gravity, friction coefficient, speed at the start.
const MASS: f64 = 2.0;
const GRAVITY: f64 = 10.0;
const FRICTION: f64 = 0.25;
const SLIDING: f64 = 1.0;

/// Input files, the options of the command line besides theirs, and the exact normal force and friction.
struct Scene {
    files: Vec<(&'static str, String)>,
    options: &'static [&'static str],
    exact: Box<dyn Fn(f64) -> [f64; 2]>,
}

impl Demo {
    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bar => "bar",
            Self::Bars => "bars",
            Self::Slide => "slide",
        }
    }

    /// Writes the input files and returns the arguments of the run.
    pub fn write(self, directory: &Path, quick: bool) -> Result<Vec<String>> {
        std::fs::create_dir_all(directory)
            .map_err(|error| Refusal::of(directory, format!("the directory cannot be made: {error}")))?;
        let scene = self.scene(quick);
        let mut arguments = Vec::new();
        for (name, content) in &scene.files {
            let path = directory.join(name);
            std::fs::write(&path, content)
                .map_err(|error| Refusal::of(&path, format!("cannot be written: {error}")))?;
            let option = name.split('.').next().unwrap_or_default();
            arguments.extend([format!("--{option}"), path.display().to_string()]);
        }
        arguments.extend(scene.options.iter().map(ToString::to_string));
        Ok(arguments)
    }

    /// Writes, runs and compares with the exact solution.
    pub fn demonstrate(self, directory: &Path, quick: bool) -> Result<String> {
        let directory = directory.join(self.name());
        let mut arguments = self.write(&directory, quick)?;
        arguments.extend(["--output".to_string(), directory.display().to_string()]);
        let options = Options::try_parse_from(std::iter::once("from-matrices".to_string()).chain(arguments))
            .map_err(|error| Refusal::new(error.to_string()))?;
        let summary = crate::run::run(&options)?;
        let mut text = format!("{}: {}\n", self.name(), self.title());
        let _ = writeln!(text, "{summary}");
        for line in self.compare(&summary, quick) {
            let _ = writeln!(text, "{line}");
        }
        Ok(text)
    }

    fn title(self) -> &'static str {
        match self {
            Self::Bar => "an elastic bar flies against a rigid wall",
            Self::Bars => "two elastic bars collide",
            Self::Slide => "a block slides over a floor until friction has stopped it",
        }
    }

    /// What the forces of a run miss of the exact ones, in sentences.
    pub fn compare(self, summary: &Summary, quick: bool) -> Vec<String> {
        let scene = self.scene(quick);
        let mut lines = Vec::new();
        for (kind, name) in ["normal force", "friction"].into_iter().enumerate() {
            let exact = |t: f64| (scene.exact)(t)[kind];
            let top = summary.forces.iter().fold(0.0, |top: f64, (t, _)| top.max(exact(*t)));
            if top == 0.0 {
                continue;
            }
            let pressed: Vec<_> = summary.forces.iter().filter(|(t, _)| exact(*t) > 0.0).collect();
            let squares: f64 = pressed.iter().map(|(t, forces)| (forces[kind] - exact(*t)).powi(2)).sum();
            let error = (squares / pressed.len() as f64).sqrt() / top;
            let largest = summary.forces.iter().fold(0.0, |most: f64, (_, forces)| most.max(forces[kind])) / top;
            lines.push(format!(
                "{name} against the exact one: RMS error {:.2} % of {top:.6} while there is one; the largest is \
                 {largest:.3} times that",
                100.0 * error
            ));
        }
        lines
    }

    fn scene(self, quick: bool) -> Scene {
        match self {
            Self::Bar => bar(if quick { 20 } else { 100 }),
            Self::Bars => bars(if quick { 20 } else { 50 }),
            Self::Slide => slide(),
        }
    }
}

fn end_bar(velocity: f64) -> Bar {
    Bar { young: AXIAL, density: LINE_MASS, area: 1.0, length: LENGTH, velocity }
}

/// The lower triangle of bars of so many elements each, one behind the other, unconnected, from the entries of an
/// element.
fn chain(bars: usize, elements: usize, [diagonal, off]: [f64; 2]) -> String {
    let nodes = elements + 1;
    let mut entries = Vec::new();
    for bar in 0..bars {
        for node in 0..nodes {
            let dof = bar * nodes + node;
            if node > 0 {
                entries.push((dof, dof - 1, off));
            }
            let neighbors = if node == 0 || node == elements { 1.0 } else { 2.0 };
            entries.push((dof, dof, neighbors * diagonal));
        }
    }
    symmetric(bars * nodes, &entries)
}

fn velocities(velocity: impl Iterator<Item = f64>) -> String {
    let mut text = String::from("dof,u,v\n");
    for (dof, v) in velocity.enumerate() {
        let _ = writeln!(text, "{},0,{v:?}", dof + 1);
    }
    text
}

fn bar(elements: usize) -> Scene {
    let size = LENGTH / elements as f64;
    let (k, m) = (AXIAL / size, LINE_MASS * size);
    let exact = CollidingBars::against_wall(end_bar(SPEED), GAP, 1.0).expect("the data of the bar are positive");
    Scene {
        files: vec![
            ("mass.mtx", chain(1, elements, [m / 3.0, m / 6.0])),
            ("stiffness.mtx", chain(1, elements, [k, -k])),
            (
                "contacts.csv",
                format!("# The wall pushes to the left.\nnode,dofs,normal,gap\nright,{},-1,{GAP:?}\n", elements + 1),
            ),
            ("initial.csv", velocities((0..=elements).map(|_| SPEED))),
        ],
        options: &["--step", "1e-3", "--end", "0.4"],
        exact: Box::new(move |t| [exact.contact_force(t), 0.0]),
    }
}

fn bars(elements: usize) -> Scene {
    let size = LENGTH / elements as f64;
    let (k, m) = (AXIAL / size, LINE_MASS * size);
    let nodes = elements + 1;
    let is_end = |dof: usize| [0, elements].contains(&(dof % nodes));
    let mass: Vec<_> = (0..2 * nodes).map(|dof| if is_end(dof) { m / 2.0 } else { m }).collect();
    let exact = CollidingBars::new(end_bar(SPEED), end_bar(-SPEED), 2.0 * GAP, 1.0).expect("the data are positive");
    Scene {
        files: vec![
            ("mass.mtx", diagonal(&mass)),
            ("stiffness.mtx", chain(2, elements, [k, -k])),
            (
                "contacts.csv",
                format!("node,dofs,opposite,normal,gap\nmiddle,{},{nodes},1,{:?}\n", nodes + 1, 2.0 * GAP),
            ),
            ("initial.csv", velocities((0..2 * nodes).map(|dof| if dof < nodes { SPEED } else { -SPEED }))),
        ],
        options: &["--step", "1e-3", "--end", "0.4"],
        exact: Box::new(move |t| [exact.contact_force(t), 0.0]),
    }
}

fn slide() -> Scene {
    let stop = SLIDING / (FRICTION * GRAVITY);
    Scene {
        files: vec![
            ("mass.mtx", diagonal(&[MASS; 2])),
            ("stiffness.mtx", symmetric(2, &[])),
            (
                "contacts.csv",
                format!(
                    "# Dofs x, y; the floor pushes up.\nnode,dofs,normal,gap,friction\nblock,1 2,0 1,0,{FRICTION}\n"
                ),
            ),
            ("initial.csv", format!("dof,v\n1,{SLIDING:?}\n")),
        ],
        options: &["--gravity", "0,-10", "--step", "0.01", "--end", "0.6"],
        // (Where the force jumps, the value is the one just after the jump.)
        exact: Box::new(move |t| {
            let slides = t < stop * (1.0 - 1e-9);
            [MASS * GRAVITY, if slides { FRICTION * MASS * GRAVITY } else { 0.0 }]
        }),
    }
}
