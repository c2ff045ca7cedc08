"""plot: contact force and energies over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def plot(result: Result, figure: Figure | None = None) -> Figure:
    """Draws the contact force, and below it the energies, over time; returns the figure of matplotlib."""
    if figure is None:
        from matplotlib import pyplot

        figure = pyplot.figure(layout="constrained")
    has_energy = result.kinetic.size > 0
    axes = figure.subplots(1 + has_energy, sharex=True, squeeze=False)[:, 0]
    axes[0].plot(result.times, result.contact_force, label="normal")
    if result.friction_force.any():
        axes[0].plot(result.times, result.friction_force, label="friction")
        axes[0].legend()
    axes[0].set_ylabel("contact force")
    if has_energy:
        for name in ("kinetic", "potential", "total"):
            axes[1].plot(result.times, getattr(result, name), label=name)
        for name, work in result.works.items():
            if abs(work).max() > 1e-3 * result.total.max():
                axes[1].plot(result.times, work, "--", label=f"work: {name}")
        axes[1].set_ylabel("energy")
        axes[1].legend()
    axes[-1].set_xlabel("time")
    return figure
