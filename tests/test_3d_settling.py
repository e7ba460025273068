"""Particles that settle: Stokes, Oseen and the correlation of spheres; what is refused."""

import numpy as np
import pytest
from conftest import ROUGH_3D
from correlations import Ellipsoid, ellipsoid, oberbeck

from shapeopt.commands.solve_drag import turns_when_free
from surrogate import Flow, InvalidInput, Particle, Scene, family_shape, settle
from surrogate.flow.settling import sphere_reynolds

DRAFT = Flow(Scene(dimension=3, reynolds=(0.01, 100), fidelity="draft"))
SPHERE = family_shape({"aspect": 1.0}, dimension=3)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-6, 2e-5, 3e-5])
def test_golden_small_particles_settle_by_stokes(size):
    """w = (s - 1) g D^2 / 18 nu, less Oseen's 3/16 Re; the smallest has Re 9e-7."""
    settled = settle(DRAFT, SPHERE, Particle(2.65, 1e-6, size), estimate=False)
    re = settled.reynolds
    assert settled.solution.reynolds == max(re, 1e-3)
    stokes = 1.65 * 9.81 * size**2 / 18e-6
    assert settled.velocity == pytest.approx(stokes / (1 + 3 / 16 * re), rel=0.005)
    assert settled.flows <= 4


def test_golden_grains_settle_by_the_sphere_curve():
    """Schiller and Naumann 1933, good to 5 %."""
    settled = settle(DRAFT, SPHERE, Particle(2.65, 1e-6, 5e-4), estimate=False)
    re = settled.solution.reynolds
    assert settled.solution.drag == pytest.approx(24 / re * (1 + 0.15 * re**0.687), rel=0.05)


@pytest.mark.parametrize(
    ("aspect", "onset", "size"),
    [pytest.param(1.0, 210, 5e-3, marks=pytest.mark.slow), (0.5, 121, 2e-3)],
)
def test_particles_too_large_to_settle_steadily_are_refused(aspect, onset, size):
    """Their wakes would be unstable."""
    rough = Flow(Scene(dimension=3, fidelity=ROUGH_3D))
    body = family_shape({"aspect": aspect}, dimension=3)
    with pytest.raises(InvalidInput, match=rf"beyond Re {onset}, .* smaller size"):
        settle(rough, body, Particle(2.65, 1e-6, size))


def test_particles_of_any_size_have_a_speed_or_are_refused():
    for archimedes in (1e-30, 1e-84):  # Stokes
        assert sphere_reynolds(archimedes) == pytest.approx(archimedes / 18, rel=1e-6)
    with pytest.raises(InvalidInput, match="smaller size would do"):
        settle(DRAFT, SPHERE, Particle(2.65, 1e-6, 5.0))


def test_particles_without_weight_or_size_are_refused():
    with pytest.raises(InvalidInput, match="neither falls nor rises"):
        Particle(1.0, 1e-6, 1e-4)
    with pytest.raises(InvalidInput, match="size -1: from 1e-12"):
        Particle(2.0, 1e-6, -1)


@pytest.mark.parametrize(
    ("body", "turns"),
    [
        ({"aspect": 2.0}, True),
        ({"aspect": 2.0, "incidence": 90.0}, False),
        ({"aspect": 0.5}, False),
        ({"aspect": 0.5, "incidence": 30.0}, True),
        ({"aspect": 1.0, "incidence": 30.0}, False),
    ],
)
def test_bodies_that_have_their_broad_side_to_the_fall_do_not_turn(body, turns):
    assert turns_when_free(family_shape(body, dimension=3)) == turns


@pytest.mark.slow
def test_golden_held_obliquely_a_small_spheroid_drifts_as_in_stokes_flow():
    """Velocities along and across the axis superpose (Oberbeck 1876)."""
    body = ellipsoid(2.0)
    along, across = (
        oberbeck(one, 1e-3) for one in (body, Ellipsoid(body.width, body.length, body.height))
    )
    shape = family_shape({"aspect": 2.0, "incidence": 45.0}, dimension=3)
    settled = settle(DRAFT, shape, Particle(2.65, 1e-6, 1e-5), estimate=False)
    drag, lift = (along + across) / 2, (across - along) / 2
    assert settled.drift == pytest.approx(np.degrees(np.arctan2(lift, drag)), rel=0.02)
    sphere = settle(DRAFT, SPHERE, Particle(2.65, 1e-6, 1e-5), estimate=False)
    slower = oberbeck(ellipsoid(1.0), 1e-3) / np.hypot(drag, lift)
    assert settled.velocity / sphere.velocity == pytest.approx(slower, rel=0.01)
