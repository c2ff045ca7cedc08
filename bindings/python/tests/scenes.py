"""Scenes of the tests and of bench.py, assembled with NumPy and SciPy."""

import numpy as np
import scipy.sparse as sp

EA, RHO_A, LENGTH = 25.0, 0.0025, 10.0
WAVE = np.sqrt(EA / RHO_A)
FORCE = 0.05 * np.sqrt(EA * RHO_A)  # ρ c A v at a rigid wall with v = 0.05


def bar(n):
    """Lumped mass and stiffness of a bar of n linear elements."""
    size = LENGTH / n
    diagonal = np.full(n + 1, 2.0)
    diagonal[[0, -1]] = 1.0
    stiffness = sp.diags([diagonal, -np.ones(n), -np.ones(n)], [0, 1, -1], format="csr") * (EA / size)
    return 0.5 * RHO_A * size * diagonal, stiffness


def plate(cells, young=1e7, poisson=0.3, density=1000.0):
    """A unit square of cells² bilinear elements in plane stress: coordinates, lumped mass, stiffness."""
    side, nodes = 1.0 / cells, (cells + 1) ** 2
    at = np.arange(nodes)
    coordinates = side * np.column_stack([at % (cells + 1), at // (cells + 1)])
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    quads = corner[:, None] + np.array([0, 1, cells + 2, cells + 1])
    law = young / (1 - poisson**2) * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    element = np.zeros((8, 8))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for x, y in signs / np.sqrt(3):
        slopes = signs * (1 + signs[:, ::-1] * [y, x]) / (2 * side)
        strain = np.zeros((3, 8))
        strain[0, ::2] = strain[2, 1::2] = slopes[:, 0]
        strain[1, 1::2] = strain[2, ::2] = slopes[:, 1]
        element += side**2 / 4 * strain.T @ law @ strain
    dofs = (2 * quads[:, :, None] + [0, 1]).reshape(-1, 8)
    rows, columns = np.repeat(dofs, 8, axis=1).ravel(), np.tile(dofs, 8).ravel()
    shape = (2 * nodes, 2 * nodes)
    stiffness = sp.coo_matrix((np.tile(element.ravel(), len(quads)), (rows, columns)), shape).tocsr()
    mass = np.bincount(dofs.ravel(), minlength=2 * nodes) * density * side**2 / 4
    return coordinates, mass, stiffness
