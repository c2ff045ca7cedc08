"""Derivatives of a run: the number that is differentiated, and what it is differentiated by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from .systems import Vector

Key = tuple[int, int, int]
"""Constraint, feature and candidate of a contact, as in Contact."""


class Fields(NamedTuple):
    """Displacement, velocity and acceleration, (n); force and impulse of each contact, in the order of contacts()."""

    displacement: Vector
    velocity: Vector
    acceleration: Vector
    force: Vector
    impulse: Vector


class Step(NamedTuple):
    """A state of the run: its time, the step size, its number from 0 at the start to that of the last step."""

    time: float
    step: float
    number: int
    last: int


Objective = Callable[[Step, Fields, Fields], float]
"""objective(step, state, seed): a term of the sum over all states that is differentiated. It adds the derivatives of
the term by the fields of the state to those of seed, as in seed.force[0] += 1.0."""


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivatives of the value, a sum of terms.

    displacement, velocity: by initial values, (n). gaps: by a constant added to the gap of each contact that has
        carried a force. friction: by the coefficient of each contact that has slid.
    mass, damping, stiffness, load, contact: by factors of M, C, K, the load, and the forces of compliant laws.
    """

    value: float
    displacement: Vector
    velocity: Vector
    gaps: dict[Key, float]
    friction: dict[Key, float]
    mass: float
    damping: float
    stiffness: float
    load: float
    contact: float
