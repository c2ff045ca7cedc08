"""Scenes with known results: closed forms, and integrations by SciPy that share no code with the library."""

import contact_dynamics as cd
import numpy as np
import pytest
import scipy.sparse as sp
from scenes import EA, FORCE, RHO_A, WAVE, bar, plate
from scipy.integrate import solve_ivp

FREE = sp.csr_matrix((2, 2))


def against_wall(n=40, step=1e-3, law="rigid", **options):
    mass, stiffness = bar(n)
    wall = cd.LinearRows().unilateral({n: -1.0}, 0.005, law=law)
    return cd.Simulation(cd.LinearSystem(mass, stiffness), step, [wall], velocity=np.full(n + 1, 0.05), **options)


def test_force_of_a_bar_at_a_wall_is_rho_c_a_v():
    run = against_wall(energy="balance")
    result = run.run(0.4, progress=False)
    pressed = (result.times > 0.12) & (result.times < 0.28)
    assert abs(result.contact_force[pressed] / FORCE - 1).max() < 0.05
    assert abs(np.interp(0.2, result.times, result.contact_force) / FORCE - 1) < 0.01
    assert result.contact_impulse.sum() == pytest.approx(bar(40)[0] @ (0.05 - run.velocity), rel=1e-12)
    assert result.contact_impulse.sum() == pytest.approx(2 * RHO_A * 10 * 0.05, rel=0.02)  # it flies back as it came
    balance = result.total - result.total[0] - sum(result.works.values())
    assert abs(balance).max() < 1e-12 * result.total[0]
    raw = against_wall(correction="none").run(0.4, progress=False)
    assert raw.contact_force.max() > 1.5 * FORCE > 1.2 * result.contact_force.max()


def test_gradient_of_the_force_of_a_bar():
    def recorded(stretch=0.0):
        # (It arrives in the middle of a step: at the end of one the first contact would be a kink.)
        place = np.full(41, -0.5e-3 * 0.05) + stretch * np.linspace(0, 1, 41)
        run = against_wall(differentiable=True, displacement=place)
        run.run(0.25, progress=False)
        return run

    def mean_force(step, state, seed):
        weight = step.step / 0.1 if step.time > 0.15 else 0.0
        seed.force[0] += weight
        return weight * state.force[0]

    run = recorded()
    gradient = run.gradient(mean_force)
    assert gradient.value == pytest.approx(FORCE, rel=0.01)
    assert gradient.velocity.sum() == pytest.approx(FORCE / 0.05, rel=0.01)
    assert gradient.stiffness == pytest.approx(FORCE / 2, rel=0.01) == gradient.mass  # F = v √(EA ρA)
    assert list(gradient.gaps) == [(0, 0, 0)] and gradient.friction == {}
    # Against differences of two runs whose bars are stretched by a little at the start.
    one, other = (recorded(stretch).gradient(mean_force).value for stretch in (1e-7, -1e-7))
    assert gradient.displacement @ np.linspace(0, 1, 41) == pytest.approx((one - other) / 2e-7, rel=1e-4)
    with pytest.raises(ZeroDivisionError):
        run.gradient(lambda step, state, seed: 1 / 0)
    with pytest.raises(cd.ContactDynamicsError, match="not recorded"):
        against_wall().gradient(mean_force)


def test_bar_on_a_spring_is_that_of_scipy():
    n, spring = 20, 2 * EA
    mass, stiffness = bar(n)

    def rate(_, state):
        u, v = np.split(state, 2)
        force = -(stiffness @ u)
        force[n] -= spring * max(u[n] - 0.005, 0.0)
        return np.concatenate([v, force / mass])

    times = np.linspace(0, 0.4, 401)
    start = np.concatenate([np.zeros(n + 1), np.full(n + 1, 0.05)])
    other = solve_ivp(rate, (0, 0.4), start, t_eval=times, rtol=1e-10, atol=1e-13).y
    law = {"name": "penalty", "stiffness": spring}
    result = against_wall(n, step=1e-4, law=law, scheme="trapezoidal", dofs=[0, n]).run(0.4, progress=False)
    assert abs(result.displacement[::10] - other[[0, n]].T).max() < 1e-4 * 0.02
    force = spring * np.maximum(other[n] - 0.005, 0.0)
    assert abs(result.contact_force[::10] - force).max() < 5e-3 * force.max()


def test_nonlinear_oscillator_is_that_of_scipy():
    system = cd.NonlinearSystem(
        np.array([2.0]),
        lambda u: 2 * u**3 + u,
        lambda u: sp.csc_matrix([[6 * u[0] ** 2 + 1]]),
        potential=lambda u: u[0] ** 4 / 2 + u[0] ** 2 / 2,
    )
    run = cd.Simulation(system, 1e-3, displacement=[1.0], dofs=[0], scheme="energy-momentum")
    result = run.run(5.0, progress=False)

    def rate(_, state):
        return [state[1], -(2 * state[0] ** 3 + state[0]) / 2]

    other = solve_ivp(rate, (0, 5), [1.0, 0.0], t_eval=result.times, rtol=1e-10, atol=1e-12)
    assert abs(result.displacement[:, 0] - other.y[0]).max() < 1e-5
    assert abs(result.total / result.total[0] - 1).max() < 1e-9


@pytest.mark.parametrize("kind", ["rows", "plane", "function", "sinking"])
def test_friction_stops_a_block_after_v2_over_2_mu_g(kind):
    def contacts(mu):
        if kind == "rows":
            return [cd.LinearRows().unilateral({1: 1.0}, 0.0, friction=mu, tangents=[{0: 1.0}])]
        floor = cd.Plane([0, 0], [0, 3])
        if kind == "function":
            floor = cd.SignedDistance(lambda x: x[1], lambda x: [0, 1])
        motion = (lambda t: [[0, -0.1 * t], [0, -0.1], [0, 0]]) if kind == "sinking" else None
        return [cd.NodesOnObstacle(floor, [[0.0, 0.0]], [0], friction=mu, motion=motion)]

    # A particle of 2 kg at the origin under gravity of 10 m/s², thrown along x.
    system = cd.LinearSystem([2.0, 2.0], FREE, load=[0.0, -20.0])
    down = -0.1 if kind == "sinking" else 0.0
    run = cd.Simulation(system, 0.01, contacts(0.25), velocity=[1.0, down], dofs=[0, 1])
    result = run.run(1.0, progress=False)
    assert result.displacement[-1, 0] == pytest.approx(0.2, abs=1e-12)
    assert result.friction_force[20] == pytest.approx(5.0, abs=1e-10)
    assert result.displacement[-1, 1] == pytest.approx(down, abs=1e-12)
    contact = run.contacts()[0]
    assert contact.status == "sticking" and contact.force == pytest.approx(20.0)
    assert run.contact_forces() == pytest.approx([0.0, 20.0], abs=1e-9)


def test_a_round_bowl_by_functions_is_the_one_of_the_library():
    def slide(bowl):
        contact = cd.NodesOnObstacle(bowl, [[0.0, -1.0]], [0])
        system = cd.LinearSystem([2.0, 2.0], FREE, load=[0.0, -20.0])
        return cd.Simulation(system, 1e-3, [contact], velocity=[1.0, 0.0]).run(0.5, progress=False).contact_force

    by_function = cd.SignedDistance(
        lambda x: 1 - np.hypot(*x), lambda x: -x / np.hypot(*x), lambda x, w: -((x[0] * w[1] - x[1] * w[0]) ** 2)
    )
    force = slide(cd.Sphere([0, 0], 1.0, inside=True))
    assert force[1] == pytest.approx(22.0, rel=1e-3)  # m (g + v²/R)
    assert slide(by_function) == pytest.approx(force, rel=1e-5)


def two_plates(cells=4, gap=0.01):
    """Two equal plates, the second above the first: coordinates, mass, stiffness, cells of both."""
    coordinates, mass, stiffness = plate(cells)
    at = np.arange((cells + 1) ** 2).reshape(cells + 1, cells + 1)
    quads = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], axis=-1).reshape(-1, 4)
    both = np.vstack([coordinates, coordinates + [0.03, 1 + gap]])
    return both, np.tile(mass, 2), sp.block_diag([stiffness, stiffness], format="csr"), [quads, quads + at.size]


def test_two_bodies_exchange_momentum():
    coordinates, mass, stiffness, (lower, upper) = two_plates()
    surfaces = [cd.outer_facets(coordinates, cells) for cells in (upper, lower)]
    assert [facets[0].shape for facets in surfaces] == [(16, 2), (16, 2)]
    contact = cd.BodyContact(coordinates, *surfaces, friction=0.1)
    velocity = np.zeros(mass.size)
    velocity[mass.size // 2 + 1 :: 2] = -1.0
    run = cd.Simulation(cd.LinearSystem(mass, stiffness), 1e-4, [contact], velocity=velocity, energy="balance")
    result = run.run(0.03, progress=False)
    momentum = (mass * run.velocity).reshape(2, -1, 2).sum(axis=1)
    assert result.contact_force.max() > 0.0
    assert momentum.sum(axis=0) == pytest.approx([0.0, -1000.0], abs=1e-8)
    assert momentum[0, 1] < -500.0  # the lower one has been struck downward
    assert result.total[-1] <= result.total[0]
    alone = cd.BodyContact(coordinates, surfaces[0] + surfaces[1])
    assert cd.Simulation(cd.LinearSystem(mass, stiffness), 1e-4, [alone]).contacts() is not None


def test_supports_loads_and_rows_that_move():
    # A spring of stiffness 9 between a driven dof and a mass of 1, statically slow; reaction and balance.
    stiffness = sp.csc_matrix([[9.0, -9.0], [-9.0, 9.0]])
    driven = {0: lambda t: (0.1, 0.0, 0.0)}
    system = cd.LinearSystem([1.0, 1.0], stiffness, rayleigh=(0.0, 0.1), load=lambda t: [0.0, 0.9], driven=driven)
    run = cd.Simulation(system, 0.01, displacement=[0.1, 0.1], start_at_rest=True)
    run.run(1.0, progress=False, record=False)
    assert run.displacement == pytest.approx([0.1, 0.2]) and run.reactions() == pytest.approx([-0.9])
    table = cd.LinearRows().unilateral({1: 1.0}, lambda t: (0.0, -0.5, 0.0) if t == 0 else (-0.5 * t, -0.5, 0.0))
    lifted = cd.Simulation(cd.LinearSystem([1.0, 1.0], FREE, fixed=[0]), 0.01, [table], velocity=[0.0, 0.5])
    lifted.run(1.0, progress=False)
    assert lifted.displacement[1] == pytest.approx(0.5)


def test_presets_bring_mass_and_correction():
    n = 50
    _, stiffness = bar(n)
    size = 10.0 / n
    consistent = sp.diags([np.full(n + 1, 4.0), np.ones(n), np.ones(n)], [0, 1, -1]).tolil() * (RHO_A * size / 6)
    consistent[0, 0] = consistent[n, n] = RHO_A * size / 3
    step = 0.5 * size / WAVE
    forces = {}
    for name in ("smooth", "conservative", "explicit"):
        mass = cd.preset_mass(name, consistent, stiffness, step, [n], np.zeros(n + 1, dtype=int))
        assert mass[n, n] == 0.0 and mass.sum() == pytest.approx(RHO_A * 10)
        wall = cd.LinearRows().unilateral({n: -1.0}, 0.005)
        options = {"scheme": name, "velocity": np.full(n + 1, 0.05)}
        result = cd.Simulation(cd.LinearSystem(mass, stiffness), step, [wall], **options).run(0.4, progress=False)
        assert result.total[-1] / result.total[0] == pytest.approx(1.0, abs=0.01)
        forces[name] = np.interp(0.2, result.times, result.contact_force)
    assert list(forces.values()) == pytest.approx([FORCE] * 3, rel=0.05)


def test_rows_hold_and_bonds_break():
    pulled = cd.LinearSystem([1.0, 1.0], FREE, load=lambda t: [10 * t, 0.0])
    tied = cd.Simulation(pulled, 0.01, [cd.LinearRows().equality({0: 1.0, 1: -1.0}, 0.0)])
    tied.run(1.0, progress=False)
    assert tied.displacement[0] == pytest.approx(tied.displacement[1], abs=1e-12)
    glued = cd.Simulation(pulled, 0.01, [cd.LinearRows().bond(4.999, {0: 1.0}, 0.0)])
    glued.run(1.0, progress=False)
    assert glued.velocity[0] == pytest.approx(5 * (1 - 0.5**2), abs=0.06)  # free from t = 0.5 s on, within a step


@pytest.mark.parametrize("body", [cd.Cuboid([0, -0.5], [2, 0.5], 0.1), cd.Sphere([0, -1], 1.0)])
def test_a_particle_comes_to_rest_on_a_body(body):
    contact = cd.NodesOnObstacle(body, [[0.0, 0.01]], [0], reach=0.1)
    run = cd.Simulation(cd.LinearSystem([2.0, 2.0], FREE, load=[0.0, -20.0]), 0.01, [contact])
    assert run.run(0.3, progress=False).contact_force[-1] == pytest.approx(20.0)
    assert run.displacement == pytest.approx([0.0, -0.01], abs=1e-12)


def test_overlaps_and_linear_solvers():
    with pytest.raises(cd.ContactDynamicsError, match="is violated at the start"):
        cd.Simulation(cd.LinearSystem([1.0, 1.0], FREE), 0.01, [cd.LinearRows().unilateral({0: 1.0}, -1e-3)])
    for overlap, expected in (("adjusted", 0.0), (0.5, 1e-3)):
        row = cd.LinearRows().unilateral({0: 1.0}, -1e-3)
        run = cd.Simulation(cd.LinearSystem([1.0], sp.eye(1) * 9.0), 0.01, [row], overlap=overlap)
        run.run(1.0, progress=False)
        assert run.displacement[0] == pytest.approx(expected, abs=1e-12)
    forces = [
        against_wall(linear_solver=name).run(0.2, progress=False).contact_force[-1]
        for name in ("automatic", "cholesky", "lu", "conjugate-gradients", "by-body")
    ]
    assert forces == pytest.approx([forces[0]] * 5, rel=1e-6)


def test_a_cube_lands_on_a_cube():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    coordinates = np.vstack([np.column_stack([square, np.full(4, z)]) for z in (0.0, 1.0, 1.1, 2.1)])
    upper, lower = (cd.outer_facets(coordinates, [np.arange(8) + first]) for first in (8, 0))
    assert upper[0].shape == (6, 4) and upper[0].min() == 8
    system = cd.LinearSystem(np.ones(48), sp.csr_matrix((48, 48)), fixed=np.arange(24))
    velocity = np.zeros(48)
    velocity[26::3] = -1.0
    run = cd.Simulation(system, 0.01, [cd.BodyContact(coordinates, upper, lower, friction=0.5)], velocity=velocity)
    run.run(0.2, progress=False)
    landed = run.displacement.reshape(4, 4, 3)[2]
    assert landed == pytest.approx(np.tile([0.0, 0.0, -0.1], (4, 1)), abs=1e-9)
    assert {contact.status for contact in run.contacts()} & {"touching", "closed", "sticking"}
