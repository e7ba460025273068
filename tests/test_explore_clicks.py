"""A page in the browser: sliders, buttons and keys do what they say."""

import re

import jax.numpy as jnp
import numpy as np
import pytest
from pages import REYNOLDS, every, surrogate_of, visited

from shapeopt import Problem, optimise
from shapeopt.render.page.page import reference_body
from surrogate.body.body_class import CLEAR_THICKNESS_RATIO


def body_of(name, state):
    return np.array([state["values"][key] for key in surrogate_of(name).scene.family.names], float)


def drag_at(name, state):
    """Cd of the sliders' body and Reynolds number, by the network in Python."""
    body, log_re = body_of(name, state), state["values"]["reynolds"]
    return float(surrogate_of(name).network.drag(body, jnp.exp(log_re)))


def number(text):
    return float(text.replace("\N{MINUS SIGN}", "-").replace("%", ""))


@every
def test_sliders_move_drag_shape_and_words(name):
    """Re speaks its number, not its logarithm."""
    states = visited(name)["states"]
    for before, after in (("opened", "moved"), ("moved", "faster")):
        assert states[before]["drag"] != states[after]["drag"]
    assert states["opened"]["reference"] == states["moved"]["reference"]
    assert states["opened"]["shape"] != states["moved"]["shape"] == states["faster"]["shape"]
    assert states["moved"]["spoken"]["aspect"] == "3.700"
    assert states["faster"]["spoken"]["reynolds"] == f"{REYNOLDS:g}"
    for state in states.values():
        assert state["spoken"] == state["shown"]
        if not state["warned"]:
            assert number(state["drag"]) == pytest.approx(drag_at(name, state), rel=1e-3)


@every
def test_least_drag_button_finds_the_optimum(name):
    states, family = visited(name)["states"], surrogate_of(name).scene.family
    body = body_of(name, states["least"])
    assert family.contains(body)
    assert float(family.body_class.min_thickness_ratio(body)) >= CLEAR_THICKNESS_RATIO - 1e-9
    design = optimise(Problem(surrogate_of(name).scene, REYNOLDS), surrogate_of(name))
    assert drag_at(name, states["least"]) == pytest.approx(design.drag, rel=1e-4)
    assert drag_at(name, states["least"]) < drag_at(name, states["faster"])
    assert states["least"]["values"]["reynolds"] == states["faster"]["values"]["reynolds"]
    assert number(states["least"]["difference"]) < 0


@every
def test_contour_is_saved(name):
    head, *rows = visited(name)["saved"].split()
    saved = np.array([[float(x) for x in row.split(",")] for row in rows])
    body = body_of(name, visited(name)["states"]["least"])
    contour = surrogate_of(name).scene.family.outline(jnp.asarray(body), 400)
    assert head == "x,y"
    np.testing.assert_allclose(saved, contour, rtol=0, atol=1e-8)


@every
def test_body_that_crosses_itself_is_told(name):
    crossed, back = (visited(name)["states"][key] for key in ("crossed", "round"))
    assert (crossed["warned"], crossed["download"]) == (True, False)
    assert crossed["drag"] == crossed["difference"] == "\N{EN DASH}"
    assert (back["warned"], back["download"]) == (False, True)


@every
def test_reference_button_returns_to_it(name):
    state, family = visited(name)["states"]["round"], surrogate_of(name).scene.family
    np.testing.assert_array_equal(body_of(name, state), reference_body(family))
    assert state["drag"] == state["reference"]
    assert number(state["difference"]) == 0


@every
def test_reference_bodies_are_drawn_closed_and_to_scale(name):
    """In space spheres, by their outline as it is seen."""
    drawn = visited(name)["states"]["round"]["shape"]
    x, y = np.array(re.findall(r"-?[\d.]+", drawn), float).reshape(-1, 2).T
    if reference_body(surrogate_of(name).scene.family)[0] == 1:
        np.testing.assert_allclose(np.hypot(x, y), 0.5, atol=2e-3)
    area = np.sum(x * np.roll(y, 1) - y * np.roll(x, 1)) / 2
    assert abs(area) == pytest.approx(np.pi / 4, rel=5e-3)


@every
def test_sliders_obey_the_keyboard(name):
    """A hundredth of the range an arrow, a tenth a page key, Home and End to its ends."""
    before, stepped, ended = (visited(name)["states"][key] for key in ("round", "stepped", "ended"))
    scene = surrogate_of(name).scene
    low, high = np.log(scene.reynolds)
    moved = stepped["values"]["reynolds"] - before["values"]["reynolds"]
    assert moved == pytest.approx(-0.1 * (high - low))
    low, high = scene.family.bounds[0]
    moved = stepped["values"]["aspect"] - before["values"]["aspect"]
    assert moved == pytest.approx(0.01 * (high - low))
    assert ended["spoken"]["reynolds"] == f"{scene.reynolds[1]:g}"
    assert ended["values"]["aspect"] == low
