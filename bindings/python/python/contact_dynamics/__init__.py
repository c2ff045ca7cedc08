"""Time integration of finite-element models with unilateral contact, without spurious oscillation at impact.

You bring mass and stiffness as sparse matrices of SciPy, and the places where bodies may touch::

    import contact_dynamics as cd

    bar = cd.LinearSystem(M, K)
    wall = cd.LinearRows().unilateral({n: -1.0}, gap=0.005)
    run = cd.Simulation(bar, 1e-3, [wall], velocity=v)
    result = run.run(0.4)
    cd.plot(result)

Units are those of the model, in any consistent system. Contact forces are positive in compression, gaps are positive
between bodies that are apart. Arrays with wrong shapes or numbers raise ValueError, everything else that the library
refuses raises ContactDynamicsError.
"""

from ._core import ContactDynamicsError, Inadmissible, outer_facets, preset_mass
from .contacts import BodyContact, Cuboid, LinearRows, NodesOnObstacle, Plane, SignedDistance, Sphere
from .gradient import Gradient
from .result import Result, plot
from .simulation import Contact, Simulation
from .systems import LinearSystem, NonlinearSystem

__all__ = ["BodyContact", "Contact", "ContactDynamicsError", "Cuboid", "Gradient", "Inadmissible", "LinearRows"]
__all__ += ["LinearSystem", "NodesOnObstacle", "NonlinearSystem", "Plane", "Result", "SignedDistance", "Simulation"]
__all__ += ["Sphere", "outer_facets", "plot", "preset_mass"]
