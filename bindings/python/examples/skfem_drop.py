"""A disc that scikit-fem has assembled is thrown at a plane with friction, and written to VTU files by meshio.

python skfem_drop.py [FOLDER]; in ParaView open the series and apply Warp By Vector.
"""

import sys
from pathlib import Path

import contact_dynamics as cd
import meshio
import numpy as np
from skfem import Basis, BilinearForm, ElementTriP1, ElementVector, MeshTri
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

RADIUS, HEIGHT = 0.1, 1e-3  # m; height over the plane
YOUNG, POISSON, DENSITY = 1e7, 0.3, 1000.0  # Pa, –, kg/m³; 1 m thick, plane strain
VELOCITY, GRAVITY, FRICTION = (2.0, -1.0), (0.0, -9.81), 0.2


def main(folder: Path, refine: int = 4, files: int = 20):
    mesh = MeshTri.init_circle(refine).scaled(RADIUS).translated((0.0, RADIUS + HEIGHT))
    basis = Basis(mesh, ElementVector(ElementTriP1()))
    stiffness = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
    consistent = DENSITY * BilinearForm(lambda u, v, _: dot(u, v)).assemble(basis)
    mass = np.asarray(consistent.sum(axis=1)).ravel()
    dofs = basis.nodal_dofs.T  # (nodes, 2)
    weight, velocity = np.zeros_like(mass), np.zeros_like(mass)
    for axis in range(2):
        weight[dofs[:, axis]] = GRAVITY[axis] * mass[dofs[:, axis]]
        velocity[dofs[:, axis]] = VELOCITY[axis]

    floor = cd.Plane([0, 0], [0, 1])
    contact = cd.NodesOnObstacle(floor, mesh.p.T, mesh.boundary_nodes(), dofs=dofs, friction=FRICTION)
    disc = cd.LinearSystem(mass, stiffness, rayleigh=(0.0, 1e-6), load=weight)
    run = cd.Simulation(disc, 1e-5, [contact], velocity=velocity, energy="balance")

    folder.mkdir(parents=True, exist_ok=True)
    points = np.pad(mesh.p.T, ((0, 0), (0, 1)))
    for number in range(files + 1):
        result = run.run(number * 0.015 / files)
        fields = {"displacement": run.displacement, "velocity": run.velocity, "contact force": run.contact_forces()}
        data = {name: np.pad(field[dofs], ((0, 0), (0, 1))) for name, field in fields.items()}
        meshio.Mesh(points, [("triangle", mesh.t.T)], data).write(folder / f"disc_{number:03}.vtu")
    momentum = np.array([(mass * (run.velocity - velocity))[dofs[:, axis]].sum() for axis in range(2)])
    momentum -= np.array([weight[dofs[:, axis]].sum() for axis in range(2)]) * run.time
    return result, momentum


if __name__ == "__main__":
    result, (along, up) = main(Path(sys.argv[1] if len(sys.argv) > 1 else "output/skfem_drop"))
    print(f"largest force {result.contact_force.max():.1f} N; impulse {up:.3f} Ns up, {along:.3f} Ns along")
    for name, work in result.works.items():
        print(f"  {name:<11} {work[-1] / result.total[0]:+.5f} of the energy at the start")
