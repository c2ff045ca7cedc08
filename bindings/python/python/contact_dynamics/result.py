"""Result: what a run has recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Result:
    """Histories of a run: m samples, the first at its start and then one after each step, as arrays of shape (m).

    The arrays of energies are empty if the simulation has energy="none", and `works` is without energy="balance".
    """

    times: Array
    contact_force: Array
    """Sum of the normal forces of all contacts (force ≥ 0; equality rows count with their sign)."""
    contact_impulse: Array
    """Sum of their impulses in the step (force · time)."""
    friction_force: Array
    """Sum of the magnitudes of all friction forces."""
    kinetic: Array
    """½ vᵀ M v."""
    potential: Array
    """Elastic energy, ½ uᵀ K u of a linear system; zero if the system has none. Weight is a load, not part of it."""
    works: dict[str, Array]
    """Works since the start, by line of the energy balance: "load", "supports", "damping", "contact", "friction",
    "impacts", "corrections" and "remainder" (docs/energies.md). Their sum is the change of the total energy."""
    dofs: NDArray[np.int_]
    """The recorded dofs, k of them."""
    displacement: Array
    """(m, k)"""
    velocity: Array
    """(m, k)"""
    acceleration: Array
    """(m, k)"""

    @classmethod
    def of(cls, columns: dict[str, Array], dofs: NDArray[np.int_]) -> Result:
        """From the columns of the compiled part."""
        works = {name[5:]: columns.pop(name) for name in list(columns) if name.startswith("work_")}
        works = {name: work for name, work in works.items() if work.size}
        for name in ("displacement", "velocity", "acceleration"):
            columns[name] = columns[name].reshape(columns["times"].size, dofs.size)
        return cls(**columns, works=works, dofs=dofs)

    @property
    def total(self) -> Array:
        """Kinetic and potential energy together."""
        return self.kinetic + self.potential

    def to_dataframe(self) -> pandas.DataFrame:
        """A table with a row for each sample, its time as the index; columns as here, and u_7, v_7, a_7 for dof 7."""
        import pandas

        columns = {"contact_force": self.contact_force, "contact_impulse": self.contact_impulse}
        columns["friction_force"] = self.friction_force
        if self.kinetic.size:
            columns |= {"kinetic": self.kinetic, "potential": self.potential}
        columns |= {f"work_{name}": work for name, work in self.works.items()}
        for letter, field in (("u", self.displacement), ("v", self.velocity), ("a", self.acceleration)):
            columns |= {f"{letter}_{dof}": field[:, place] for place, dof in enumerate(self.dofs)}
        return pandas.DataFrame(columns, index=pandas.Index(self.times, name="time"))
