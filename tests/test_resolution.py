"""Grids too coarse for a body or a tunnel are refused, with the number of cells that would do."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import (
    FIDELITIES,
    Family,
    Fidelity,
    Flow,
    InvalidInput,
    Scene,
    Unbounded,
    contour_shape,
    family_shape,
    naca4,
    train,
)
from surrogate.body.nose import nose_of_contour, nose_of_ellipse
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.model.network import blank_network

COARSE = Flow(Scene(fidelity=Fidelity("coarse", 6, 4, 8, 8)))
THIN, THICK = [5.0, 0.3, 0.0, 0.0], [1.5, 0.0, 0.0, 0.0]
TURNED = family_shape({"aspect": 2.0}, 1.0)
ANGLE = 2 * np.pi * np.arange(400) / 400
WAVES = (1 + 0.1 * np.cos(12 * ANGLE)) * np.stack([-np.cos(ANGLE), np.sin(ANGLE)])
ROUND_CONTOUR = family_shape({"aspect": 1.0}).draw(400)


@pytest.mark.parametrize(
    ("shape", "mode"),
    [
        (family_shape({"aspect": 2.0}), 1),
        (family_shape({"aspect": 2.0, "beta3": 0.1, "beta9": 0.0}), 3),
        (family_shape({"aspect": 2.0, "beta8": 0.05, "incidence": 5.0}), 8),
        (family_shape({"aspect": 2.0, "gamma6": 0.1}), 6),
        (contour_shape(naca4("4412")), 3),
        (contour_shape(WAVES.T), 13),
    ],
)
def test_bodies_have_two_harmonics_more_than_their_highest_mode(shape, mode):
    assert shape.highest_mode == mode
    domain = fitted_domain(Unbounded(), FIDELITIES["standard"], shape, 20.0)
    usual = 7 if shape.symmetric else 12
    assert domain.modes.harmonics == (usual if mode + 2 <= usual else 16)


@pytest.mark.parametrize(
    ("extent", "room"),
    [((1.5, 0.7), (4, 2)), ((4.0, 2.0), (4, 2)), ((4.25, 1.0), (8, 2)), ((0.75, 2.25), (4, 4))],
)
def test_bodies_on_a_grid_of_their_own_have_a_box_of_few_sizes(extent, room):
    standard = FIDELITIES["standard"]
    shape, others = family_shape({"aspect": 2.0}), (Unbounded(), standard)
    domain = Domain2D.around(*others, np.array(extent), shape, 20.0)
    assert domain.half_extent == pytest.approx(np.array(room) / 2, abs=1 / standard.cells)
    assert np.all(2 * domain.half_extent >= extent)
    exact = Domain2D.make(*others, extent, True, reynolds=20.0)
    assert domain.lattice == exact.lattice
    assert all(own >= least for own, least in zip(domain.box, exact.box, strict=True))


def test_scenes_have_harmonics_for_the_modes_of_their_bodies():
    usual, wavy = Family(aspect=(1, 3), beta4=(0, 0.1)), Family(aspect=(1, 3), beta10=(0, 0.05))
    harmonics = [Flow(Scene(family=one)).domain.modes.harmonics for one in (usual, wavy)]
    assert harmonics == [FIDELITIES["standard"].harmonics, 12]


def narrow(cells: int) -> Flow:
    return Flow(Scene(stream="tunnel:1.75", fidelity=Fidelity("c", cells, 6, 12, 8)))


def test_the_scenes_own_grid_refuses_what_a_fitted_grid_refuses():
    named = COARSE.scene.family.named(np.array(THIN))
    for body in (THIN, family_shape(named)):
        with pytest.raises(InvalidInput, match=r"mean thickness is 1\.9\d cells.*8 cells per D"):
            COARSE.solve(body, 10.0)
    with pytest.raises(InvalidInput, match="mean thickness"):
        COARSE.drag(THIN, 10.0)
    with pytest.raises(InvalidInput, match="mean thickness"):
        COARSE.solve_all(np.array([THICK, THIN]), np.array([10.0, 10.0]), gradients=True)


@pytest.mark.slow
def test_under_vmap_what_is_too_thin_is_nan():
    thin, thick = jax.vmap(COARSE.drag, (0, None))(jnp.array([THIN, THICK]), 10.0)
    assert np.isnan(thin)
    assert float(thick) == pytest.approx(2.57, abs=0.03)


def test_trainings_do_not_learn_from_bodies_that_are_not_resolved():
    with pytest.raises(InvalidInput, match="mean thickness"):
        train(COARSE.scene, "supervised", samples=16, progress=False)


def test_a_grid_of_three_cells_is_refused_by_the_bodys_thickness():
    flow = Flow(Scene(fidelity=Fidelity("c", 3, 4, 8, 8)))
    with pytest.raises(InvalidInput, match=r"thickness is 1\.3\d cells.* 6 cells per D would"):
        flow.solve([2.0, 0.0, 0.0, 0.0], 10.0)


def test_a_body_without_a_coarser_grid_has_no_estimate():
    found = COARSE.solve([1.0, 0.0, 0.0, 0.0], 10.0)
    assert found.status == "degraded"
    assert found.estimated_error is None
    assert found.drag == pytest.approx(2.754, rel=0.02)


def test_a_tunnel_of_too_few_rows_is_refused():
    with pytest.raises(InvalidInput, match=r"tunnel:1.75: 10 rows.* needs 12; 8 cells per D would"):
        narrow(6).solve(TURNED, 10.0)


def test_a_tunnel_too_coarse_for_the_estimate_alone_is_answered():
    found = narrow(8).solve(TURNED, 10.0)
    assert found.status == "degraded"
    assert found.estimated_error is None
    assert found.drag > 9.0  # blocked by a third, 5.5 times the unbounded drag


@pytest.mark.parametrize("aspect", [1.0, 4.0])
def test_exact_nose_of_an_ellipse(aspect):
    shape = family_shape({"aspect": aspect})
    assert shape.nose == pytest.approx(1 / (2 * shape.chord**3), rel=1e-4)
    small = contour_shape(0.3 * shape.draw(400), keep_size=True)
    assert small.nose == pytest.approx(0.3 * shape.nose, rel=1e-2)


@pytest.mark.parametrize("turns", [1, -1])
def test_exact_nose_that_is_a_sharp_arc(turns):
    """A drop: an arc of radius r upstream, whose tangents lead to a wide end."""
    radius, half, chord = 0.02, 1.3, 2.0  # half the angle by which the arc turns
    t = np.linspace(-half, half, 400)
    arc = np.stack([-1.0 + radius * (1 - np.cos(t)), radius * np.sin(t)], axis=1)
    wide = arc[-1] + (1.0 - arc[-1, 0]) * np.array([[1.0, 1 / np.tan(half)]])
    wide = np.concatenate([wide, wide * [1, -1]])
    sides = [arc, np.linspace(arc[-1], wide[0], 400)[1:], np.linspace(*wide, 400)[1:]]
    drop = np.concatenate([*sides, np.linspace(wide[1], arc[0], 400)[1:-1]])[::turns]
    assert nose_of_contour(drop, 0.5) == pytest.approx(3 * radius, rel=0.02)
    assert nose_of_contour(-drop, 0.5) < radius  # its corners lie upstream
    assert nose_of_contour(drop, chord) == pytest.approx(min(1 / 16, 3 * radius), rel=0.02)


def test_a_sharp_nose_gets_cells_and_a_sharp_tail_does_not():
    """The section is the worst one of study ``random_sections`` with seed 2811."""
    section = {"aspect": 3.151, "beta2": -0.286, "beta3": -0.1, "beta4": 0.033}
    section |= {"gamma2": 0.461, "gamma3": 0.007, "incidence": -3.519}
    body = family_shape(section)
    standard = FIDELITIES["standard"]
    assert standard.for_body(42.8, body.height, body.nose).cells == 32
    reversed_ = contour_shape(-body.draw(400))
    assert standard.for_body(42.8, reversed_.height, reversed_.nose).cells == 16
    naca = contour_shape(naca4("2412"))
    assert naca.nose == pytest.approx(1 / (2 * naca.chord**3), rel=1e-3)


@pytest.mark.parametrize(
    ("level", "reynolds", "chord", "cells", "harmonics"),
    [
        ("standard", 1.0, 2.0, 16, 7),
        ("standard", 40.0, 2.2, 16, 7),
        ("standard", 150.0, 2.0, 32, 7),
        ("standard", 200.0, 2.45, 40, 14),
        ("fine", 100.0, 1.0, 32, 7),
        ("fine", 40.0, 2.2, 48, 7),
        ("fine", 100.0, 1.73, 64, 7),
        ("fine", 200.0, 2.45, 96, 14),
    ],
)
def test_thin_boundary_layers_get_cells_and_the_thinnest_harmonics(
    level, reynolds, chord, cells, harmonics
):
    nose = nose_of_ellipse(chord)
    found = FIDELITIES[level].for_layers(reynolds, nose)
    assert (found.cells, found.harmonics) == (cells, harmonics)
    assert found.for_layers(reynolds, nose) == found  # refined once


@pytest.mark.parametrize(
    "scene",
    [
        Scene(reynolds=(1, 350)),
        Scene(family=Family(aspect=(1, 6), beta2=(-0.3, 0.3)), reynolds=(1, 150)),
        Scene(dimension=3),
    ],
    ids=["fast", "slender", "3-D"],
)
def test_networks_have_the_traction_modes_of_the_grid(scene):
    """Also where boundary layers are so thin that the grid has more of them."""
    network = blank_network(scene, (4,), jax.random.key(0))
    assert network.modes == Flow(scene).domain.modes


def test_bodies_fit_the_domain_downstream_too():
    short = Flow(Scene(fidelity=Fidelity("short", 9, 6, 2.5, 8)))
    with pytest.raises(InvalidInput, match="short domain, which holds 2 D along the stream"):
        short.solve(family_shape({"aspect": 6.0}), 10.0)


@pytest.mark.parametrize(
    ("dimension", "sides", "most"),
    [(2, (40, 12, 8), (32, 64, 96)), (2, (6, 70, 8), (32, 64, 96)), (3, (3, 20, 4), (8, 16, 24))],
)
def test_domains_larger_than_the_first_lattice_of_the_far_field_are_refused(dimension, sides, most):
    """There its response would be extrapolated."""
    scene = Scene(dimension=dimension, fidelity=Fidelity("long", 6, *sides, wake=0.0))
    words = "at most {} D upstream, {} D downstream and {} D across".format(*most)
    with pytest.raises(InvalidInput, match=words):
        Flow(scene).solve(family_shape({"aspect": 1.0}, dimension=dimension), 10.0)


def test_bodies_too_large_are_told_what_the_domain_holds():
    with pytest.raises(InvalidInput, match=r"coarse domain, which holds 5 D .* and 5\.5 D across"):
        COARSE.solve(contour_shape(6 * ROUND_CONTOUR, keep_size=True), 0.01)
