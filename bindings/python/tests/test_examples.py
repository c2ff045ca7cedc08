"""The examples run, and their results are right."""

from pathlib import Path

import meshio
import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_disc_of_scikit_fem_slides_on_a_plane(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    import skfem_drop

    result, (along, up) = skfem_drop.main(tmp_path, refine=3, files=4)
    # It slides all the time, and its momentum is the impulse of contact.
    assert -along == pytest.approx(skfem_drop.FRICTION * up, rel=1e-6)
    assert result.contact_impulse.sum() == pytest.approx(up, rel=1e-9)
    assert result.works["friction"][-1] < 0 and result.total[-1] < result.total[0]
    files = sorted(tmp_path.glob("*.vtu"))
    last = meshio.read(files[-1])
    assert len(files) == 5 and np.abs(last.point_data["displacement"]).max() > 0.02
    pressed = max(np.abs(meshio.read(file).point_data["contact force"]).max() for file in files)
    assert pressed > 0


def test_programs_of_the_page_run(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(tmp_path)
    programs = (EXAMPLES.parents[2] / "docs/python.md").read_text().split("```python\n")[1:]
    exec("".join(program.split("```")[0] for program in programs), {})
    assert len(programs) == 3 and (tmp_path / "force.png").exists()


def test_notebook_runs_and_asserts():
    notebook = nbformat.read(EXAMPLES / "two_bars.ipynb", as_version=4)
    assert len(notebook.cells) <= 10
    scene = next(cell.source for cell in notebook.cells if "cd.Simulation(" in cell.source)
    assert len([line for line in scene.splitlines() if line and not line.startswith("#")]) <= 15
    assert any("assert" in cell.source for cell in notebook.cells)
    NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(EXAMPLES)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2
