"""The response to the far field's momentum flux as a polynomial of the body's force."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ROUGH_3D

from surrogate import Fidelity, Unbounded, family_shape
from surrogate.flow.grid import far
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.flow.grid.domain_3d import Domain3D

SMALL = Fidelity("small", 4, 2, 4, 4, 3)
FORCE = jnp.array([-0.9, 0.4])  # drag and lift on the fluid


def domain(symmetric=False):
    """A coarse domain whose far field is one lattice of 24 by 24 D, to third order."""
    whole = Domain2D.make(Unbounded(), SMALL, (1.0, 1.0), symmetric)
    coarse = dataclasses.replace(
        whole.far[0], shape=(48, 24 if symmetric else 48), inlet=16, periodic=False
    )
    return dataclasses.replace(whole, far=(coarse,), far_order=3)


@functools.partial(jax.jit, static_argnames="domain")
def velocity(domain, force, reynolds=10.0):
    response = far.far_response(domain, jnp.asarray(reynolds))
    return far.far_velocity(response, force, far.far_powers(domain))


@pytest.mark.parametrize("force", [FORCE, FORCE * jnp.array([1.0, 0.0]), FORCE[::-1]])
def test_exact_series_is_the_flux_of_its_first_two_terms(force):
    """Its flux is that of u_1 + u_2 less that of u_2 alone, which is of fourth order."""
    whole = domain()
    (coarse,) = whole.far
    green = whole.green_function(coarse, jnp.asarray(10.0))
    inner = whole.lattice.profile(coarse.faces(), 1.0)
    outer = np.maximum(coarse.cutoff(far.BLENDING_CELLS * coarse.step[0]), inner)
    center = [round(coarse.inlet), coarse.shape[1] // 2]
    density = sum(
        component * far._unit_force(coarse, axis, 1.0) for axis, component in enumerate(force)
    )
    first = green(density)
    assert float(jnp.abs(first[:, center[0], center[1]]).max()) > 0.05
    second = green(coarse.convect(outer * first))

    def flux(u):
        return coarse.convect(outer * u) - coarse.convect(inner * u)

    refine = far.refinement(whole.lattice, coarse)
    expected = refine(green(flux(first + second) - flux(second)))
    size = float(jnp.abs(expected).max())
    np.testing.assert_allclose(velocity(whole, force), expected, atol=1e-10 * size)
    quadratic = dataclasses.replace(whole, far_order=2)
    assert float(jnp.abs(velocity(quadratic, force) - expected).max()) > 0.01 * size


def test_symmetric_domains_have_the_terms_of_the_drag_alone():
    """On the upper half, and as the upper half of the whole."""
    half, whole = domain(symmetric=True), domain()
    assert far.far_powers(half) == [(2,), (3,)]
    drag = FORCE * jnp.array([1.0, 0.0])
    found, expected = velocity(half, drag), velocity(whole, drag)
    rows = half.lattice.shape[1]
    size = float(jnp.abs(expected).max())
    np.testing.assert_allclose(found[0], expected[0, :, rows:], atol=1e-6 * size)


def test_lift_of_the_other_sign_is_the_mirror_image():
    up, down = (velocity(domain(), FORCE * jnp.array([1.0, sign])) for sign in (1.0, -1.0))
    size = float(jnp.abs(up).max())
    np.testing.assert_array_equal(down[0, :, ::-1], up[0])
    assert float(jnp.abs(down - up).max()) > 0.1 * size


def test_single_precision_is_enough_in_3d(monkeypatch):
    whole = fitted_domain(Unbounded(), ROUGH_3D, family_shape({"aspect": 1.0}, dimension=3), 10.0)
    re = jnp.asarray(10.0)
    found = jax.jit(lambda re: far.far_response(whole, re))(re)
    monkeypatch.setattr(Domain3D, "FAR_PRECISION", jnp.float64)
    expected = jax.jit(lambda re: far.far_response(whole, re))(re)
    size = float(jnp.abs(expected).max())
    assert 0 < float(jnp.abs(found - expected).max()) < 1e-5 * size
