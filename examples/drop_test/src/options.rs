//! The command line.

use crate::material::Material;
use clap::{Parser, ValueEnum};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Drops a part, given as a Gmsh mesh of tetrahedra or hexahedra, and writes what happens for ParaView.
///
/// The part is turned, placed above what it falls on, and let go. Its fall is known, and skipped: the run begins a few
/// steps before contact, with the speed that the part then has. Units are those of the SI, but for --unit and --turn.
#[derive(Clone, Debug, Parser, Serialize, Deserialize)]
#[command(name = "drop-test", max_term_width = 110, after_help = EXAMPLES)]
pub struct Options {
    /// Mesh of the part: Gmsh's format 4.1, ASCII or binary, first-order tetrahedra and hexahedra.
    #[arg(required_unless_present_any = ["quick", "restart"])]
    pub mesh: Option<PathBuf>,

    /// Unit of length of the mesh files.
    #[arg(long, default_value = "mm")]
    pub unit: Unit,

    /// Material of the part: steel, aluminum, copper, titanium, glass, abs, nylon, rubber, or E=…,nu=…,rho=…
    #[arg(long, default_value = "steel")]
    pub material: Material,

    /// Strains: linear ones, for parts that deform and turn by little; neo-hookean for everything else.
    #[arg(long, default_value = "linear")]
    pub model: Model,

    /// What the part falls on: a plane, a ball, or another part (a mesh file), which stands on its lowest nodes.
    #[arg(long, default_value = "plane", value_name = "plane|ball|MESH")]
    pub onto: Target,

    /// Radius of the ball (m); a quarter of the part's largest width by default.
    #[arg(long, allow_hyphen_values = true)]
    pub radius: Option<f64>,

    /// Slope of the plane (degrees), downhill along x.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    pub slope: f64,

    /// Material of the other part; that of the part by default.
    #[arg(long)]
    pub target_material: Option<Material>,

    /// Coefficient of Coulomb's friction.
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    pub friction: f64,

    /// Speed downward when the part is let go (m/s).
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    pub speed: f64,

    /// Clear height of the fall (m).
    #[arg(long, default_value_t = 0.1, allow_hyphen_values = true)]
    pub height: f64,

    /// Gravity (m/s²), downward.
    #[arg(long, default_value_t = 9.81, allow_hyphen_values = true)]
    pub gravity: f64,

    /// Turns the part before: about x, then y, then z (degrees).
    #[arg(long, value_name = "X,Y,Z", default_value = "0,0,0", allow_hyphen_values = true)]
    pub turn: Vector<3>,

    /// Moves the part sideways, from above the middle of what it falls on (m).
    #[arg(long, value_name = "X,Y", default_value = "0,0", allow_hyphen_values = true)]
    pub offset: Vector<2>,

    /// Time integrator.
    #[arg(long, default_value = "chung-hulbert")]
    pub scheme: Scheme,

    /// Step size (s). By default a wave crosses a mean element in a step; explicit: half of the smallest one.
    #[arg(long, allow_hyphen_values = true)]
    pub step: Option<f64>,

    /// Number of steps, after a restart that of further ones.
    #[arg(long, default_value_t = 1000)]
    pub steps: u64,

    /// Number of pictures in the series for ParaView.
    #[arg(long, default_value_t = 50)]
    pub frames: u64,

    /// Where the results go.
    #[arg(long, default_value = "output/drop_test")]
    pub output: PathBuf,

    /// Goes on where a run ended: its file checkpoint.bin. The scene is that of the run; --steps, --frames and --output
    /// may be given.
    #[arg(long, value_name = "FILE", conflicts_with_all = OF_THE_SCENE)]
    pub restart: Option<PathBuf>,

    /// A short run of a mesh that comes with the program.
    #[arg(long, conflicts_with = "mesh")]
    pub quick: bool,
}

/// What a restart takes from the run before.
const OF_THE_SCENE: [&str; 17] = [
    "mesh",
    "quick",
    "unit",
    "material",
    "model",
    "onto",
    "radius",
    "slope",
    "target_material",
    "friction",
    "speed",
    "height",
    "gravity",
    "turn",
    "offset",
    "scheme",
    "step",
];

const EXAMPLES: &str = "Examples, from the root of the repository:

  cargo run --release -p drop-test -- examples/drop_test/meshes/bracket.msh --turn 20,30,0 --height 1
  cargo run --release -p drop-test -- examples/drop_test/meshes/jack.msh --onto examples/drop_test/meshes/cup.msh \\
      --material rubber --target-material nylon --model neo-hookean --speed 2 --friction 0.3
  cargo run --release -p drop-test -- --restart output/drop_test/checkpoint.bin --steps 500

Results: series.pvd with its .vtu files (open it in ParaView; warp by the vector `displacement`), force.svg, energy.svg,
history.csv (time, force, energies), checkpoint.bin.";

/// Unit of length of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
pub enum Unit {
    M,
    Cm,
    Mm,
    In,
}

impl Unit {
    pub fn meters(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 1e-2,
            Self::Mm => 1e-3,
            Self::In => 0.0254,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
pub enum Model {
    Linear,
    NeoHookean,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
pub enum Scheme {
    /// Generalized-α with a spectral radius of 0.8: damps what the mesh cannot resolve.
    ChungHulbert,
    /// The composite scheme, which damps more.
    Composite,
    /// Newmark's without damping.
    Trapezoidal,
    /// Explicit: no equations to solve, small steps; for Neo-Hookean parts with many elements.
    CdLagrange,
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Target {
    Plane,
    Ball,
    Part(PathBuf),
}

impl FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "plane" => Ok(Self::Plane),
            "ball" => Ok(Self::Ball),
            file if Path::new(file).extension().is_some_and(|end| end == "msh") => Ok(Self::Part(file.into())),
            _ => Err("it is neither `plane` nor `ball` nor a file that ends with .msh".into()),
        }
    }
}

/// Numbers with commas between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector<const D: usize>(pub [f64; D]);

impl<const D: usize> FromStr for Vector<D> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        match numbers.map(TryInto::try_into) {
            Ok(Ok(vector)) => Ok(Self(vector)),
            _ => Err(format!("{D} numbers with commas between them are needed")),
        }
    }
}

impl<const D: usize> Serialize for Vector<D> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.as_slice().serialize(serializer)
    }
}

impl<'de, const D: usize> Deserialize<'de> for Vector<D> {
    fn deserialize<S: serde::Deserializer<'de>>(deserializer: S) -> Result<Self, S::Error> {
        let numbers = Vec::<f64>::deserialize(deserializer)?;
        let count = numbers.len();
        numbers.try_into().map(Self).map_err(|_| serde::de::Error::invalid_length(count, &"another number of numbers"))
    }
}

impl Options {
    /// Refuses numbers that mean nothing.
    pub fn check(&self) -> Result<(), String> {
        let checks = [
            ("--friction", self.friction, self.friction >= 0.0, "from 0"),
            ("--height", self.height, self.height >= 0.0, "from 0"),
            ("--gravity", self.gravity, self.gravity >= 0.0, "from 0"),
            ("--slope", self.slope, self.slope.abs() < 80.0, "between −80 and 80"),
            ("--speed", self.speed, true, "finite"),
            ("--radius", self.radius.unwrap_or(1.0), self.radius.is_none_or(|r| r > 0.0), "positive"),
            ("--step", self.step.unwrap_or(1.0), self.step.is_none_or(|h| h > 0.0), "positive"),
            ("--steps", self.steps as f64, self.steps > 0, "positive"),
            ("--frames", self.frames as f64, self.frames > 0, "positive"),
        ];
        if let Some((name, value, _, range)) =
            checks.into_iter().find(|(_, value, good, _)| !good || !value.is_finite())
        {
            return Err(format!("{name} is {value}, but must be {range}"));
        }
        let angles = self.turn.0.into_iter().chain(self.offset.0);
        match angles.into_iter().all(f64::is_finite) {
            true => Ok(()),
            false => Err("--turn and --offset take finite numbers".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Options::command().debug_assert();
        // A restart takes all that makes the scene from the run before: nothing given beside it is left unread.
        let own = ["steps", "frames", "output", "restart"];
        for argument in Options::command().get_arguments().map(|argument| argument.get_id().as_str()) {
            assert!(OF_THE_SCENE.contains(&argument) != own.contains(&argument), "{argument}");
        }
    }

    #[test]
    fn options_survive_a_checkpoint() {
        let words = ["drop-test", "a.msh", "--turn", "-10,20,0.5", "--onto", "b.msh", "--unit", "in", "--speed", "-2"];
        let options = Options::parse_from(words);
        let bytes = postcard::to_stdvec(&options).unwrap();
        let read: Options = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(format!("{read:?}"), format!("{options:?}"));
        assert_eq!(read.turn, Vector([-10.0, 20.0, 0.5]));
        assert!((read.unit.meters() - 0.0254).abs() < 1e-15);
    }
}
