"""2-D flows as pyvista meshes."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import zoom

from surrogate.arrays import AnyArray
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.output.meshes import pv
from surrogate.flow.surface.forces_2d import vorticity

Velocity = Float[AnyArray, "2 nx ny"]


def flow_mesh(lattice: Lattice, velocity: Velocity, refined: int = 1) -> pv.ImageData:
    """Return vorticity and stream function at the cell corners of an unfolded lattice as a mesh.

    The outermost corners, where differences wrap around, are left out. Cubic splines refine the
    mesh by the factor ``refined``, for smooth lines.
    """
    u, v = np.asarray(velocity)
    (x, _), (_, y) = lattice.faces()
    dx, dy = lattice.step
    lowest = -np.cumsum(v[:, 0]) * dx
    stream = lowest[:, None] + np.cumsum(np.pad(u[:, 1:], ((0, 0), (1, 0))), axis=1) * dy
    stream -= stream[lattice.inlet - 1, lattice.shape[1] // 2 - 1]  # the body is at zero
    shape = [refined * (count - 3) + 1 for count in lattice.shape]
    mesh = pv.ImageData(
        dimensions=(*shape, 1),
        spacing=(dx / refined, dy / refined, 1),
        origin=(x[1], y[1], 0),
    )
    for name, field in (("vorticity", vorticity(lattice, velocity)), ("stream function", stream)):
        inner = np.asarray(field)[1:-1, 1:-1]
        scale = np.divide(shape, inner.shape)
        mesh[name] = (zoom(inner, scale, order=3) if refined > 1 else inner).T.ravel()
    return mesh
