"""The package itself: names, errors, interruptions, checkpoints, locks and output."""

import io
import os
import pickle
import signal
import sys
import threading
import time

import contact_dynamics as cd
import numpy as np
import pytest
import scipy.sparse as sp
from scenes import FORCE, bar

N = 20


def scene(step=1e-3, load=None, law="rigid", **options):
    mass, stiffness = bar(N)
    wall = cd.LinearRows().unilateral({N: -1.0}, 0.005, law=law)
    system = cd.LinearSystem(mass, stiffness, load=load)
    return cd.Simulation(system, step, [wall], velocity=np.full(N + 1, 0.05), **options)


def test_every_scheme_and_correction_runs_by_its_name():
    with pytest.raises(ValueError, match='there is no scheme .* "\\?"; the names are') as refused:
        scene(scheme="?")
    names = str(refused.value).split("names are ")[1].split(", ")
    assert len(names) == 20 and all(f'"{name}"' in cd.Simulation.__doc__ for name in names)
    for name in names:
        law = {"name": "penalty", "stiffness": 50.0} if name == "tchamwa-wielgosz" else "rigid"
        assert scene(5e-4, scheme=name, law=law).run(0.12, progress=False).contact_force.max() > 0.5 * FORCE
    for name in ("none", "persistency", "persistency-history", "persistency-release", "contact-implicit"):
        scene(correction=name).run(0.12, progress=False)
    for name in ("contact-stabilized", "nonsmooth-splitting", "zero-acceleration"):
        scene(correction=name).run(0.12, progress=False)


def test_matrices_of_any_layout_give_the_same_run():
    mass, stiffness = bar(N)
    wide = sp.csr_matrix(stiffness)
    wide.indices, wide.indptr = wide.indices.astype(np.int64), wide.indptr.astype(np.int64)
    consistent = [sp.diags(mass), sp.diags(mass).tocsc(), np.diag(mass)]
    layouts = (stiffness.tocsc(), stiffness.tocoo(), stiffness.toarray(), wide, sp.csr_array(stiffness))
    forms = [(mass, k) for k in layouts]
    wall = cd.LinearRows().unilateral({N: -1.0}, 0.005)
    expected = scene().run(0.2, progress=False).contact_force
    for m, k in forms + [(m, stiffness) for m in consistent]:
        run = cd.Simulation(cd.LinearSystem(m, k, C=0 * stiffness), 1e-3, [wall], velocity=np.full(N + 1, 0.05))
        assert run.run(0.2, progress=False).contact_force == pytest.approx(expected, abs=1e-12 * FORCE)


M, K = bar(N)
UNSYMMETRIC = sp.csr_matrix(np.array([[2.0, -1.0], [-0.5, 2.0]]))
FLOOR = cd.Plane([0, 0], [0, 1])


def build(*matrices, contacts=(), step=1e-3, velocity=None, **system):
    return cd.Simulation(cd.LinearSystem(*(matrices or (M, K)), **system), step, contacts, velocity=velocity)


def on(obstacle, nodes=(0,)):
    return build(contacts=[cd.NodesOnObstacle(obstacle, [[0.0, 0.0]], nodes)])


REFUSED = {
    "size": (lambda: build(M[1:], K), ValueError, "has size 20, expected 21"),
    "nan": (lambda: build(M, K * np.nan), ValueError, "the stiffness matrix: .*not finite"),
    "square": (lambda: build(M, K[1:]), ValueError, r"\[20, 21\], expected a square matrix"),
    "complex": (lambda: build(M, K * 1j), ValueError, "the dtype is complex128, expected float64"),
    "mass": (lambda: build(-M, K), cd.ContactDynamicsError, "the mass of dof 0 is -6.25"),
    "unsymmetric mass": (lambda: build(UNSYMMETRIC, UNSYMMETRIC), cd.ContactDynamicsError, "not symmetric"),
    "unsymmetric": (lambda: build([1, 1], UNSYMMETRIC), cd.ContactDynamicsError, "Lu"),
    "load": (lambda: build(load=[1.0]), ValueError, r"the load: the shape is \[1\], expected \[21\]"),
    "support": (lambda: build(fixed=[21]), ValueError, "names dof 21"),
    "mask": (lambda: build(fixed=M > 1), ValueError, "the dtype is bool, expected int64"),
    "negative": (lambda: build(fixed=[-1]), ValueError, "the index -1 is negative"),
    "damping": (lambda: build(M, K, K, rayleigh=(1, 1)), ValueError, "both given"),
    "velocity": (lambda: build(velocity=[1.0]), ValueError, r"the velocity: the shape is \[1\], expected \[21\]"),
    "matrix": (lambda: build(velocity=[[1.0]]), ValueError, r"shape is \[1, 1\], expected \[21\]"),
    "step": (lambda: scene(step=-1.0), ValueError, "the step size h is -1e0"),
    "local error": (lambda: scene(local_error=1e-3), ValueError, "without smallest_step"),
    "stability": (lambda: scene(1.0, scheme="central-difference"), cd.ContactDynamicsError, "stability limit"),
    "radius": (lambda: scene(scheme={"name": "bathe", "rho": 2}), ValueError, r"it must be in \[0, 1\]"),
    "parameter": (lambda: scene(scheme={"name": "bathe", "gamma": 2}), ValueError, "has no parameter gamma"),
    "missing": (lambda: scene(law="penalty"), ValueError, "needs the parameter stiffness"),
    "overlap": (lambda: scene(overlap="kept"), ValueError, "expected refused, adjusted or a time"),
    "recorded": (lambda: scene(dofs=[N + 1]), ValueError, "names dof 21 of 21"),
    "contact": (lambda: build(contacts=[3]), ValueError, "type int, expected LinearRows"),
    "system": (lambda: cd.Simulation(M, 1e-3), ValueError, "type ndarray, expected LinearSystem"),
    "obstacle": (lambda: on(3), ValueError, "type int, expected Plane"),
    "node": (lambda: on(FLOOR, [1]), ValueError, "contact node .* has size 1, expected 0"),
    "space": (lambda: on(cd.Plane([0, 0, 0], [0, 0, 1])), ValueError, r"shape is \[3\], expected \[2\]"),
    "normal": (lambda: on(cd.Plane([0, 0], [0, 0])), ValueError, "normal of the plane"),
    "facet": (
        lambda: build(contacts=[cd.BodyContact(np.eye(3)[:, :2], [[0, 0]], [[1, 2]])]),
        cd.ContactDynamicsError,
        "facet 0 of a contact surface",
    ),
    "tangents": (
        lambda: build(contacts=[cd.LinearRows().unilateral({0: 1.0}, 0.0, friction=0.1)]),
        ValueError,
        "no tangents",
    ),
    "checkpoint": (lambda: scene(resume=b"no"), ValueError, "no checkpoint"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_wrong_input_is_refused_with_its_numbers(name):
    call, error, text = REFUSED[name]
    with pytest.raises(error, match=text):
        call()


def test_exceptions_of_functions_are_raised_and_undo_the_step():
    def load(t):
        if t > 0.05:
            raise KeyError("late")
        return np.zeros(N + 1)

    run = scene(load=load)
    with pytest.raises(KeyError, match="late"):
        run.run(0.4, progress=False)
    assert 0.045 < run.time < 0.051 and run.result.times[-1] == run.time
    with pytest.raises(ValueError, match="the load returned 3 numbers, expected 21"):
        scene(load=lambda t: np.zeros(3))
    with pytest.raises(ValueError, match="could not convert"):
        scene(load=lambda t: "?")
    with pytest.raises(cd.ContactDynamicsError, match="acceleration of dof 0 is NaN"):
        scene(load=lambda t: np.full(N + 1, np.nan))

    # Where the library takes no errors, they are raised all the same.
    def gap(t):
        return (0.005, 0.0, 0.0) if t < 0.05 else 1 / 0

    mass, stiffness = bar(N)
    run = cd.Simulation(cd.LinearSystem(mass, stiffness), 1e-3, [cd.LinearRows().unilateral({N: -1.0}, gap)])
    with pytest.raises(ZeroDivisionError):
        run.run(0.4, progress=False)
    assert run.time < 0.051


def test_a_function_cannot_step_its_own_simulation():
    runs = []

    def load(_):
        if runs:
            runs[0].step()
        return np.zeros(N + 1)

    runs.append(scene(load=load))
    with pytest.raises(RuntimeError, match="borrowed"):
        runs[0].step()


def test_inadmissible_states_halve_the_step():
    def force(u):
        if u[0] > 0.995:
            raise cd.Inadmissible("too far")
        return 100 * u

    def tangent(u):
        return sp.csc_matrix([[100.0]])

    # A step of the full size would leave the admissible range first, later ones come back.
    options = {"velocity": [9.9], "smallest_step": 1e-5}
    run = cd.Simulation(cd.NonlinearSystem(np.array([1.0]), force, tangent), 0.3, **options)
    run.run(0.6, progress=False)
    assert "refused_steps: 0" not in repr(run)
    run = cd.Simulation(cd.NonlinearSystem(np.array([1.0]), force, tangent), 0.05, velocity=[50.0])
    with pytest.raises(cd.ContactDynamicsError, match="too far"):
        run.run(0.6, progress=False)
    full = sp.csr_matrix(np.ones((2, 2)))
    wrong = cd.NonlinearSystem(np.ones(2), force, lambda u: full if u.any() else sp.eye(2))
    with pytest.raises(ValueError, match=r"entry \(1, 0\) of the tangent is not among those"):
        cd.Simulation(wrong, 0.05, velocity=[1.0, 0.0]).step()


def test_ctrl_c_leaves_whole_steps_and_the_run_goes_on():
    run, other = scene(1e-6), scene(1e-6)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        run.run(1e3, progress=False)
    timer.join()
    steps = run.result.times.size - 1
    assert steps > 100 and f" steps: {steps}," in repr(run) and run.result.times[-1] == run.time
    run.run(run.time + 1e-3, progress=False)
    for _ in range(steps + 1000):
        other.step()
    assert other.time == pytest.approx(run.time, abs=1e-9)
    assert np.array_equal(other.displacement, run.displacement) and np.array_equal(other.velocity, run.velocity)


def test_other_threads_work_while_a_run_does():
    run, counts = scene(1e-6), [0]
    done = threading.Event()

    def count():
        while not done.is_set():
            counts[0] += 1
            time.sleep(1e-4)

    thread = threading.Thread(target=count)
    thread.start()
    run._run.advance(1e3, 0.5, False)  # one call, half a second long
    done.set()
    thread.join()
    assert counts[0] > 500


def test_checkpoints_are_pickled_and_restored_bit_for_bit():
    run = scene(dofs=[N])
    run.run(0.15, progress=False)
    stored = pickle.dumps(run.checkpoint())
    whole = run.run(0.4, progress=False)
    checkpoint = pickle.loads(stored)
    resumed = scene(dofs=[N], resume=checkpoint).run(0.4, progress=False)
    run.restore(checkpoint)
    again = run.run(0.4, progress=False)
    for result in (resumed, again):
        assert result.times.size == 251
        assert np.array_equal(result.displacement, whole.displacement[150:])
        assert np.array_equal(result.contact_force[1:], whole.contact_force[151:])
    with pytest.raises(cd.ContactDynamicsError, match="a past belongs to the scheme"):
        scene(scheme="trapezoidal", resume=checkpoint)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_shown_in_terminals_alone(monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    # (Any run is long.)
    monkeypatch.setattr(cd.simulation, "PAUSE", 0.01)
    monkeypatch.setattr(cd.simulation, "DELAY", 0.0)
    shown = {}
    for name, stream in (("terminal", Terminal()), ("file", io.StringIO())):
        monkeypatch.setattr(sys, "stderr", stream)
        scene(1e-6).run(0.5, record=False)
        shown[name] = stream.getvalue()
    assert "█░" in shown["terminal"] and "%, t = " in shown["terminal"] and not shown["file"].strip()


def test_results_become_tables_and_figures():
    import matplotlib

    matplotlib.use("Agg")
    result = scene(energy="balance", dofs=[0, N]).run(0.2, progress=False)
    table = result.to_dataframe()
    assert table.index.name == "time" and table.shape == (201, 3 + 2 + 8 + 6)
    assert table["u_20"].iloc[-1] == result.displacement[-1, 1]
    figure = cd.plot(result)
    assert [len(axes.lines) for axes in figure.axes][0] == 1 and len(figure.axes) == 2
    bare = scene(energy="none").run(0.2, progress=False)
    assert bare.kinetic.size == 0 and len(cd.plot(bare).axes) == 1
