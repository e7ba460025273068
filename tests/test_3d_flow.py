"""3-D flows: kernel, golden drags, order of convergence, gradients, error estimate, refusals."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ROUGH_3D
from correlations import ellipsoid, oberbeck
from scipy.interpolate import RegularGridInterpolator

from surrogate import Family, Fidelity, Flow, InvalidInput, Scene, family_shape
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.oseen_3d import space_kernel
from surrogate.flow.solver.newton import NewtonSettings

FAMILY = Family(dimension=3)
SCENE = Scene(dimension=3, reynolds=(0.01, 100), fidelity=ROUGH_3D)
FLOW = Flow(SCENE, NewtonSettings(1e-10, 30, 60, linear_tolerance=1e-9))
DRAFT = Flow(dataclasses.replace(SCENE, fidelity="draft"))
BODY = np.array([1.6, 1.3, 0.1, 0.05, -0.03])
SPHERE = family_shape({"aspect": 1.0}, dimension=3)


@pytest.mark.parametrize("reynolds", [0.1, 40.0])
def test_exact_kernel_solves_the_discrete_oseen_equations(reynolds):
    """Momentum without its gradient part, and mass, on every face inside the domain."""
    lattice = Lattice((36, 10, 10), (0.2,) * 3, 12, folded=(1, 2))
    force = np.zeros((3, *lattice.shape))
    force[:, 8:20, :6, :6] = np.random.default_rng(0).normal(size=(3, 12, 6, 6))
    velocity = space_kernel(lattice, jnp.asarray(reynolds))(jnp.asarray(force))
    u, f = (np.asarray(lattice.unfold(field)) for field in (velocity, force))
    h, inside = 0.2, (slice(3, -3),) * 3

    def shifted(field, axis, cells):
        return np.roll(field, -cells, axis)

    divergence = sum((u[i] - shifted(u[i], i, -1)) / h for i in range(3))
    assert np.abs(divergence[inside]).max() * h < 1e-6 * np.abs(u).max()
    rest = [
        f[c]
        - (shifted(u[c], 0, 1) - shifted(u[c], 0, -1)) / (2 * h)
        + sum(shifted(u[c], i, 1) - 2 * u[c] + shifted(u[c], i, -1) for i in range(3))
        / (h**2 * reynolds)
        for c in range(3)
    ]
    for a, b in ((0, 1), (1, 2), (0, 2)):
        curl = shifted(rest[b], a, 1) - rest[b] - shifted(rest[a], b, 1) + rest[a]
        assert np.abs(curl[inside]).max() < 1e-6 * np.abs(f).max()


@pytest.mark.slow
def test_order_of_the_drag_in_stokes_flow_is_near_three():
    """With the slip law at the wall, of a flattened ellipsoid (Oberbeck 1876)."""
    body = family_shape({"aspect": 2.0, "flatness": 2.0}, dimension=3)

    def error(cells):
        """In a domain that holds little more than the body, of which this flow is independent."""
        fidelity = Fidelity("near", cells, 2.0, 2.5, 3.5, wake=0.0)
        found = Flow(Scene(dimension=3, fidelity=fidelity)).solve(body, 0.01, estimate=False)
        return found.drag / oberbeck(ellipsoid(2, 2), 0.01) - 1

    coarse, fine = error(6), error(10)
    assert 0 < fine < coarse / (10 / 6) ** 2.7, f"errors {coarse:.2e}, {fine:.2e}"


@pytest.mark.parametrize(("aspect", "flatness"), [(1, 1), (2, 1), (0.7, 2), (2, 2)])
def test_golden_ellipsoids_in_stokes_flow(aspect, flatness):
    """Oberbeck 1876, Brenner 1961; the error tolerance of draft is 2 %."""
    body = jnp.array([aspect, flatness, 0.0, 0.0, 0.0])
    assert float(DRAFT.drag(body, 0.01)) == pytest.approx(
        oberbeck(ellipsoid(aspect, flatness), 0.01), rel=0.01
    )


@pytest.fixture(scope="module")
def slow():
    """The flow past a sphere at Re 0.01."""
    return DRAFT.solve(SPHERE, 0.01, estimate=False)


def test_pressure_of_slow_flow_is_that_of_stokes(slow):
    """Past a sphere p = -3 x / (4 Re r^3), where the head is far from the stream's."""
    found = RegularGridInterpolator((slow.x, slow.y, slow.z), slow.p)
    for x in (-1.4, -1.1, 1.1, 1.4):
        point = np.array([[x, 0.3, -0.2]])
        expected = -0.75 * x / (0.01 * np.linalg.norm(point) ** 3)
        assert found(point)[0] == pytest.approx(expected, rel=0.05)


def test_forces_in_newtons(slow):
    forces = slow.forces(speed=0.3, diameter=1e-3, density=1.2)
    assert forces.drag == pytest.approx(slow.drag * 0.5 * 1.2 * 0.3**2 * np.pi / 4 * 1e-6)


@pytest.mark.parametrize(("reynolds", "drag"), [(1, 27.3175), (40, 1.7891), (100, 1.0881)])
def test_golden_sphere(reynolds, drag):
    """Axisymmetric elements; the error tolerance of draft is 2 %."""
    found = float(DRAFT.drag(FAMILY.ellipse(1.0), float(reynolds)))
    assert found == pytest.approx(drag, rel=0.01)


@pytest.mark.slow
def test_golden_disc_at_re_100():
    """Axisymmetric elements; slip law or retraction alone would be 1 % off."""
    found = Flow(Scene(dimension=3)).solve(
        family_shape({"aspect": 0.5}, dimension=3), 100.0, estimate=False
    )
    assert found.drag == pytest.approx(1.6092, rel=0.003)


def test_width_and_height_may_change_places():
    """A body turned on its side has the same drag."""
    family = Family(dimension=3, aspect=(1, 2), flatness=(0.5, 2))
    flow = Flow(dataclasses.replace(SCENE, reynolds=(1, 40), family=family))
    drag = jax.jit(flow.drag)
    wide, high = (float(drag(jnp.array([1.5, flatness]), 20.0)) for flatness in (1.6, 1 / 1.6))
    assert high == pytest.approx(wide, rel=1e-5)
    assert np.isnan(drag(jnp.array([12.0, 1.0]), 20.0))  # larger than the scene's bodies


@pytest.mark.slow
def test_taylor_remainders_of_the_drag_are_of_second_order():
    """In shape and Re together."""
    direction, rate = jnp.array([0.3, 0.2, -0.1, 0.1, 0.1]), 3.0
    body, re = jnp.asarray(BODY), jnp.asarray(30.0)
    drag, (slope, by_re) = jax.value_and_grad(FLOW.drag, (0, 1))(body, re)
    along = slope @ direction + by_re * rate
    remainders = [
        abs(float(FLOW.drag(body + e * direction, re + e * rate) - drag - e * along))
        for e in (0.1, 0.05, 0.025)
    ]
    orders = np.log2(np.divide(remainders[:-1], remainders[1:]))
    assert np.all(orders > 1.9), remainders


def test_nothing_recompiles_for_another_body(compilations):
    body = FAMILY.ellipse(1.5)
    DRAFT.drag(body, 30.0)
    compilations.clear()
    DRAFT.drag(body * 1.01, 31.0)
    assert compilations == []


def test_what_the_scene_or_its_grid_cannot_take_is_refused():
    with pytest.raises(InvalidInput, match="5 parameters are needed"):
        FLOW.drag([1.0, 1.0], 10.0)
    with pytest.raises(InvalidInput, match="larger than those"):
        FLOW.drag([12.0, 1.0, 0, 0, 0], 10.0)
    with pytest.raises(InvalidInput, match="dimension 2"):
        FLOW.solve(family_shape({"aspect": 1.0}), 10.0)
    with pytest.raises(InvalidInput, match="too large"):
        DRAFT.solve(family_shape({"aspect": 9.0}, dimension=3), 10.0)
    fine = dataclasses.replace(ROUGH_3D, cells=100)
    with pytest.raises(InvalidInput, match="million cells"):
        Flow(Scene(dimension=3, fidelity=fine)).drag(BODY, 10.0)


@pytest.mark.parametrize("flatness", [5.0, 0.2])
def test_bodies_too_thin_for_the_grid_are_refused_however_they_lie(flatness):
    thin = family_shape({"aspect": 4.0, "flatness": flatness}, dimension=3)
    with pytest.raises(InvalidInput, match=r"mean thickness is 1\.73 cells"):
        DRAFT.solve(thin, 10.0)


@pytest.mark.slow
def test_a_body_on_its_side_has_the_same_error_estimate():
    bodies = ({"aspect": 0.5, "flatness": flatness} for flatness in (2.0, 0.5))
    wide, high = (DRAFT.solve(family_shape(body, dimension=3), 10.0) for body in bodies)
    assert (wide.status, wide.sufficient) == (high.status, high.sufficient)
    assert wide.estimated_error == pytest.approx(high.estimated_error, rel=1e-3)


@pytest.mark.parametrize(("aspect", "onset"), [(1.0, 210), (0.5, 121)])
def test_flows_beyond_the_onset_of_shedding_of_a_body_must_be_asked_for(aspect, onset):
    """The rule for these onsets was fitted to finite elements, study ``onset``."""
    body = family_shape({"aspect": aspect}, dimension=3)
    with pytest.raises(InvalidInput, match=rf"beyond {onset}\b.* allow_unsteady "):
        DRAFT.solve(body, 1.05 * onset)


@pytest.mark.slow
def test_traced_drags_know_the_onset_of_shedding_of_every_body():
    family = Family(dimension=3, aspect=(0.5, 2))
    flow = Flow(Scene(reynolds=(1, 150), family=family, fidelity=ROUGH_3D))
    drags = jax.jit(jax.vmap(flow.drag))(jnp.array([[0.5], [2.0]]), jnp.full(2, 150.0))
    assert np.isnan(drags).tolist() == [True, False]


@pytest.mark.slow
def test_the_error_estimate_of_the_sphere_covers_its_error():
    found = DRAFT.solve(SPHERE, 10.0)
    assert found.status == "accurate"
    assert abs(found.drag / 4.3079 - 1) < found.estimated_error < 0.05


@pytest.mark.slow
def test_pressure_and_friction_on_the_sphere():
    """By axisymmetric elements 1.527 and 2.781; extrapolated from cells off a coarse wall."""
    found = DRAFT.solve(SPHERE, 10.0, estimate=False)
    skin = found.markers
    points, areas = np.asarray(skin.points), np.asarray(skin.areas)
    loads, weights = found.skin_loads(points, areas), found.domain.modes.weights(skin.nodes)
    nose, tail = np.argmin(points[:, 0]), np.argmax(points[:, 0])
    assert loads.cp[nose] > 1 > 0 > loads.cp[tail]  # above 1 at a finite Reynolds number
    size = np.linalg.norm(areas, axis=1)
    pressure = -16 / np.pi * weights @ (loads.cp * areas[:, 0])
    friction = 16 / np.pi * weights @ (np.asarray(loads.friction)[:, 0] * size)
    assert found.drag_pressure == pytest.approx(pressure)
    assert pressure == pytest.approx(1.527, rel=0.15)
    assert friction == pytest.approx(2.781, rel=0.25)
