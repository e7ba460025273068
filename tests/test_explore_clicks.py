"""A page in the browser: sliders, buttons and keys do what they say."""

import functools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pages import NAMES, RARE, REYNOLDS, every, opened_page, surrogate_of, used_page

from shapeopt import Problem, optimise
from shapeopt.render.page.page import reference_body
from shapeopt.search.over_lift import designs_over_lift
from surrogate.body.validity import CLEAR_THICKNESS_RATIO

PITCH = 0.35  # of the page's view of 3-D bodies, from above


@jax.jit
def network_loads(network, body, log_re):
    return network.loads(body, jnp.exp(log_re))


def body_of(name, state):
    return np.array([state["values"][key] for key in surrogate_of(name).scene.family.names], float)


def drag_at(name, state):
    """Cd of the sliders' body and Reynolds number, by the network in Python."""
    body, log_re = body_of(name, state), state["values"]["reynolds"]
    return float(network_loads(surrogate_of(name).network, body, log_re)[0])


@functools.cache
def over_lift():
    """Bodies of least drag over two bounds on the lift, a slack one first; that of best glide."""
    return designs_over_lift(surrogate_of("with lift"), REYNOLDS, [-9.0, 0.1])[:2]


def least_drag(name):
    """Least Cd by the search in Python."""
    if name == "with lift":
        return over_lift()[0][0]["cd"]
    return optimise(Problem(surrogate_of(name).scene, REYNOLDS), surrogate_of(name)).drag


def number(text):
    return float(text.replace("\N{MINUS SIGN}", "-").replace("%", ""))


@every
def test_sliders_move_drag_shape_and_words(name):
    """Re speaks its number, not its logarithm."""
    states = used_page(name)["states"]
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
def test_values_may_be_typed(name):
    """Decimal commas and minus signs as printed are read; ends hold, and words change nothing."""
    states = used_page(name)["states"]
    reynolds = surrogate_of(name).scene.reynolds
    assert states["typed"]["values"]["aspect"] == 2.75
    assert np.exp(states["typed"]["values"]["reynolds"]) == pytest.approx(reynolds[1])
    assert states["nonsense"]["values"] == states["typed"]["values"]
    assert states["nonsense"]["shown"] == states["typed"]["shown"]


@every
def test_least_drag_button_finds_the_optimum(name):
    states, family = used_page(name)["states"], surrogate_of(name).scene.family
    body = body_of(name, states["least"])
    assert family.contains(body)
    assert float(family.body_class.min_thickness_ratio(body)) >= CLEAR_THICKNESS_RATIO - 1e-9
    assert drag_at(name, states["least"]) == pytest.approx(least_drag(name), rel=1e-4)
    assert drag_at(name, states["least"]) < drag_at(name, states["faster"])
    assert states["least"]["values"]["reynolds"] == states["faster"]["values"]["reynolds"]
    assert number(states["least"]["difference"]) < 0


@every
def test_contour_is_saved(name):
    comment, head, *rows = used_page(name)["saved"].strip().split("\n")
    saved = np.array([[float(x) for x in row.split(",")] for row in rows])
    body = body_of(name, used_page(name)["states"]["least"])
    contour = surrogate_of(name).scene.family.outline(jnp.asarray(body), 400)
    assert head == "x,y"
    named = re.findall(r"(\w+) (-?[\d.e-]+)(?:,|$)", comment)
    family = surrogate_of(name).scene.family
    assert [word for word, _ in named[: len(body)]] == list(family.names)
    np.testing.assert_allclose([float(x) for _, x in named[: len(body)]], body, rtol=1e-8)
    assert ("at incidence 0" in comment) == ("incidence" in family.names)
    np.testing.assert_allclose(saved, contour, rtol=0, atol=1e-8)


@every
def test_body_that_crosses_itself_is_told(name):
    crossed, back = (used_page(name)["states"][key] for key in ("crossed", "round"))
    if name == "at any angle":  # no body of this family crosses itself
        assert not crossed["warned"]
        return
    assert (crossed["warned"], crossed["download"]) == (True, False)
    assert crossed["drag"] == crossed["difference"] == "\N{EN DASH}"
    assert (back["warned"], back["download"]) == (False, True)


@every
def test_reference_button_returns_to_it(name):
    state, family = used_page(name)["states"]["round"], surrogate_of(name).scene.family
    np.testing.assert_array_equal(body_of(name, state), reference_body(family))
    assert state["drag"] == state["reference"]
    assert number(state["difference"]) == 0


@every
def test_reference_bodies_are_drawn_closed_and_to_scale(name):
    """In space spheres, by their outline as it is seen."""
    drawn = used_page(name)["states"]["round"]["shape"]
    x, y = np.array(re.findall(r"-?[\d.]+", drawn), float).reshape(-1, 2).T
    if reference_body(surrogate_of(name).scene.family)[0] == 1:
        np.testing.assert_allclose(np.hypot(x, y), 0.5, atol=2e-3)
    area = np.sum(x * np.roll(y, 1) - y * np.roll(x, 1)) / 2
    assert abs(area) == pytest.approx(np.pi / 4, rel=5e-3)


@every
def test_sliders_obey_the_keyboard(name):
    """A hundredth of the range an arrow, a tenth a page key, Home and End to its ends."""
    keys = "round", "stepped", "ended"
    before, stepped, ended = (used_page(name)["states"][key] for key in keys)
    scene = surrogate_of(name).scene
    low, high = np.log(scene.reynolds)
    moved = stepped["values"]["reynolds"] - before["values"]["reynolds"]
    assert moved == pytest.approx(-0.1 * (high - low))
    low, high = scene.family.bounds[0]
    moved = stepped["values"]["aspect"] - before["values"]["aspect"]
    assert moved == pytest.approx(0.01 * (high - low))
    assert ended["spoken"]["reynolds"] == f"{scene.reynolds[1]:g}"
    assert ended["values"]["aspect"] == low


def test_only_pages_with_lift_show_it():
    for name in NAMES:
        lifts = name in ("with lift", "at any angle")
        state = opened_page(name) if name in RARE else used_page(name)["states"]["opened"]
        assert state["seen"] == (["cl", "glide", "lift"] if lifts else [])
        assert bool(state["force"]) == bool(state["best"]) == lifts
        assert bool(state["byChord"]) == (name == "with lift")


def loads_of(state):
    """Cd, Cl and Cm of the sliders' body and Reynolds number, by the network in Python."""
    body, log_re = body_of("with lift", state), state["values"]["reynolds"]
    return np.asarray(network_loads(surrogate_of("with lift").network, body, log_re))


def test_sliders_move_lift_moment_and_the_force():
    """The arrow is as steep as the force; the incidence is told in degrees."""
    states = used_page("with lift")["states"]
    for key in ("opened", "turned", "cambered"):
        state = states[key]
        cd, cl, cm = loads_of(state)
        shown = [number(state["lift"][name]) for name in ("cl", "cm", "ratio")]
        last = 10.0 ** (np.floor(np.log10(cd)) - 3)  # as many decimals as Cd with four digits
        assert shown[:2] == pytest.approx([cl, cm], abs=0.51 * last)
        assert shown[2] == pytest.approx(cl / cd, abs=5.1e-4)
        tip = re.match(r"M0 0L([-\d.]+) ([-\d.]+)M", state["force"])
        assert -float(tip[2]) / float(tip[1]) == pytest.approx(cl / cd, abs=2e-3)
        chord, *said = map(number, re.findall(r"[-\N{MINUS SIGN}\d.]+\d", state["byChord"]))
        assert chord == pytest.approx(np.sqrt(body_of("with lift", state)[0]), abs=1e-3)
        by_chord = [np.exp(state["values"]["reynolds"]) * chord, cd / chord, cl / chord]
        assert said == pytest.approx([*by_chord, cm / chord**2], rel=1e-3, abs=1.5e-3)
    assert states["crossed"]["byChord"] == ""
    assert states["turned"]["spoken"]["incidence"] == "\N{MINUS SIGN}3.00\N{DEGREE SIGN}"
    drawn = [states[key]["shape"] for key in ("opened", "turned", "cambered")]
    assert len(set(drawn)) == 3


def test_bodies_lie_at_their_incidence():
    """Drawn as they lie in the stream, saved as they are at zero incidence."""
    state = used_page("with lift")["states"]["cambered"]
    points = np.array(re.findall(r"-?[\d.]+", state["shape"]), float).reshape(-1, 2) * [1, -1]
    family = surrogate_of("with lift").scene.family
    expected = family.markers(jnp.asarray(body_of("with lift", state)), 240)
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-4)


def test_best_glide_button_finds_the_best_ratio():
    """Within the ranges, of a body that does not cross itself; no random draw has a better one."""
    state, net = used_page("with lift")["states"]["glide"], surrogate_of("with lift")
    body, family = body_of("with lift", state), net.scene.family
    assert family.contains(body)
    assert float(family.body_class.min_thickness_ratio(body)) >= CLEAR_THICKNESS_RATIO - 1e-9
    assert np.exp(state["values"]["reynolds"]) == pytest.approx(REYNOLDS)
    draws = net.loads(family.sample(jax.random.key(3), 4096), REYNOLDS)
    cd, cl, _ = loads_of(state)
    assert cl / cd >= float((draws[:, 1] / draws[:, 0]).max())
    (least, bound), best = over_lift()
    assert cl / cd == pytest.approx(best["glide"], rel=1e-4)
    assert bound["cl"] >= 0.1 - 1e-6 > least["cl"]
    assert bound["cd"] > least["cd"]


def test_best_glide_over_the_incidence_is_marked():
    """It is that of the shape that is shown, at its Reynolds number."""
    states, family = used_page("with lift")["states"], surrogate_of("with lift").scene.family
    turns = np.linspace(*family.bounds[-1], 801)
    loads_of_all = jax.jit(jax.vmap(surrogate_of("with lift").network.loads, (0, None)))
    for key in ("opened", "cambered", "glide"):
        body = body_of("with lift", states[key])
        shapes = jnp.asarray([[*body[:-1], turn] for turn in turns])
        loads = loads_of_all(shapes, jnp.exp(states[key]["values"]["reynolds"]))
        glide = np.asarray(loads[:, 1] / loads[:, 0])
        ratio, incidence = states[key]["best"].removesuffix("\N{DEGREE SIGN}").split(" at ")
        assert number(ratio) == pytest.approx(glide.max(), abs=6e-4)
        assert number(incidence) == pytest.approx(turns[np.argmax(glide)], abs=0.08)
        for curve in states[key]["curves"]:
            assert curve.count("<circle") == 2
    crossed = states["crossed"]
    assert set(crossed["lift"].values()) == {"\N{EN DASH}"}
    assert crossed["force"] == crossed["best"] == "".join(crossed["curves"]) == ""


def test_3d_bodies_are_drawn_at_their_incidence():
    """The outline is as wide and as high as that of the turned ellipsoid in the page's view."""
    name = "at any angle"
    state, family = used_page(name)["states"]["opened"], surrogate_of(name).scene.family
    named = family.named(body_of(name, state))
    assert named["beta2"] == 0
    assert named["incidence"] > 1
    values = np.array(list(named.values()))
    length, flatness = float(family.body_class.length(values)) / 2, named["flatness"]
    height = np.sqrt(1 / 8 / length / flatness)
    axes, turn = np.array([length, flatness * height, height]), np.radians(named["incidence"])
    frame = np.array([[np.cos(turn), 0, -np.sin(turn)], [0, 1, 0], [np.sin(turn), 0, np.cos(turn)]])
    right = np.array([1.0, 0.0, 0.0])
    up = np.array([0.0, np.sin(PITCH), np.cos(PITCH)])
    drawn = np.array(re.findall(r"-?[\d.]+", state["shape"]), float).reshape(-1, 2)
    for found, direction in zip(drawn.T, (right, up), strict=True):
        assert np.max(np.abs(found)) == pytest.approx(
            np.linalg.norm(axes * (frame @ direction)), abs=2e-3
        )
