"""Free fall: Stokes flow, momentum at the start, stable orientations, what is refused."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from correlations import Ellipsoid, ellipsoid, oberbeck

from shapeopt.free_fall import constants_of, fall, rates_of
from shapeopt.orientation import Orientation, orientations, small_swings
from surrogate import Family, InvalidInput, Particle, Scene, Surrogate, load
from surrogate.body.ellipsoid import DISPLACED, equivalent_ellipsoid
from surrogate.body.incidence import in_first_quarter

pytestmark = pytest.mark.usefixtures("unchecked")  # known loads stand for a network's
SCENE = Scene.of(
    {
        "dimension": 3,
        "reynolds": [0.1, 100],
        "family": {"aspect": [0.5, 3], "beta2": [-0.2, 0.2], "incidence": [0, 90]},
    }
)
SPINDLE, ARCHIMEDES = [2.0, 0.0, 0.0], 2e-4
SMALL = Particle(1.5, 1e-6, (ARCHIMEDES * 1e-12 / (0.5 * 9.81)) ** (1 / 3))
GRAIN = Particle(2.65, 1e-3, 2e-6)  # sand of 2 micrometres in glycerine


class StokesLoads(eqx.Module):
    """Loads of slow flow past the spheroid of aspect 2, with a moment to a given incidence.

    They are those of Stokes flow with Oseen's correction, as in ``shapeopt.fall``.
    """

    level: float = 0.0

    def loads(self, parameters, reynolds):
        axes = ellipsoid(2.0)
        flat = Ellipsoid(axes.width, axes.length, axes.height)
        along, across = (8 / np.pi * resistance(body) for body in (axes, flat))
        c, s = jnp.cos(jnp.deg2rad(parameters[2])), jnp.sin(jnp.deg2rad(parameters[2]))
        drag, lift = along * c**2 + across * s**2, (across - along) * s * c
        loads = jnp.stack([drag, lift, self.level * drag * s * c + 0 * parameters[1]]) / reynolds
        correction = drag * reynolds * np.array([1 / 128, 5 / 256, 0.0])
        return loads * (1 + correction)


def resistance(body):
    """Stokes drag over mu U D of an ellipsoid (Oberbeck 1876)."""
    return oberbeck(body, 1e-9) * 1e-9 * np.pi / 8


def surrogate(level=0.0):
    record = {"method": "none", "drag_error_mean": 0.0, "drag_error_max": 0.0, "held_out": 1}
    return Surrogate(StokesLoads(level), SCENE, record)


@pytest.mark.parametrize(
    ("particle", "seconds"), [(SMALL, 1e-4), (GRAIN, 2.0)], ids=["water", "glycerine"]
)
def test_golden_drift_of_a_spheroid_in_stokes_flow(particle, seconds):
    """It keeps its tilt and moves at the velocities along and across its axis (Oberbeck 1876).

    The grain in glycerine comes to its velocity within a few 1e-9 of the time.
    """
    found = fall(surrogate(), SPINDLE, particle, seconds, tilt=-60.0)
    assert found.tilt == pytest.approx(-60.0)
    axes = ellipsoid(2.0)
    resistances = np.array(
        [resistance(b) for b in (axes, Ellipsoid(axes.width, axes.length, axes.height))]
    )
    axis = np.array([np.cos(np.pi / 3), -np.sin(np.pi / 3)])
    weight, normal = np.array([0, -DISPLACED * particle.archimedes]), np.array([-axis[1], axis[0]])
    speeds = np.array([weight @ axis, weight @ normal]) / resistances
    expected = particle.viscosity / particle.size * (speeds[0] * axis + speeds[1] * normal)
    assert found.velocity[-1] == pytest.approx(expected, rel=1e-5)
    assert np.diff(found.z).max() < 0


def test_golden_small_particles_settle_as_in_stokes_flow():
    """The surrogate's loads at its least Re, 0.1, are up to 3 % (Cd) above those of Stokes flow.

    The drag of a spheroid held at an angle is Oberbeck's, and its lift, to the surrogate's error.
    """
    net = load("pretrained:particle")
    body_class, dust = net.scene.family.body_class, Particle(2.65, 1e-6, 5e-6)
    for aspect, angle in ((0.3, 45.0), (1.0, 0.0), (4.0, 45.0), (2.0, 70.0)):
        body = np.array([aspect, 1.0, 0.0, 0.0])
        constants = constants_of(net, body, dust)
        direction = np.deg2rad(angle)
        momentum = 1e-4 * np.array([np.cos(direction), np.sin(direction)]) * constants[:2]
        state = np.array([0, 0, 0.0, *momentum, 0.0])
        still = constants * np.array([1, 1, 1, 1, 0, 1])  # without weight
        force = -np.asarray(rates_of(net.network, body_class, body, still, state))[3:5] / 1e-4
        axes = ellipsoid(aspect)
        flat = Ellipsoid(axes.width, axes.length, axes.height)
        along, across = resistance(axes), resistance(flat)
        drag = along * np.cos(direction) ** 2 + across * np.sin(direction) ** 2
        lift = (across - along) * np.sin(direction) * np.cos(direction)
        way = np.array([np.cos(direction), np.sin(direction)])
        assert force @ way == pytest.approx(drag, rel=0.007)
        assert force @ [-way[1], way[0]] == pytest.approx(lift, abs=0.004 * drag)


@pytest.mark.parametrize(
    ("seconds", "tilt", "words"),
    [
        (1e300, 0.0, "seconds 1e\\+300: from "),
        (1e-300, 0.0, "seconds 1e-300: from "),
        (1.0, 1e300, "tilt 1e\\+300: from -360"),
    ],
)
def test_endless_falls_are_refused(seconds, tilt, words):
    with pytest.raises(InvalidInput, match=words):
        fall(surrogate(), SPINDLE, SMALL, seconds, tilt)


def test_exact_acceleration_from_rest_is_that_of_body_and_added_mass():
    """Before there is drag a sphere carries half of its displaced mass (Lamb)."""
    sphere = equivalent_ellipsoid(1.0)
    assert sphere.added_masses == pytest.approx((DISPLACED / 2, DISPLACED / 2))
    assert sphere.added_inertia == 0
    assert sphere.resistance_to_rotation == pytest.approx(np.pi)
    needle, disc = equivalent_ellipsoid(1e3), equivalent_ellipsoid(1e-3)
    assert np.array(needle.added_masses) == pytest.approx([0, DISPLACED], abs=1e-4)
    assert disc.added_masses[0] == pytest.approx(8 / 3 * disc.height**3, rel=1e-2)
    found = fall(surrogate(), SPINDLE, SMALL, 1e-9, tilt=0.0)
    mass = 1.5 + equivalent_ellipsoid(2.0).added_masses[1] / DISPLACED
    assert found.velocity[-1, 1] == pytest.approx(-0.5 * 9.81 / mass * 1e-9, rel=1e-2)


def test_a_body_turns_to_its_stable_orientation():
    """A positive moment below 90 degrees turns its broad side to the motion."""
    broad = surrogate(1.0)
    expected = [(0.0, False), (90.0, True), (180.0, False)]
    assert orientations(broad, SPINDLE, 1.0) == [Orientation(*one) for one in expected]
    found = fall(broad, SPINDLE, dataclasses.replace(SMALL, size=20 * SMALL.size), 1.0, tilt=-60.0)
    assert abs(found.incidence[-1]) == pytest.approx(90.0, abs=0.1)
    assert found.tilt[-1] % 180 == pytest.approx(0.0, abs=0.1) or found.tilt[-1] % 180 > 179.9
    stable = {o.incidence: o.stable for o in orientations(surrogate(-1.0), SPINDLE, 1.0)}
    assert stable == {0.0: True, 90.0: False, 180.0: True}


def test_orientations_are_of_one_reynolds_number_that_is_trained(unchecked):
    for reynolds, reason in (([1.0, 10.0], "must be one number"), (300.0, "the scene covers 0.1")):
        with pytest.raises(InvalidInput, match=reason):
            orientations(surrogate(1.0), SPINDLE, reynolds)


def test_heavy_bodies_swing_and_light_ones_do_not():
    """The linear frequency is that of the last swings of the fall itself."""
    light = dataclasses.replace(SMALL, size=20 * SMALL.size)
    found = fall(surrogate(1.0), SPINDLE, light, 1.0, tilt=-20.0)
    assert small_swings(surrogate(1.0), SPINDLE, light, found)[0] is None
    heavy = Particle(1000.0, 1e-5, 1e-4)
    found = fall(surrogate(1.0), SPINDLE, heavy, 2.0, tilt=20.0)
    frequency, decay = small_swings(surrogate(1.0), SPINDLE, heavy, found)
    late = fall(surrogate(1.0), SPINDLE, heavy, 12 / decay, tilt=20.0)
    swing = late.tilt - found.tilt[-1]
    turns = np.flatnonzero(np.diff(np.sign(swing)) != 0)[-3:]
    at = late.time[turns] - swing[turns] * np.diff(late.time)[0] / np.diff(swing)[turns]
    # a whole period: half swings differ by how exactly the end of the fall is known
    assert 1 / (at[2] - at[0]) == pytest.approx(frequency, rel=0.01)


class EggLoads(StokesLoads):
    """The same with a moment by inertia, and one of Stokes flow that is odd in beta2."""

    def loads(self, parameters, reynolds):
        drag, lift, moment = super().loads(parameters, reynolds)
        across = jnp.sin(jnp.deg2rad(parameters[2]))
        return jnp.stack([drag, lift, moment * reynolds + parameters[1] * across * drag])


def test_torque_below_the_trained_range_is_continuous_in_the_shape():
    """There the moment of Stokes flow goes on as 1 / Re, that by inertia does not change."""
    network, body_class = EggLoads(1.0), SCENE.family.body_class
    constants = constants_of(surrogate(), np.array(SPINDLE), SMALL)
    constants[3] = 0.0  # no resistance to rotation
    momentum = 1e-2 * np.array([0.6, 0.8]) * constants[:2]  # at Re 0.01
    state = np.array([0, 0, 0.0, *momentum, 0.0])

    def torque(beta2):
        body = jnp.array([2.0, beta2, 0.0])
        return float(rates_of(network, body_class, body, constants, state)[5] * constants[2])

    assert torque(1e-9) == pytest.approx(torque(0.0), rel=1e-6)
    at = np.rad2deg(np.arctan2(0.8, 0.6))
    drag, _, moment = network.loads(jnp.array([2.0, 0.0, at]), 0.1)
    assert torque(0.0) == pytest.approx(-np.pi / 8 * 1e-4 * float(moment), rel=1e-6)
    stokes = 0.1 * 0.8 * float(drag) * 0.1 / 0.01
    assert torque(0.1) - torque(0.0) == pytest.approx(-np.pi / 8 * 1e-4 * stokes, rel=1e-6)


@pytest.mark.parametrize(
    ("body", "same", "image"),
    [
        ([2.0, 0.1, -30.0], [2.0, 0.1, 30.0], -1),
        ([2.0, 0.1, 120.0], [2.0, -0.1, 60.0], -1),
        ([2.0, 0.1, -150.0], [2.0, -0.1, 30.0], 1),
        ([2.0, 0.1, 390.0], [2.0, 0.1, 30.0], 1),
    ],
)
def test_every_incidence_is_one_of_the_first_quarter(body, same, image):
    parameters = SCENE.family.body_class.parameters
    found, sign = in_first_quarter(parameters, jnp.array(body))
    assert found.tolist() == pytest.approx(same)
    assert sign == image
    skins = [SCENE.family.body_class.contour(jnp.array(b), 64) for b in (body, same)]
    distances = np.linalg.norm(np.array(skins[0])[:, None] * [1, image] - skins[1], axis=-1)
    assert distances.min(axis=1).max() < 1e-9


def test_a_growing_disturbance_is_not_hidden_by_swings_that_decay(monkeypatch):
    found = fall(surrogate(1.0), SPINDLE, SMALL, 1e-4)
    roots = np.array([14.0, -40 + 7j, -40 - 7j, -83.0])
    monkeypatch.setattr(np.linalg, "eigvals", lambda matrix: roots)
    frequency, decay = small_swings(surrogate(1.0), SPINDLE, SMALL, found)
    assert frequency is None
    assert decay == pytest.approx(-14 * SMALL.viscosity / SMALL.size**2)


def test_falls_that_end_below_a_range_that_begins_high_are_refused():
    """Oseen's correction of a drag at Re 5 would be wrong by a fifth."""
    high = dataclasses.replace(surrogate(), scene=dataclasses.replace(SCENE, reynolds=(5, 100)))
    with pytest.raises(InvalidInput, match=r"ends at Re .*, below Re 5, from which"):
        fall(high, SPINDLE, SMALL, 1e-4)


def test_what_cannot_fall_is_refused():
    with pytest.raises(InvalidInput, match="3-D bodies at incidences from 0 to 90"):
        fall(load("pretrained:space"), SPINDLE, SMALL, 1.0)
    blunt_tailed = Family(aspect=(0.5, 3), beta2=(0, 0.2), incidence=(0, 90), dimension=3)
    one_sided = dataclasses.replace(SCENE, family=blunt_tailed)
    with pytest.raises(InvalidInput, match=r"tail first too, .*: beta2 -0\.1 \(.*0 to 0\.2\)"):
        fall(dataclasses.replace(surrogate(), scene=one_sided), [2.0, 0.1, 0.0], SMALL, 1.0)
    with pytest.raises(InvalidInput, match="above 0"):
        fall(surrogate(), SPINDLE, SMALL, 0.0)
    with pytest.raises(InvalidInput, match="aspect 9"):
        fall(surrogate(), [9.0, 0.0, 0.0], SMALL, 1.0)
    with pytest.raises(InvalidInput, match="exceeds Re 100"):
        fall(surrogate(), SPINDLE, dataclasses.replace(SMALL, size=1e-2), 10.0)
