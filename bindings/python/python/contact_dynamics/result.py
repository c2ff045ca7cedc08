"""Result: what a run has recorded, as arrays, as a table and as a figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .systems import Vector

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Result:
    """Histories of a run: m samples, the first at its start and then one after each step, in arrays of shape (m).

    contact_force: sum of the normal forces of all contacts, compression positive. contact_impulse: sum of their
        impulses in the step (force · time). friction_force: sum of the magnitudes of all friction forces.
    kinetic: ½ vᵀ M v. potential: elastic energy, ½ uᵀ K u of a linear system, zero if the system has none; weight is a
        load. Both are empty if energy="none".
    works: if energy="balance", works since the start by line of the balance: "load", "supports", "damping", "contact",
        "friction", "impacts", "corrections", "remainder" (docs/energies.md). Their sum is the change of the energy.
    dofs: the k recorded dofs, with displacement, velocity and acceleration of shape (m, k).
    """

    times: Vector
    contact_force: Vector
    contact_impulse: Vector
    friction_force: Vector
    kinetic: Vector
    potential: Vector
    works: dict[str, Vector]
    dofs: NDArray[np.int_]
    displacement: Vector
    velocity: Vector
    acceleration: Vector

    @property
    def total(self) -> Vector:
        """Kinetic and potential energy together."""
        return self.kinetic + self.potential

    def to_dataframe(self) -> pandas.DataFrame:
        """A table with a row for each sample, its time as the index; columns as here, and u_7, v_7, a_7 for dof 7."""
        import pandas

        names = ("contact_force", "contact_impulse", "friction_force", "kinetic", "potential")
        columns = {name: getattr(self, name) for name in names if getattr(self, name).size}
        columns |= {f"work_{name}": work for name, work in self.works.items()}
        for letter, field in (("u", self.displacement), ("v", self.velocity), ("a", self.acceleration)):
            columns |= {f"{letter}_{dof}": field[:, place] for place, dof in enumerate(self.dofs)}
        return pandas.DataFrame(columns, index=pandas.Index(self.times, name="time"))


def plot(result: Result) -> Figure:
    """Draws the contact force, and below it the energies, over time; returns the figure of matplotlib."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1 + (result.kinetic.size > 0), sharex=True, squeeze=False, layout="constrained")
    curves = [{"normal force": result.contact_force}, {}]
    if result.friction_force.any():
        curves[0]["friction"] = result.friction_force
    if result.kinetic.size:
        curves[1] = {"kinetic": result.kinetic, "potential": result.potential, "total": result.total}
        seen = {name: work for name, work in result.works.items() if abs(work).max() > 1e-3 * result.total.max()}
        curves[1] |= {f"work: {name}": work for name, work in seen.items()}
    for axis, label, named in zip(axes[:, 0], ("contact force", "energy"), curves):
        for name, values in named.items():
            axis.plot(result.times, values, "--" if name.startswith("work") else "-", label=name)
        axis.set_ylabel(label)
        axis.legend()
    axes[-1, 0].set_xlabel("time")
    return figure
