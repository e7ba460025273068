"""Pages of surrogates: one that ships, of eight modes, without a cylinder, in 3-D, with lift."""

import functools
import json
from html.parser import HTMLParser

import browser
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from shapeopt.render.page.page import page
from surrogate import Family, Scene, Surrogate, Tunnel, load
from surrogate.flow.grid.discretise import traction_modes
from surrogate.model.network import make_network
from surrogate.scene.samples import held_out_samples

NAMES = ("pretrained", "eight modes", "no cylinder", "in 3-D", "with lift", "at any angle")
SECTIONS = "pretrained:lift"  # in the tests of every page alone
RECORD = {"method": "none", "drag_error_mean": 0.0123, "drag_error_max": 0.045, "held_out": 7}
LIFT_SCENES = {
    "turned": [("set", "incidence", -3.0)],
    "cambered": [("set", "gamma2", 0.25), ("set", "incidence", 8.0)],
    "glide": [("click", "glide")],
}
REYNOLDS = 20.0  # where the least drag is asked for


@functools.cache
def surrogate_of(name):
    if name in ("pretrained", SECTIONS):
        return load(name)
    if name == "at any angle":
        return load("pretrained:particle")
    betas = {f"beta{k}": (-0.15, 0.15) for k in (2, 3, 4, 5, 6, 7, 9, 12)}
    if name == "eight modes":
        return untrained(Scene(family=Family(aspect=(1, 4), **betas)))
    if name == "in 3-D":
        return untrained(Scene(dimension=3, reynolds=(0.1, 100)))
    if name == "with lift":
        waves = {"beta2": (-0.4, 0.4), "beta3": (-0.15, 0.2), "gamma2": (-0.3, 0.4)}
        family = Family(aspect=(1.5, 4), **waves, gamma4=(-0.1, 0.1), incidence=(-4, 12))
        return untrained(Scene(reynolds=(5, 60), family=family))
    family = Family(aspect=(2, 4), beta2=(-0.3, 0.3), beta5=(-0.1, 0.1))
    return untrained(Scene(Tunnel(12), (0.01, 200), family))


def untrained(scene):
    """Random weights about a bowl of the drag in the parameters; scales of a slow stream."""
    generator = np.random.default_rng(0)
    bodies = held_out_samples(scene, 0, 512)
    low, high = scene.family.bounds.T
    places = (np.asarray(bodies.parameters) - low) / (high - low) - 0.6
    bowl = np.exp(np.sum(places**2, axis=1)) / np.asarray(bodies.reynolds) ** 0.6
    modes = traction_modes(scene)
    oseen = 1 + 0.01 * generator.standard_normal((512, modes.count))
    outputs = np.log(bowl)[:, None]
    if modes.lift_index is not None:  # lift by incidence and camber, moment by slender bodies
        turned = places[:, -1] + places[:, -3]
        outputs = np.column_stack([outputs, turned, turned * places[:, 0]])
    key = jax.random.key(1)
    network = make_network(scene, key, *bodies, -oseen * bowl[:, None], jnp.asarray(outputs))
    if modes.lift_index is not None:  # so much that the best glide is inside of some ranges
        network = eqx.tree_at(
            lambda net: net.layers[-1].weight, network, replace_fn=lambda w: 20 * w
        )
    return Surrogate(network, scene, RECORD)


class Reader(HTMLParser):
    """Tags with their attributes, and the text of scripts by id."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.scripts, self.open = [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.open = dict(attributes).get("id") if tag == "script" else None

    def handle_data(self, data):
        if self.open:
            self.scripts[self.open] = self.scripts.get(self.open, "") + data

    def handle_endtag(self, tag):
        self.open = None


@functools.cache
def read(name):
    return Reader(page(surrogate_of(name)))


def cases(name):
    """Bodies from all over the family, some of them at its corners, with Reynolds numbers."""
    generator, scene = np.random.default_rng(0), surrogate_of(name).scene
    low, high = scene.family.bounds.T
    bodies = np.concatenate([generator.uniform(low, high, (12, len(low))), [low, high]])
    return bodies, np.exp(generator.uniform(*np.log(scene.reynolds), len(bodies)))


def crossing(family):
    """The body of the ranges that is thinnest at its tail, where sin kt / sin t is k or -k."""
    modes = [parameter.mode for parameter in family.body_class.parameters]
    ends = zip(modes, family.bounds.tolist(), strict=True)
    return [ends[mode is not None and mode % 2 == 0] for mode, ends in ends]


def expression(name):
    """What the page's model says of the cases and their mirror images, in its language."""
    bodies, reynolds = (json.dumps(values.tolist()) for values in cases(name))
    mirror = surrogate_of(name).network.inputs.mirror[:-1].tolist()
    return (
        f"{bodies}.map((body, k) => ({{loads: model.loads(body, {reynolds}[k]), mirrored: "
        f"model.loads(body.map((x, j) => {mirror}[j] * x), {reynolds}[k]), "
        "thickness_ratio: model.thicknessRatio(body), valid: model.valid(body), "
        "outline: model.outline(body, 64), contour: model.contour(body, 64)}))"
    )


@functools.cache
def used_page(name):
    """Return what a browser shows of a page after sliders are moved, buttons and keys pressed."""
    if not browser.BROWSER:
        pytest.skip(f"none of {', '.join(browser.NAMES)} is installed to click in the page")
    family = surrogate_of(name).scene.family
    bent = zip(family.names, crossing(family), strict=True)
    scenes = {
        "moved": [("set", "aspect", 3.7)],
        "faster": [("set", "reynolds", float(np.log(REYNOLDS)))],
        "least": [("click", "least")],
        "saved": [("click", "download")],
        **(LIFT_SCENES if name == "with lift" else {}),
        "crossed": [("set", *pair) for pair in bent],
        "round": [("click", "round")],
        "stepped": [("press", "reynolds", "PageDown"), ("press", "aspect", "ArrowRight")],
        "ended": [("press", "reynolds", "End"), ("press", "aspect", "Home")],
        "typed": [("type", "aspect", "2,75"), ("type", "reynolds", "9e9")],
        "nonsense": [("type", "aspect", "long"), ("type", "reynolds", "-1")],
    }
    return browser.visit(page(surrogate_of(name)), scenes, expression(name))


@functools.cache
def opened_page(name):
    """Return the first state of a page in the browser, before anything is clicked."""
    if not browser.BROWSER:
        pytest.skip(f"none of {', '.join(browser.NAMES)} is installed to open the page")
    return browser.visit(page(surrogate_of(name)), {}, "null")["states"]["opened"]


@functools.cache
def computed(name):
    """What the page's model says of the cases, in the browser or else in node."""
    if browser.BROWSER:
        return used_page(name)["computed"]
    if not browser.NODE:
        pytest.skip("neither Chromium nor node is installed to run the page's script")
    return browser.compute(read(name).scripts, expression(name))


RARE = ("eight modes", "no cylinder", "at any angle", SECTIONS)  # the others cover most
every = pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.slow) if n in RARE else n for n in (*NAMES, SECTIONS)],
)
