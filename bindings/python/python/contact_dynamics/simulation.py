"""Simulation: a system, its contacts and a scheme, advanced in time."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ._core import Run
from .contacts import BodyContact, LinearRows, Named, NodesOnObstacle
from .gradient import Fields, Gradient, Objective, Step
from .result import Result
from .systems import LinearSystem, NonlinearSystem, Vector

# Seconds between two looks at Ctrl-C and progress, and before the progress is shown.
PAUSE, DELAY = 0.1, 0.5


class Contact(NamedTuple):
    """A contact of a state.

    constraint: index of its constraint; a BodyContact makes several. feature: the row of LinearRows, or the node.
    candidate: what is opposite to the feature, if there are several.
    status: "open", "touching", "closed", "sticking" or "sliding". gap: length, negative if bodies overlap.
    force: normal force, compression positive. friction, slip: forces and slip velocities along the tangents.
    position, normal: place in space, and direction in which the gap opens, (3), if known.
    """

    constraint: int
    feature: int
    candidate: int
    status: str
    gap: float
    force: float
    friction: list[float]
    slip: list[float]
    position: list[float] | None
    normal: list[float] | None


class Simulation:
    """Advances a system of n dofs with contact in time.

    step: the step size h (time). contacts: any number.
    scheme: a name, a dictionary with the name and parameters, as in {"name": "bathe", "rho": 0.5}, or a preset. With
        defaults and ranges of the parameters (rho is the spectral radius for the highest frequencies):
        "generalized-alpha" (rho = 0.8, 0 to 1; Chung and Hulbert), "hht" (rho = 0.8, 0.5 to 1), "wbz" (rho = 0.8, 0 to
        1), "trapezoidal", "newmark" (beta = 0.25, 0 to 1; gamma = 0.5, 0.5 to 1), "composite", "bathe" (rho = 0, 0 to
        1), "houbolt", "park", "bdf2", "oalts" (rho = 0.5, 0 to 1), "gssss" (0 ≤ rho_3 ≤ rho_1 ≤ rho_2 ≤ 1, all 0.8),
        "moreau-jean" (theta = 0.5, 0.5 to 1), "energy-momentum"; explicit, for lumped masses and steps below the
        stability limit: "central-difference", "cd-lagrange", "tchamwa-wielgosz" (phi = 1.033, 1 to 2; compliant laws
        only), "chung-lee" (beta = 28/27, 1 to 28/27), "hulbert-chung" (rho = 0.8, 0 to 1), "noh-bathe" (p = 0.54,
        0.5 to 2 − √2).
        Presets, with a mass by preset_mass: "smooth", "conservative", "explicit".
    displacement, velocity: initial values, (n); zero by default. start_time: time at the start.
    correction: makes velocity and acceleration agree with contacts that have closed, without which forces spike:
        "default" (the library chooses λ_v/λ_a where it applies), "none", "persistency", "persistency-history",
        "persistency-release", "contact-implicit", "contact-stabilized", "laursen-love", "nonsmooth-splitting",
        "work-balance", "zero-acceleration".
    linear_solver: "automatic", "cholesky", "lu" (unsymmetric matrices), "conjugate-gradients" (no factor), "by-body".
    smallest_step: steps that fail are halved down to this size; without it they raise. local_error: with it, steps are
        also halved until the error of a displacement in a step is estimated below this length.
    overlap: negative gaps at the start are "refused", "adjusted" (zero from then on), or removed in this time.
    start_at_rest: begin in static balance under the load at the start time.
    check_stability: refuse a step beyond the stability limit of an explicit scheme.
    energy: what run records: "none", "state" (kinetic and potential) or "balance" (with all works).
    dofs: dofs whose motion run records.
    differentiable: keep what gradient needs, some √N states of N steps.
    resume: a checkpoint of an equally built simulation, from which this one starts.
    """

    def __init__(
        self,
        system: LinearSystem | NonlinearSystem,
        step: float,
        contacts: Iterable[LinearRows | NodesOnObstacle | BodyContact] = (),
        *,
        scheme: Named = "generalized-alpha",
        displacement: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        start_time: float = 0.0,
        correction: str = "default",
        linear_solver: str = "automatic",
        smallest_step: float | None = None,
        local_error: float | None = None,
        overlap: str | float = "refused",
        start_at_rest: bool = False,
        check_stability: bool = True,
        energy: str = "state",
        dofs: ArrayLike = (),
        differentiable: bool = False,
        resume: bytes | None = None,
    ) -> None:
        names = ("self", "system", "contacts")
        self._options = {name: value for name, value in locals().items() if name not in names}
        self._system, self._contacts = system, list(contacts)
        self._run = Run(self._system, self._contacts, self._options)
        self._dofs = np.asarray(dofs, dtype=int)

    def __repr__(self) -> str:
        """The scheme, the correctors and the work counts."""
        return repr(self._run)

    def step(self) -> None:
        """Takes one step, without recording it. If it fails, the state is that before the step."""
        self._run.step()

    def run(self, until: float, progress: bool = True, record: bool = True) -> Result:
        """Takes whole steps up to the first time that is not before `until`; returns all that has been recorded.

        The interpreter's lock is free meanwhile, except in your functions. Terminals and notebooks show the progress of
        runs longer than half a second. Ctrl-C raises KeyboardInterrupt between two steps, an exception in one of your
        functions undoes its step; the simulation can go on from there, and `result` has the steps so far.
        """
        # Where nobody looks, nothing is shown.
        progress &= "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
        start, begin, line = self.time, time.monotonic(), ""
        try:
            while not self._run.advance(until, PAUSE, record):
                if progress and time.monotonic() > begin + DELAY:
                    share = (self.time - start) / (until - start)
                    line = f"\r{'█' * int(40 * share):░<40} {share:4.0%}, t = {self.time:.4g} of {until:.4g} "
                    print(line, end="", file=sys.stderr, flush=True)
        finally:
            if line:
                print(file=sys.stderr)
        return self.result

    @property
    def result(self) -> Result:
        """What run has recorded since the start."""
        columns = self._run.record()
        works = {name[5:]: columns.pop(name) for name in list(columns) if name.startswith("work_")}
        works = {name: work for name, work in works.items() if work.size}
        for name in ("displacement", "velocity", "acceleration"):
            columns[name] = columns[name].reshape(columns["times"].size, self._dofs.size)
        return Result(**columns, works=works, dofs=self._dofs)

    @property
    def time(self) -> float:
        """Time of the state."""
        return self._run.time

    @property
    def displacement(self) -> Vector:
        """Displacements of the state, (n), a copy."""
        return self._run.vector("displacement")

    @property
    def velocity(self) -> Vector:
        """Velocities of the state, (n), a copy."""
        return self._run.vector("velocity")

    @property
    def acceleration(self) -> Vector:
        """Accelerations of the state, (n), a copy."""
        return self._run.vector("acceleration")

    def contacts(self) -> list[Contact]:
        """The contacts of the state, open candidates included."""
        return [Contact(*contact) for contact in self._run.contacts()]

    def contact_forces(self) -> Vector:
        """Forces of all contacts on the dofs, friction included, (n): their sum over a body is the force on it."""
        return self._run.vector("contact_forces")

    def contact_impulses(self) -> Vector:
        """Impulses (force · time) of all contacts on the dofs in the last step, (n); (0) without contacts."""
        return self._run.vector("contact_impulses")

    def reactions(self) -> Vector:
        """Forces of the supports on the fixed and driven dofs, in ascending order of these."""
        return self._run.vector("reactions")

    def gradient(self, objective: Objective) -> Gradient:
        """Derivatives of a number of the run so far, of a simulation that is built as differentiable.

        The number is the sum of objective(step, state, seed) over the states, see Objective. It takes the time of two
        more runs. Contacts that close in other steps under other parameters are kinks (docs/gradients.md).
        """
        columns = self._run.gradient(lambda at, *fields: objective(Step(*at), *(Fields(*own) for own in fields)))
        return Gradient(**columns)

    def checkpoint(self) -> bytes:
        """State and history, to be pickled or written to a file; an equally built simulation goes on bit for bit."""
        return self._run.checkpoint()

    def restore(self, checkpoint: bytes) -> None:
        """Goes to the time of a checkpoint of an equally built simulation; its record begins anew."""
        self._run = Run(self._system, self._contacts, {**self._options, "resume": checkpoint})
