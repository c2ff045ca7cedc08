//! What meets what: every constraint with everything that it can be given.

use super::space::{Dimension, Space};
use contact_dynamics_scenes::random::Congruential;
use std::fmt;

/// How an obstacle moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Carried {
    Rests,
    Moves,
    Turns,
}

/// What keeps two bodies, or the parts of one, apart or together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Between {
    OnePass,
    TwoPasses,
    TwoPassesAndEdges,
    OneSurface,
    OneSurfaceWithEdges,
    Mortar,
    MortarAndEdges,
    Offsets,
    Coated,
    Bonds,
    Tie,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// An obstacle by its place in the list of shapes.
    Obstacle(usize, Carried),
    /// Rows of the nodes of a body to a wall.
    Wall,
    /// Rows of pairs of nodes of two bodies.
    Pairs,
    /// Rows of single nodes that are held, and break.
    Bonded,
    /// Nodes outside of a ball that the host gives as functions.
    Function,
    Bodies(Between),
    /// A body that folds until it meets itself: nodes, or edges as well.
    Fold,
    FoldWithEdges,
    /// Three bodies that are thrown onto each other.
    Pile,
}

/// A constraint and what it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Meeting {
    pub(super) space: usize,
    pub(super) kind: Kind,
    constraint: &'static str,
    what: &'static str,
}

impl fmt::Display for Meeting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let motion = ["", ", moving", ", turning"][self.motion()];
        write!(f, "{}, {}{motion}, {}-D", self.constraint, self.what, self.space)
    }
}

impl Meeting {
    /// The constraint.
    pub fn constraint(&self) -> &'static str {
        self.constraint
    }

    /// What it is given.
    pub fn what(&self) -> &'static str {
        self.what
    }

    /// Whether that rests (0), moves (1) or turns (2).
    pub fn motion(&self) -> usize {
        match self.kind {
            Kind::Obstacle(_, Carried::Moves) => 1,
            Kind::Obstacle(_, Carried::Turns) => 2,
            _ => 0,
        }
    }

    /// Whether corners may pass corners, or edges cross, unseen: what is inside when it is seen comes out slowly.
    pub fn misses_edges(&self) -> bool {
        self.constraint == "Mortar" || (self.space == 3 && self.constraint == "NodeToFacet")
    }

    /// Whether bodies may be in each other because of that, or because corners have no rows.
    pub(super) fn lets_in(&self) -> bool {
        self.misses_edges() || self.what == "beside mortar"
    }

    /// Whether faces, corners and edges of all bodies are kept apart.
    pub fn keeps_apart(&self) -> bool {
        self.constraint == "BodyContact"
    }

    /// Dimensions.
    pub fn space(&self) -> usize {
        self.space
    }

    /// Whether rows keep their normals: then gaps are met to rounding.
    pub(super) fn has_fixed_normals(&self) -> bool {
        match self.kind {
            Kind::Obstacle(_, motion) => motion != Carried::Turns && ["line", "plane"].contains(&self.what),
            Kind::Wall | Kind::Pairs => true,
            _ => false,
        }
    }

    /// Whether there are rows that hold both ways.
    pub(super) fn holds(&self) -> bool {
        matches!(self.kind, Kind::Bonded | Kind::Bodies(Between::Bonds | Between::Tie))
    }

    /// Whether nothing acts on the bodies from outside.
    pub(super) fn is_free(&self) -> bool {
        matches!(self.kind, Kind::Pairs | Kind::Bodies(_) | Kind::Fold | Kind::FoldWithEdges | Kind::Pile)
    }

    /// Whether nothing does work on the bodies.
    pub(super) fn conserves(&self) -> bool {
        self.motion() == 0
    }
}

/// All of them.
pub fn meetings() -> Vec<Meeting> {
    let mut all = Vec::new();
    for space in [2, 3] {
        let mut random = Congruential(1);
        let names: Vec<_> = match space {
            2 => Space::<2>::shapes(1.0, &mut random).into_iter().map(|shape| shape.0).collect(),
            _ => Space::<3>::shapes(1.0, &mut random).into_iter().map(|shape| shape.0).collect(),
        };
        let mut add = |constraint, what, kind| all.push(Meeting { space, kind, constraint, what });
        for (index, what) in names.into_iter().enumerate() {
            for motion in [Carried::Rests, Carried::Moves, Carried::Turns] {
                add("NodesOnObstacle", what, Kind::Obstacle(index, motion));
            }
        }
        add("LinearRows", "wall", Kind::Wall);
        add("LinearRows", "pairs of nodes", Kind::Pairs);
        add("LinearRows", "bonds to a wall", Kind::Bonded);
        add("GapFunction", "ball", Kind::Function);
        add("NodeToFacet", "one pass", Kind::Bodies(Between::OnePass));
        add("NodeToFacet", "two passes", Kind::Bodies(Between::TwoPasses));
        add("NodeToFacet", "of itself, two bodies", Kind::Bodies(Between::OneSurface));
        add("NodeToFacet", "of itself, a body that folds", Kind::Fold);
        add("NodeToFacet", "offsets", Kind::Bodies(Between::Coated));
        add("Mortar", "plain", Kind::Bodies(Between::Mortar));
        add("Mortar", "offsets", Kind::Bodies(Between::Offsets));
        add("Mortar", "bonded", Kind::Bodies(Between::Bonds));
        add("Tie", "two bodies", Kind::Bodies(Between::Tie));
        add("BodyContact", "of itself, two bodies", Kind::Bodies(Between::OneSurfaceWithEdges));
        add("BodyContact", "of itself, three bodies", Kind::Pile);
        add("BodyContact", "of itself, a body that folds", Kind::FoldWithEdges);
        if space == 3 {
            add("EdgeToEdge", "beside two passes", Kind::Bodies(Between::TwoPassesAndEdges));
            add("EdgeToEdge", "beside mortar", Kind::Bodies(Between::MortarAndEdges));
        }
    }
    all
}
