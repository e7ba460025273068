"""The page that holds a surrogate: complete, offline, of any family, its arithmetic Python's."""

import functools
import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pages import cases, computed, every, read, surrogate_of

from shapeopt.commands import explore
from shapeopt.commands.cli import run
from shapeopt.render.page.page import page, reference_body, reference_name, write_page
from surrogate import Family


@every
def test_page_holds_the_weights_and_scales(name):
    network, data = surrogate_of(name).network, json.loads(read(name).scripts["data"])
    assert len(data["layers"]) == len(network.layers)
    for saved, layer in zip(data["layers"], network.layers, strict=True):
        np.testing.assert_array_equal(saved["weight"], layer.weight)
        np.testing.assert_array_equal(saved["bias"], layer.bias)
    for scale in ("low", "high"):
        np.testing.assert_array_equal(data[scale], getattr(network.inputs, scale))
    np.testing.assert_array_equal(data["trends"], network.trends)


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
    """Drag, gradient and opening to 1e-9, the contour to 1e-8."""
    network, family = surrogate_of(name).network, surrogate_of(name).scene.family
    drag = jax.jit(jax.value_and_grad(network.drag))
    markers = jax.jit(functools.partial(family.outline, nodes=64))
    for body, re_, row in zip(*cases(name), computed(name), strict=True):
        cd, gradient = drag(jnp.asarray(body), jnp.asarray(re_))
        assert row["cd"] == pytest.approx(float(cd), rel=1e-9)
        np.testing.assert_allclose(row["gradient"], gradient, rtol=1e-9, atol=1e-9)
        assert row["opening"] == pytest.approx(
            float(family.body_class.min_thickness_ratio(body)), abs=1e-9
        )
        assert row["valid"] == (row["opening"] >= 0.02)
        np.testing.assert_allclose(row["contour"], markers(body), rtol=0, atol=1e-8)


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
