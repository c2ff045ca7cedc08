"""Obstacles and contacts: descriptions that a Simulation reads, checks and copies when it is built.

A contact law is a name, or a dictionary with the name and parameters in the units of the model, as in
{"name": "penalty", "stiffness": 1e6}:

"rigid" (no penetration), "restitution" (coefficient from 0 to 1), "penalty" (stiffness, force/length), "power"
(stiffness, force/length^exponent; exponent ≥ 1), "hertz" (modulus E*, radius R: 4/3 E* √R δ^1.5), "kelvin-voigt"
(stiffness; damping, force·time/length), "hunt-crossley" (stiffness, exponent = 1.5, dissipation, time/length),
"rate-condition", "persistency-switch", and for explicit schemes "bipenalty" (stiffness, mass) and
"stabilized-bipenalty" (stiffness).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

from numpy.typing import ArrayLike

from .systems import Motion, Vector

Named = str | Mapping[str, str | float]
Facets = ArrayLike | Sequence[ArrayLike]
Entries = Mapping[int, float]


@dataclass(frozen=True, eq=False)
class Plane:
    """The half-space behind a plane through a point, with a normal of any length that points to the free side."""

    at: ArrayLike
    normal: ArrayLike


@dataclass(frozen=True, eq=False)
class Sphere:
    """A ball (a disc in two dimensions); inside: bodies are in a hollow of this shape."""

    center: ArrayLike
    radius: float
    inside: bool = False


@dataclass(frozen=True, eq=False)
class Cuboid:
    """A box with sides along the axes: center, half of its side lengths, and radius of its edges (positive)."""

    center: ArrayLike
    half: ArrayLike
    rounding: float


@dataclass(frozen=True, eq=False)
class SignedDistance:
    """A rigid body by functions of a point x, (dimension); called for each node and step, so slow for many nodes.

    distance(x): signed distance, positive outside. gradient(x): outward unit normal, (dimension).
    curvature(x, w): wᵀ H w with the second derivative H of the distance; without it accelerations are corrected as if
        the surface were flat.
    """

    distance: Callable[[Vector], float]
    gradient: Callable[[Vector], ArrayLike]
    curvature: Callable[[Vector, Vector], float] | None = None


@dataclass(frozen=True, eq=False)
class NodesOnObstacle:
    """Contact of nodes of a mesh with a rigid obstacle: the gap is the distance, the force acts along the normal.

    coordinates: (n, 2) or (n, 3), of all nodes of the mesh at u = 0. nodes: indices of those that may touch.
    dofs: (n, dimension), the dofs of the displacements of each node; by default node · dimension + axis.
    friction: Coulomb's coefficient ≥ 0. law: a contact law, see the module.
    reach: distance beyond which nodes are no candidates; it saves the cost of rows that stay open.
    motion: function of t that returns displacement, velocity and acceleration of the obstacle, (3, dimension).
    """

    obstacle: Plane | Sphere | Cuboid | SignedDistance
    coordinates: ArrayLike
    nodes: ArrayLike
    _: KW_ONLY
    dofs: ArrayLike | None = None
    friction: float = 0.0
    law: Named = "rigid"
    reach: float | None = None
    motion: Motion | None = None


@dataclass(frozen=True, eq=False)
class BodyContact:
    """Contact of deforming bodies with faces, corners and edges.

    coordinates, dofs, friction, law: as for NodesOnObstacle, with the nodes of all bodies.
    slave, master: the whole surfaces as facets of node indices: (m, 2) segments with the body on their left, (m, 3) or
        (m, 4) counter-clockwise seen from outside, or a list of such arrays, as outer_facets returns it. The slave is
        the finer surface. Without a master the slave is in contact with itself: any number of bodies.
    reach: least distance at which facets are found; their size by default.
    """

    coordinates: ArrayLike
    slave: Facets
    master: Facets | None = None
    _: KW_ONLY
    dofs: ArrayLike | None = None
    friction: float = 0.0
    law: Named = "rigid"
    reach: float | None = None


class LinearRows:
    """Rows gap = Σ coefficient · u[dof] + gap₀, linear in the displacements. Each method adds one and returns self.

    entries: {dof: coefficient}. gap: gap₀ (length), or a function of t that returns gap₀ and its first two
    derivatives, for an obstacle that moves.
    """

    def __init__(self) -> None:
        self.rows: list[tuple[Any, ...]] = []

    def unilateral(
        self,
        entries: Entries,
        gap: float | Motion,
        *,
        law: Named = "rigid",
        friction: float = 0.0,
        tangents: Sequence[Entries] = (),
    ) -> LinearRows:
        """gap ≥ 0; the force is ≥ 0. Friction (≥ 0) acts along tangents: one in the plane, two in space."""
        self.rows.append((dict(entries), gap, law, None, friction, [dict(tangent) for tangent in tangents]))
        return self

    def equality(self, entries: Entries, gap: float | Motion) -> LinearRows:
        """gap = 0, by a force of either sign."""
        self.rows.append((dict(entries), gap, None, None, 0.0, []))
        return self

    def bond(self, strength: float, entries: Entries, gap: float | Motion) -> LinearRows:
        """gap = 0 until the tension exceeds the strength (force), then gap ≥ 0."""
        self.rows.append((dict(entries), gap, None, strength, 0.0, []))
        return self
