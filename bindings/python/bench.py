"""Overhead of Python per step: the same runs by `run`, whose loop is in Rust, and by a loop of `step()`.

python bench.py [--quick]; the target is 1 µs + 5 % of the step. Samples of both are interleaved.
"""

import statistics
import sys
import time
from pathlib import Path

import contact_dynamics as cd
import numpy as np

sys.path.insert(0, str(Path(__file__).parent / "tests"))
from scenes import bar, plate  # noqa: E402


def bars(elements):
    mass, stiffness = bar(elements)
    return cd.Simulation(cd.LinearSystem(mass, stiffness), 1e-3, velocity=np.full(elements + 1, 0.05))


def pressed_plate(cells):
    """A plate that lies on a plane under its weight: every node of its lower side is in contact."""
    coordinates, mass, stiffness = plate(cells)
    contact = cd.NodesOnObstacle(cd.Plane([0, 0], [0, 1]), coordinates, np.arange(cells + 1))
    system = cd.LinearSystem(mass, stiffness, load=np.where(np.arange(mass.size) % 2, -9.81, 0.0) * mass)
    return cd.Simulation(system, 5e-3 / cells, [contact])


def measure(name, run, steps, samples):
    run.step()
    step = run.time
    times = {"run": [], "step": []}
    for _ in range(samples):
        until, begin = run.time + (steps - 0.5) * step, time.perf_counter()
        run.run(until, progress=False, record=False)
        middle = time.perf_counter()
        for _ in range(steps):
            run.step()
        times["run"].append((middle - begin) / steps * 1e6)
        times["step"].append((time.perf_counter() - middle) / steps * 1e6)
    rust, python = (statistics.median(times[way]) for way in ("run", "step"))
    overhead, target = python - rust, 1.0 + 0.05 * rust
    verdict = "met" if overhead <= target else "MISSED"
    print(f"{name:<34} {rust:9.2f} {python:9.2f} {overhead:9.2f} {target:9.2f}  {verdict}")


def main():
    quick = "--quick" in sys.argv
    print(f"{'µs per step':<34} {'run':>9} {'step()':>9} {'overhead':>9} {'target':>9}")
    measure("bar of 20 elements, free", bars(20), 20_000, 5 if quick else 25)
    for cells in (10, 30) if quick else (10, 30, 100):
        steps = max(20, 200_000 // cells**2 // 4)
        measure(f"plate of {cells} x {cells}, in contact", pressed_plate(cells), steps, 5 if quick else 15)


if __name__ == "__main__":
    main()
