"""Errors of the Green's functions: by their quadrature in 2-D, by their fit in 3-D."""

import functools
import inspect
from collections.abc import Iterator
from unittest import mock

import jax.numpy as jnp
import numpy as np
from study import Run

from surrogate.flow.grid import oseen_2d, oseen_3d
from surrogate.flow.grid.lattice import Lattice

FINEST = (32, 26, 2.0)  # nodes, panels, ratio: every panel of the solver's quadrature in two
STEP = 1 / 16  # cell size in D
waves = oseen_2d._unbounded_waves
_, *SETTINGS = inspect.signature(waves).parameters.values()  # nodes, panels, ratio
QUADRATURE = tuple(setting.default for setting in SETTINGS)
QUADRATURES = *((nodes, 13, 4.0) for nodes in (6, 9, 12, 16)), (12, 7, 4.0), (12, 13, 2.0)
FIT = 0.3, oseen_3d.SINGULAR_CUT, oseen_3d.BETAS.size  # step of ln t, relative cut, points
FITS = *((step, 1e-13, 1000) for step in (0.15, 0.3, 0.6)), (0.3, 1e-11, 1000)
FITS += (0.3, 1e-15, 1000), (0.3, 1e-13, 500)


def quadrature_errors(run: Run, value: tuple[int, int, float]) -> Iterator[float]:
    """Yield relative errors of a point force's velocity in 2-D, by nodes, panels and ratio."""
    for re in run.pick((1.0,), (1e-3, 1.0, 40.0, 300.0)):
        exact = _velocity(re, FINEST)
        yield float(abs(_velocity(re, value) - exact).max() / abs(exact).max())


@functools.cache
def _velocity(reynolds, choice):
    """Return the velocity of a force on the axis, in the upper half of the standard domain."""
    shape = round(18 / STEP), round(4 / STEP)
    lattice = Lattice(shape, (STEP, STEP), round(6 / STEP), folded=(1,))
    force = jnp.zeros((2, *shape)).at[:, lattice.inlet, 0].set(1.0)
    settings = {one.name: value for one, value in zip(SETTINGS, choice, strict=True)}
    with mock.patch.object(oseen_2d, "_unbounded_waves", functools.partial(waves, **settings)):
        return oseen_2d.oseen_kernel(lattice, jnp.asarray(reynolds), None)(force)


def fit_errors(run: Run, value: tuple[float, float, int]) -> Iterator[float]:
    """Yield relative errors of sigma^-1 and G_xx on the axis, by the constants of the fit.

    The reference is quadrature over both wave numbers across, of columns in closed form.
    """
    lattice = Lattice((24, 1, 1), (STEP,) * 3, 8, folded=(1, 2))
    theta, weight = waves(8)
    beta = np.add.outer(*[4 * np.sin(theta / 2) ** 2] * 2).ravel()
    area = np.outer(weight, weight).ravel()
    areas = {0.5: area, 1.5: beta * area}  # by the power that weights the fit of each
    spacing, cut, count = value
    times = np.append(0.0, np.exp(np.arange(-5.0, 31.0, spacing)))
    betas = np.exp(np.linspace(-32.0, np.log(8.0), count))
    decay = np.exp(-np.outer(times, beta))
    with mock.patch.multiple(oseen_3d, TIMES=times, BETAS=betas, SINGULAR_CUT=cut):
        fits = [oseen_3d._exponentials.__wrapped__(power) for power in areas]
    for re in map(jnp.asarray, run.pick((1.0,), (0.1, 1.0, 100.0))):
        columns = [oseen_2d.sequences(lattice, re, points) for points in (beta, betas)]
        for area, (weights, left, right), column, known in zip(
            areas.values(), fits, *columns, strict=True
        ):
            gap = (((known * weights) @ left) @ right) @ decay - column
            yield float(abs(gap @ area).max() / abs(column @ area).max())
