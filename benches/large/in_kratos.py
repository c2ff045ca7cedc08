# The scene of `cargo bench --bench large -- flat` by Kratos (pip install KratosContactStructuralMechanicsApplication):
# a slab of cubes that falls on a flat floor, with weighted gaps by an augmented Lagrangian. What is not set below is
# as Kratos sets it: Bossak's scheme, a consistent mass, the linear solver, all threads.
#
#   python benches/large/in_kratos.py [cells a side]…
import json
import os
import sys
import tempfile
import time

# Kratos tells much.
output = os.fdopen(os.dup(1), "w")
os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

import KratosMultiphysics as Kratos
import KratosMultiphysics.ContactStructuralMechanicsApplication
import KratosMultiphysics.StructuralMechanicsApplication
import numpy as np
from KratosMultiphysics.StructuralMechanicsApplication import structural_mechanics_analysis

SPEED = 0.01


def mesh(cells, layers, gap):
    """A slab above a floor of the same facets."""
    n = cells + 1
    node = lambda x, y, z: 1 + x + n * (y + n * z)
    floor = 1 + n * n * (layers + 1)
    nodes = [(node(x, y, z), x, y, z + gap) for z in range(layers + 1) for y in range(n) for x in range(n)]
    nodes += [(floor + x + n * y, x, y, 0) for y in range(n) for x in range(n)]
    square = lambda x, y: [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
    plan = [square(x, y) for y in range(cells) for x in range(cells)]
    hexahedra = [[node(*c, z) for c in four] + [node(*c, z + 1) for c in four] for z in range(layers) for four in plan]
    # Normals point out of the slab, and out of the floor.
    under = [[node(*c, 0) for c in reversed(four)] for four in plan]
    above = [[floor + x + n * y for x, y in four] for four in plan]

    def block(name, rows):
        return f"Begin {name}\n" + "\n".join(" ".join(map(str, row)) for row in rows) + f"\nEnd {name.split()[0]}\n\n"

    def part(name, nodes, elements, conditions):
        text = f"Begin SubModelPart {name}\n"
        for kind, ids in (("Nodes", nodes), ("Elements", elements), ("Conditions", conditions)):
            text += f"Begin SubModelPart{kind}\n" + "\n".join(map(str, ids)) + f"\nEnd SubModelPart{kind}\n"
        return text + "End SubModelPart\n\n"

    count = len(under)
    numbered = lambda rows, first: [(first + k, 0, *row) for k, row in enumerate(rows)]
    return (
        "Begin Properties 0\nEnd Properties\n\n"
        + block("Nodes", nodes)
        + block("Elements SmallDisplacementElement3D8N", numbered(hexahedra, 1))
        + block("Conditions SurfaceCondition3D4N", numbered(under + above, 1))
        + part("Slab", range(1, floor), range(1, len(hexahedra) + 1), [])
        + part("Under", sorted({k for row in under for k in row}), [], range(1, count + 1))
        + part("Floor", range(floor, floor + n * n), [], range(count + 1, 2 * count + 1))
    )


def settings(folder, h, end):
    material = {
        "model_part_name": "Structure.Slab",
        "properties_id": 0,
        "Material": {
            "constitutive_law": {"name": "LinearElastic3DLaw"},
            "Variables": {"DENSITY": 1.0, "YOUNG_MODULUS": 1.0, "POISSON_RATIO": 0.0},
            "Tables": {},
        },
    }
    with open(f"{folder}/materials.json", "w") as file:
        json.dump({"properties": [material]}, file)
    held = {
        "python_module": "assign_vector_variable_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": {
            "model_part_name": "Structure.Floor",
            "variable_name": "DISPLACEMENT",
            "value": [0.0, 0.0, 0.0],
            "constrained": [True, True, True],
            "interval": [0.0, "End"],
        },
    }
    contact = {
        "python_module": "alm_contact_process",
        "kratos_module": "KratosMultiphysics.ContactStructuralMechanicsApplication",
        "process_name": "ALMContactProcess",
        "Parameters": {
            "model_part_name": "Structure",
            "contact_model_part": {"0": ["Under", "Floor"]},
            "assume_master_slave": {"0": ["Under"]},
            "contact_type": "Frictionless",
        },
    }
    return Kratos.Parameters(
        json.dumps(
            {
                "problem_data": {
                    "problem_name": "slab",
                    "parallel_type": "OpenMP",
                    "start_time": 0.0,
                    "end_time": end,
                    "echo_level": 0,
                },
                "solver_settings": {
                    "model_part_name": "Structure",
                    "solver_type": "Dynamic",
                    "domain_size": 3,
                    "echo_level": 0,
                    "analysis_type": "non_linear",
                    "model_import_settings": {"input_type": "mdpa", "input_filename": f"{folder}/slab"},
                    "material_import_settings": {"materials_filename": f"{folder}/materials.json"},
                    "time_stepping": {"time_step": h},
                    "contact_settings": {"mortar_type": "ALMContactFrictionless"},
                    "convergence_criterion": "contact_residual_criterion",
                    "max_iteration": 20,
                },
                "processes": {"held": [held], "contact": [contact]},
            }
        )
    )


class Fall(structural_mechanics_analysis.StructuralMechanicsAnalysis):
    """Times the steps, and keeps the momentum after each."""

    def Initialize(self):
        super().Initialize()
        slab = self.model["Structure.Slab"]
        for node in slab.Nodes:
            for step in range(2):
                node.SetSolutionStepValue(Kratos.VELOCITY_Z, step, -SPEED)
        self.times, self.forces = [], []

    def momentum(self, cells, layers):
        variable = Kratos.VariableUtils()
        slab = self.model["Structure.Slab"]
        speeds = np.array(variable.GetSolutionStepValuesVector(slab.Nodes, Kratos.VELOCITY, 0, 3)).reshape(-1, 3)
        shares = [np.r_[0.5, np.ones(count - 1), 0.5] for count in (layers, cells, cells)]
        return np.einsum("i,j,k->ijk", *shares).ravel() @ speeds[:, 2]

    def run(self, cells, layers, h, steps):
        self.Initialize()
        last = start = self.momentum(cells, layers)
        for _ in range(steps):
            begin = time.perf_counter()
            self.time = self._AdvanceTime()
            self.InitializeSolutionStep()
            self._GetSolver().Predict()
            self._GetSolver().SolveSolutionStep()
            self.FinalizeSolutionStep()
            self.times.append(time.perf_counter() - begin)
            now = self.momentum(cells, layers)
            self.forces.append((now - last) / (h * SPEED * cells**2))
            last = now
        return now / -start


def run(cells, h):
    layers = -(-3 * cells // 10)
    with tempfile.TemporaryDirectory() as folder:
        with open(f"{folder}/slab.mdpa", "w") as file:
            file.write(mesh(cells, layers, 1.5 * SPEED * h))
        steps = round(3 * layers / h)
        fall = Fall(Kratos.Model(), settings(folder, h, steps * h))
        rebound = fall.run(cells, layers, h, steps)
    forces, times = np.array(fall.forces), np.array(fall.times)
    closed = np.abs(forces) > 0.01
    dofs = 3 * (cells + 1) ** 2 * (layers + 1)
    print(
        f"{dofs:8} {h:8} {np.median(times[~closed]):8.4f} {np.median(times[closed]):8.4f} {rebound:8.3f} "
        f"{forces[closed].mean():11.3f} {forces.max():14.3f}",
        file=output,
        flush=True,
    )


version = Kratos.KratosGlobals.Kernel.Version().split("--")[0].replace('"', "")
print(f"Kratos {version}", file=output)
print("    dofs  Courant  open, s  step, s  rebound  mean force  largest force", file=output, flush=True)
for cells in [int(word) for word in sys.argv[1:]] or [10, 20]:
    # (With a tenth of the step twenty cells a side take more than twenty minutes.)
    for h in [0.1, 1.0] if cells <= 10 else [1.0]:
        run(cells, h)
