"""3-D flows at incidence: symmetries, golden loads, gradients, the parts of domain and body."""

import dataclasses
import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ROUGH_3D
from correlations import Ellipsoid, ellipsoid, oberbeck
from correlations_at_incidence import moment_by_inertia

from surrogate import Family, Flow, InvalidInput, Scene, family_shape
from surrogate.body.skin import HALVES, SkinNodes
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.modes_3d import Modes3D
from surrogate.flow.grid.oseen_3d import space_kernel
from surrogate.flow.loads import LOADS
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.model.network import blank_network
from surrogate.scene.fidelity import NAMED
from surrogate.scene.limits import onset_of
from surrogate.scene.samples import Samples
from surrogate.scene.stream import Unbounded
from surrogate.training.methods.method import moment_residual

FAMILY = Family(dimension=3, aspect=(0.6, 2.0), beta2=(-0.2, 0.2), incidence=(-90, 90))
SCENE = Scene(dimension=3, reynolds=(0.01, 50), family=FAMILY, fidelity=ROUGH_3D)
FLOW = Flow(SCENE, NewtonSettings(1e-10, 30, 60, linear_tolerance=1e-9))
DRAFT = Flow(Scene(dimension=3, fidelity="draft"))
BODY = np.array([1.6, 0.1, 25.0])


def solved(parameters, reynolds, flow=DRAFT):
    return flow.solve(family_shape(parameters, dimension=3), reynolds, estimate=False)


@functools.partial(jax.jit, static_argnames="lattice")
def driven(lattice, reynolds, force):
    """Velocity that a force density drives: one convolution with G."""
    return space_kernel(lattice, reynolds)(force)


def test_exact_kernel_of_half_a_domain_is_that_of_the_whole():
    half, rng = Lattice((24, 8, 16), (0.2,) * 3, 8, folded=(1,)), np.random.default_rng(0)
    whole = half.unfolded
    force = rng.normal(size=(3, *half.shape))
    force[1, :, -1] = 0.0  # its image's place is outside of the whole domain
    re = jnp.asarray(7.0)
    by_half, by_whole = (
        np.asarray(lattice.unfold(driven(lattice, re, jnp.asarray(f))))
        for lattice, f in ((half, force), (whole, np.asarray(half.unfold(force))))
    )
    assert np.abs(by_half - by_whole).max() < 1e-11 * np.abs(by_whole).max()


@pytest.mark.parametrize("parity", [1, -1])
def test_exact_kernel_of_forces_that_are_their_mirror_image_or_minus_it(parity):
    lattice, rng = Lattice((24, 8, 16), (0.2,) * 3, 8, folded=(1,)), np.random.default_rng(0)
    force = rng.normal(size=(3, *lattice.shape))
    force[2, ..., -1] = 0.0  # its image's place is outside of the domain
    force = lattice.symmetrised(jnp.asarray(force), parity)
    kernel = eqx.filter_jit(space_kernel)(lattice, jnp.asarray(7.0))
    found = eqx.filter_jit(kernel.of_parity)(force, jnp.asarray((1 - parity) // 2))
    whole = eqx.filter_jit(kernel)(force)
    np.testing.assert_allclose(found, whole, atol=1e-12 * float(jnp.abs(whole).max()))
    images = lattice.symmetrised(found, parity)
    np.testing.assert_allclose(found[..., :-1], images[..., :-1], rtol=0, atol=0)
    assert float(jnp.abs(lattice.symmetrised(force, -parity)).max()) == 0.0


@pytest.mark.parametrize("folded", [(), (1,), (1, 2)])
def test_exact_transposed_kernel(folded):
    lattice, rng = Lattice((24, 8, 16), (0.2,) * 3, 8, folded=folded), np.random.default_rng(0)
    kernel = eqx.filter_jit(space_kernel)(lattice, jnp.asarray(7.0))
    force, field = jnp.asarray(rng.normal(size=(2, 3, *lattice.shape)))

    @eqx.filter_jit
    def transposed(kernel, force, field):
        """By JAX and by the kernel."""
        return jax.linear_transpose(kernel, force)(field)[0], kernel.transposed(field)

    expected, found = transposed(kernel, force, field)
    tolerance = 1e-12 * float(jnp.abs(expected).max())
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


def test_few_combinations_of_modes_give_the_velocity_far_away():
    """That of the Oseen flow; near the body all modes are known."""
    operators = FLOW.bodies.assembled(jnp.asarray(BODY), jnp.asarray(40.0))

    @jax.jit
    def responses(operators):
        amplitude = steady.eliminate(operators).oseen_flow().amplitude
        return operators.response(amplitude), operators.green(operators.body.spread(amplitude))

    few, whole = responses(operators)
    error = jnp.abs(few - whole) / float(jnp.abs(whole).max())
    corner, near = FLOW.domain.near
    box = (slice(None), *(slice(k, k + side) for k, side in zip(corner, near.shape, strict=True)))
    assert float(error[box].max()) < 1e-5
    assert 1e-5 < float(error.max()) < 0.02


@pytest.mark.slow
def test_a_sphere_has_no_incidence():
    aligned, turned = (solved({"aspect": 1.0, "incidence": turn}, 5.0) for turn in (0.0, 40.0))
    assert aligned.domain.lattice.folded == (1, 2)
    assert turned.domain.lattice.folded == (1,)
    assert turned.drag == pytest.approx(aligned.drag, rel=1e-4)
    assert abs(turned.lift) < 1e-4 * turned.drag
    assert abs(turned.moment) < 1e-4 * turned.drag


@pytest.mark.slow
def test_a_body_across_the_stream_is_a_flattened_one():
    """Turned by 90 degrees aspect 2 is aspect 0.7071, flatness 2; two grids and sets of modes."""
    turned = solved({"aspect": 2.0, "incidence": 90.0}, 1.0)
    flattened = solved({"aspect": 2**-0.5, "flatness": 2.0}, 1.0)
    assert turned.drag == pytest.approx(flattened.drag, rel=2e-3)
    assert max(abs(turned.lift), abs(turned.moment)) < 1e-4 * turned.drag


@pytest.mark.slow
def test_a_turn_the_other_way_mirrors_lift_and_moment():
    up, down = (solved({"aspect": 2.0, "incidence": turn}, 10.0) for turn in (35.0, -35.0))
    assert down.drag == pytest.approx(up.drag, rel=1e-6)
    assert down.lift == pytest.approx(-up.lift, rel=1e-5)
    assert down.moment == pytest.approx(-up.moment, rel=1e-5)
    modes, amplitudes = up.domain.modes, (up.state.amplitude, down.state.amplitude)
    assert np.allclose(modes.mirror * amplitudes[0], amplitudes[1], atol=1e-5)


@pytest.mark.parametrize(
    ("aspect", "turn"), [pytest.param(0.5, 30.0, marks=pytest.mark.slow), (2.0, 45.0)]
)
def test_golden_spheroids_in_stokes_flow(aspect, turn):
    """Oberbeck 1876: drags along and across the axis superpose; the moment is by inertia alone."""
    body, re = ellipsoid(aspect), 1e-3
    along, across = oberbeck(body, re), oberbeck(Ellipsoid(body[1], body[0], body[2]), re)
    c, s = np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))
    found = solved({"aspect": aspect, "incidence": turn}, re)
    drag, lift = along * c**2 + across * s**2, (across - along) * s * c
    assert found.drag == pytest.approx(drag, rel=0.01)
    # an oblate body's short axis is along the stream: nose up its lift points down
    assert found.lift == pytest.approx(lift, abs=0.005 * drag)
    assert found.moment == pytest.approx(moment_by_inertia(aspect, turn), rel=0.07)


@pytest.mark.slow
@pytest.mark.parametrize("aspect", [0.5, 2.0])
def test_order_of_convergence_to_the_exact_moment_by_inertia(aspect):
    """Dabade, Marath, Subramanian 2015: on draft, standard and fine, at better than first order."""
    exact, body = moment_by_inertia(aspect, 45.0), {"aspect": aspect, "incidence": 45.0}
    levels = [NAMED[3][name] for name in ("draft", "standard", "fine")]
    flows = [Flow(Scene(dimension=3, fidelity=level)) for level in levels]
    errors = [abs(solved(body, 1e-3, flow).moment / exact - 1) for flow in flows]
    cells = [level.cells for level in levels]
    assert errors[-1] < 0.005
    assert np.all(np.diff(np.log(errors)) < -1.5 * np.diff(np.log(cells)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reynolds", "cd", "cl", "cm"), [(1.0, 28.124, 2.288, 0.509), (10.0, 4.429, 0.563, 0.315)]
)
def test_golden_spheroid_at_45_degrees(reynolds, cd, cl, cm):
    """Elements in space, aspect 2: 0.1 % of Cd, 0.3 % of Cl, 0.5 % of Cm."""
    flow = Flow(Scene(dimension=3))
    found = solved({"aspect": 2.0, "incidence": 45.0}, reynolds, flow)
    assert found.drag == pytest.approx(cd, rel=0.003)
    assert found.lift == pytest.approx(cl, abs=0.003 * cd)
    assert found.moment == pytest.approx(cm, abs=0.002 * cd)


@pytest.mark.slow
def test_taylor_remainders_of_the_loads_are_of_second_order():
    """In shape, flatness, incidence and Re together, relative to each load's own change."""
    family = Family(dimension=3, flatness=(1.0, 2.0), **dict(FAMILY.ranges))
    flow = Flow(dataclasses.replace(SCENE, family=family), FLOW.settings)
    given, towards = dict(zip(FAMILY.names, BODY, strict=True)), (0.3, 0.1, 10.0)
    change = dict(zip(FAMILY.names, towards, strict=True)) | {"flatness": 0.2}
    body, re = jnp.array([(given | {"flatness": 1.3})[name] for name in family.names]), 20.0
    direction, rate = jnp.array([change[name] for name in family.names]), 3.0
    by_body, by_re = jax.jacobian(flow.loads, (0, 1))(body, jnp.asarray(re))
    along, loads = by_body @ direction + by_re * rate, flow.loads(body, re)
    remainders = np.abs(
        [flow.loads(body + e * direction, re + e * rate) - loads - e * along for e in (0.2, 0.1)]
    )
    assert np.all(np.log2(remainders[0] / remainders[1]) > 1.9), remainders


@pytest.mark.slow
def test_gradients_of_many_bodies_are_those_of_each():
    """Their program, and that of trainings, is compiled by other passes of XLA."""
    flow, coarse = Flow(SCENE), {"rtol": 1e-2, "atol": 1e-3}  # adjoints: 2e-4, 7e-4
    many = flow.solve_all(BODY[None], np.array([10.0]), gradients=True)
    alone = flow.loads_and_gradients(BODY, 10.0)
    np.testing.assert_allclose(many.loads[0], alone.loads, rtol=1e-5)
    np.testing.assert_allclose(many.gradients[0], alone.gradients, **coarse)
    np.testing.assert_allclose(many.by_reynolds[0], alone.by_reynolds, **coarse)


@pytest.mark.slow
def test_loads_of_a_scene_are_those_of_its_flow():
    loads = np.asarray(FLOW.loads(BODY, 20.0))
    found = FLOW.solve(BODY, 20.0, estimate=False)
    assert np.allclose(loads, [found.drag, found.lift, found.moment], rtol=1e-6)


def test_moment_of_a_traction_is_its_torque():
    """Forces along x in proportion to z, by the modes' own quadrature."""
    nodes, modes = SkinNodes(40, 40, HALVES), Modes3D(4, symmetric=False, orders=2)
    skin = FAMILY.markers(np.array([1.0, 0.0, 0.0]), nodes)
    values, weights = modes.values(nodes), modes.weights(nodes) * nodes.parts
    index = next(
        k
        for k, v in enumerate(values)
        if np.allclose(v[0], v[0].max() * skin.points[:, 2] * 2, atol=0.03)
        and not v[1:].any()
        and v[0].any()
    )
    amplitude = jnp.zeros(modes.count).at[index].set(-1.0)
    torque = weights @ (values[index, 0] * np.asarray(skin.points[:, 2]))
    assert float(LOADS["cm"](modes, amplitude, skin)) == pytest.approx(8 / np.pi * torque)
    assert float(LOADS["cl"](modes, amplitude, skin)) == 0.0


def test_the_moment_of_a_networks_traction_is_that_on_the_flows_skin():
    """Methods as published train the network's moment to be that of its traction."""
    network = blank_network(SCENE, (8, 8), jax.random.key(0))
    network = dataclasses.replace(network, mode_scale=jnp.ones_like(network.mode_scale))
    at = jnp.asarray(BODY), jnp.array(10.0)
    off = moment_residual(network, Samples(at[0][None], at[1][None]), jnp.array(0))
    traction = network.traction(*at)
    skin = SCENE.family.body_class.markers(BODY, FLOW.domain.nodes)
    own = LOADS["cm"](network.modes, traction, skin) / LOADS["cd"](network.modes, traction, skin)
    loads = network.loads(*at)
    assert abs(own) > 0.01
    assert float(off[0]) == pytest.approx(float(loads[2] / loads[0] - own), rel=1e-6)


def test_what_no_grid_covers_is_refused():
    with pytest.raises(InvalidInput, match="incidence 200: must lie between"):
        family_shape({"aspect": 2.0, "incidence": 200.0}, dimension=3)
    with pytest.raises(InvalidInput, match="too large"):  # it fits along the stream
        DRAFT.solve(family_shape({"aspect": 6.0, "incidence": 80.0}, dimension=3), 1.0)
    with pytest.raises(InvalidInput, match="tunnel"):
        Scene("tunnel:8", dimension=3, family=FAMILY)
    with pytest.raises(InvalidInput, match="is unstable beyond"):
        DRAFT.solve(family_shape({"aspect": 0.5, "incidence": 20.0}, dimension=3), 160.0)


def test_the_box_of_forces_ends_at_the_edges_of_a_coarse_grid():
    """A body across the stream, whose rounded extent is higher than the error estimate's grid."""
    level = NAMED[3]["draft"].coarser(2 / 3).scaled(5 / 6)
    turned = family_shape({"aspect": 3.0, "incidence": 90.0}, dimension=3)
    domain = fitted_domain(Unbounded(), level, turned, 20.0)
    assert domain.box[2] == domain.lattice.shape[2]
    assert np.all(domain.half_extent >= turned.extent / 2)


def test_the_onset_of_traced_bodies_is_that_of_shapes():
    bodies = np.array([[1.6, 0.2, 90.0], [0.6, -0.2, 30.0], [1.0, 0.1, 0.0]])
    traced = FLOW.bodies.check(bodies).onset
    shapes = [family_shape(FAMILY.named(body), dimension=3) for body in bodies]
    assert traced == pytest.approx([onset_of(shape) for shape in shapes], rel=2e-2)


def test_the_box_of_a_family_holds_its_bodies():
    bodies = np.asarray(FAMILY.sample(jax.random.key(0), 200))
    box = np.array(FAMILY.extent)
    extents = [family_shape(FAMILY.named(body), dimension=3).extent for body in bodies]
    for body, extent in zip(bodies, extents, strict=True):
        assert np.all(extent <= box * (1 + 1e-9)), (body, extent, box)
    assert box.max() < 1.5 * np.max(extents)


def test_fields_know_the_turned_body():
    found = solved({"aspect": 2.0, "flatness": 1.2, "incidence": 35.0}, 5.0)
    inside, (x, _, z) = found.fields.inside, found.fields.axes
    volume = inside.sum() * float(np.prod(found.domain.lattice.step))
    assert volume == pytest.approx(np.pi / 6, rel=0.1)
    places = np.argwhere(inside)
    lean = np.polyfit(x[places[:, 0]], z[places[:, 2]], 1)[0]
    assert lean < -0.2  # the nose is up


def test_domains_say_which_part_is_gridded():
    fine = dataclasses.replace(ROUGH_3D, cells=100)
    scene = dataclasses.replace(SCENE, fidelity=fine)
    with pytest.raises(InvalidInput, match="half of the domain has"):
        Flow(scene).drag(BODY, 10.0)
