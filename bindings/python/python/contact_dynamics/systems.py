"""Systems of equations: descriptions that a Simulation reads, checks and copies when it is built."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vector = NDArray[np.float64]
Motion = Callable[[float], ArrayLike]
Matrix = Any
"""A matrix or array of scipy.sparse with both triangles stored."""


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """M a + C v + K u = F(t) + contact forces, with n dofs.

    M: (n) for a lumped mass, or (n, n). K, C: (n, n), as CSR or CSC with indices of any type; other formats are
        converted. Every Simulation copies them once, when it is built; steps copy nothing.
    rayleigh: (α, β) instead of C, for C = α M + β K (1/time, time).
    load: forces (n), constant, or a function of t that returns them.
    fixed: dofs held at zero. driven: {dof: function of t that returns displacement, velocity, acceleration}.

    An unsymmetric K or C needs linear_solver="lu".
    """

    M: ArrayLike | Matrix
    K: Matrix
    C: Matrix | None = None
    _: KW_ONLY
    rayleigh: tuple[float, float] | None = None
    load: ArrayLike | Motion | None = None
    fixed: ArrayLike = ()
    driven: Mapping[int, Motion] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class NonlinearSystem:
    """M a + f(u) = F(t) + contact forces, with the internal force f by a Python function: for tests and small models.

    M, load, fixed, driven: as for LinearSystem.
    internal_force(u): f, (n), for displacements u, (n).
    tangent(u): ∂f/∂u, (n, n) sparse, with entries only where tangent(0) stores some, zeros included.
    potential(u): the elastic energy, a number; without it energies are kinetic only.

    An unsymmetric tangent needs linear_solver="lu". A function that cannot evaluate u raises Inadmissible.
    """

    M: ArrayLike | Matrix
    internal_force: Callable[[Vector], ArrayLike]
    tangent: Callable[[Vector], Matrix]
    _: KW_ONLY
    potential: Callable[[Vector], float] | None = None
    load: ArrayLike | Motion | None = None
    fixed: ArrayLike = ()
    driven: Mapping[int, Motion] = field(default_factory=dict)
