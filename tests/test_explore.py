"""The page that holds a surrogate: complete, offline, of any family, its arithmetic Python's."""

import dataclasses
import functools
import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pages import RECORD, cases, computed, every, read, surrogate_of

from shapeopt.commands import explore
from shapeopt.commands.cli import run
from shapeopt.render.page.page import page, reference_body, reference_name, write_page
from surrogate import Family
from surrogate.exports.plain import plain_network


@every
def test_page_holds_the_weights_and_scales(name):
    plain, data = plain_network(surrogate_of(name)), json.loads(read(name).scripts["data"])
    for part in ("weights", "biases"):
        for saved, own in zip(data[part], getattr(plain, part), strict=True):
            np.testing.assert_array_equal(saved, own)
    numbers = "logs", "scale", "shift", "mirror", "constant", "linear", "quadratic"
    for part in (*numbers, "inertial", "stokes"):
        np.testing.assert_array_equal(data[part], getattr(plain, part))


@every
def test_page_has_every_slider_with_its_bounds(name):
    scene, tags = surrogate_of(name).scene, read(name).tags
    sliders = {a["id"]: a for tag, a in tags if tag == "input" and a["type"] == "range"}
    bounds = {**dict(scene.family.ranges), "reynolds": np.log(scene.reynolds)}
    assert sliders.keys() == bounds.keys()
    for key, slider in sliders.items():
        assert [float(slider["min"]), float(slider["max"])] == list(bounds[key])
        assert bounds[key][0] <= float(slider["value"]) <= bounds[key][1]
    assert {a["for"] for tag, a in tags if tag == "label"} == sliders.keys()


@every
def test_page_needs_nothing_from_outside(name):
    text = page(surrogate_of(name))
    assert "://" not in text
    for tag, attributes in read(name).tags:
        assert tag not in ("img", "iframe", "object", "embed")
        assert "src" not in attributes
        if tag == "link":
            assert attributes["href"].startswith("data:")
    for loader in ("fetch(", "XMLHttpRequest", "import ", "@import", "url("):
        assert loader not in text


@every
def test_page_says_what_it_knows(name):
    text, record = page(surrogate_of(name)), surrogate_of(name).record
    assert f"{100 * record['drag_error_mean']:.2f} %" in text
    assert f"{100 * record['drag_error_max']:.2f} %" in text
    assert f"{record['held_out']} unseen bodies" in text
    assert f"Trained by the method {record['method']} on Re" in text
    low, high = surrogate_of(name).scene.reynolds
    assert f"Re {low:g} to {high:g}, aspect" in text


def test_page_names_stream_and_reference():
    assert "an unbounded stream" in page(surrogate_of("pretrained"))
    assert "Its family has no" not in page(surrogate_of("pretrained"))
    text = page(surrogate_of("no cylinder"))
    assert "a slip-walled tunnel of height 12 D" in text
    assert "Its family has no cylinder: bodies are compared with the 2:1 ellipse." in text
    assert '<button id="round" type="button">2:1 ellipse</button>' in text


@pytest.mark.parametrize(
    ("family", "body", "words"),
    [
        (Family(), [1, 0, 0, 0], "cylinder"),
        (Family(aspect=(0.25, 0.5)), [0.5], "0.5:1 ellipse"),
        (Family(aspect=(0.5, 3), beta2=(0.1, 0.2)), [1, 0.1], "roundest body"),
        (Family(aspect=(1, 3), incidence=(20, 90), dimension=3), [1, 20], "sphere"),
        (Family(aspect=(2, 4), dimension=3), [2], "2:1 spheroid"),
        (Family(aspect=(2, 4), incidence=(2, 12)), [2, 2], "2:1 ellipse at 2\N{DEGREE SIGN}"),
    ],
)
def test_reference_is_the_nearest_to_the_cylinder(family, body, words):
    assert reference_body(family).tolist() == body
    assert reference_name(family) == words


@every
def test_every_element_the_script_asks_for_exists(name):
    present = {attributes.get("id") for _, attributes in read(name).tags}
    assert set(re.findall(r'element\("([\w-]+)"\)', read(name).scripts["view"])) <= present
    for slider in surrogate_of(name).scene.family.names:
        assert {slider, f"{slider}-value", f"{slider}-way"} <= present


@every
def test_numbers_of_the_page_agree_with_python(name):
    """Loads, gradients and thickness ratio to 1e-9, contours to 1e-8."""
    network, family = surrogate_of(name).network, surrogate_of(name).scene.family
    loads = jax.jit(lambda *at: (network.loads(*at), jax.jacrev(network.loads)(*at)))
    outline = jax.jit(functools.partial(family.outline, nodes=64))
    contour = jax.jit(functools.partial(family.body_class.contour, nodes=64))
    for body, re_, row in zip(*cases(name), computed(name), strict=True):
        values, jacobian = loads(jnp.asarray(body), jnp.asarray(re_))
        found = [load["value"] for load in row["loads"]]
        np.testing.assert_allclose(found, values, rtol=1e-9, atol=1e-12)
        gradients = [load["gradient"] for load in row["loads"]]
        np.testing.assert_allclose(gradients, jacobian, rtol=1e-9, atol=1e-9)
        assert row["thickness_ratio"] == pytest.approx(
            float(family.body_class.min_thickness_ratio(body)), abs=1e-9
        )
        assert row["valid"] == (row["thickness_ratio"] >= 0.02)
        np.testing.assert_allclose(row["outline"], outline(body), rtol=0, atol=1e-8)
        np.testing.assert_allclose(row["contour"], contour(body), rtol=0, atol=1e-8)


def test_loads_of_the_page_are_the_surrogates():
    """All three to 1e-9; mirror images have equal drag, opposite lift and moment."""
    bodies, reynolds = cases("with lift")
    rows = computed("with lift")
    valid = np.array([row["valid"] for row in rows])
    loads, mirrored = (
        np.array([[load["value"] for load in row[key]] for row in rows])
        for key in ("loads", "mirrored")
    )
    expected = surrogate_of("with lift").loads(bodies[valid], reynolds[valid])
    assert valid.sum() > 5
    np.testing.assert_allclose(loads[valid], expected, rtol=1e-9)
    assert np.median(np.abs(loads)) > 0.01  # or the test would prove little
    np.testing.assert_allclose(mirrored, loads * [1, -1, -1], rtol=1e-12)


def test_page_with_lift_says_so():
    text, other = page(surrogate_of("with lift")), page(surrogate_of("pretrained"))
    assert "<h1>Drag and lift of a body in a slow stream</h1>" in text
    assert "<h1>Drag of a body in a slow stream</h1>" in other
    assert "moment about the centroid" in text
    assert "moment about the centroid" not in other
    for words in ("Camber, highest in the middle, \N{GREEK SMALL LETTER GAMMA}2", "nose up"):
        assert words in text
    record = RECORD | {"lift_error_mean": 0.002, "moment_error_mean": 0.003}
    record |= {"lift_error_max": 0.01, "moment_error_max": 0.02}
    known = dataclasses.replace(surrogate_of("with lift"), record=record)
    assert "Lift is off by 0.20 % of the drag (1.00 % at worst)" in page(known)
    assert "the moment by 0.30 % of the drag (2.00 % at worst)" in page(known)


def test_page_is_written_whole(tmp_path):
    text = page(surrogate_of("pretrained"))
    path = write_page(surrogate_of("pretrained"), tmp_path / "explore.html")
    assert path.read_text(encoding="utf-8") == text
    assert [path.name for path in tmp_path.iterdir()] == ["explore.html"]


def test_explore_command(tmp_path, capsys):
    out = tmp_path / "page.html"
    assert run(explore.main, ["--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["bytes"] == out.stat().st_size
    for bad in (["--out", str(tmp_path / "page.txt")], ["--out", str(out), "--surrogate", "none"]):
        assert run(explore.main, bad) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
