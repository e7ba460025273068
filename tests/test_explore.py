"""The page that holds a surrogate: complete, offline, and its arithmetic agrees with Python."""

import json
import re
import shutil
import subprocess
from html.parser import HTMLParser

import explore
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from common import run

from shapeopt.render.page.page import page, write_page
from shapeopt.search.optimise import optimise
from shapeopt.problem.problem import Problem
from surrogate.body.family import PARAMETERS, family_markers, opening
from surrogate.model.store import load_surrogate

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


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


@pytest.fixture(scope="module")
def pretrained():
    return load_surrogate("pretrained")


@pytest.fixture(scope="module")
def text(pretrained):
    return page(pretrained)


@pytest.fixture(scope="module")
def reader(text):
    return Reader(text)


@pytest.fixture(scope="module")
def cases(pretrained):
    """Bodies from all over the family, some of them at its corners, with Reynolds numbers."""
    generator = np.random.default_rng(0)
    low, high = pretrained.scene.family.bounds.T
    bodies = np.concatenate([generator.uniform(low, high, (12, len(low))), [low, high]])
    reynolds = np.exp(generator.uniform(*np.log(pretrained.scene.reynolds), len(bodies)))
    return bodies, reynolds


def evaluate(reader, expression, tmp_path):
    """Value of a JavaScript expression in ``model``, made by the page's own script and data."""
    program = (
        f"const data = {reader.scripts['data']};\n{reader.scripts['model']}\n"
        f"const model = makeModel(data);\nconst answer = JSON.stringify({expression});\n"
    )
    if node := shutil.which("node"):
        script = tmp_path / "program.js"
        script.write_text(program + "console.log(answer);")
        command = [node, str(script)]
    elif browser := next(filter(None, map(shutil.which, BROWSERS)), None):
        script = tmp_path / "program.html"
        script.write_text(
            f"<pre></pre><script>{program}document.body.textContent = answer</script>"
        )
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom"]
        command.append(script.as_uri())
    else:
        pytest.skip("neither node nor Chromium is installed to run the page's script")
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return json.loads(re.sub(r"<[^>]*>", "", done.stdout))


def test_page_holds_the_weights_and_scales(pretrained, reader):
    data = json.loads(reader.scripts["data"])
    assert len(data["layers"]) == len(pretrained.network.layers)
    for saved, layer in zip(data["layers"], pretrained.network.layers, strict=True):
        np.testing.assert_array_equal(saved["weight"], layer.weight)
        np.testing.assert_array_equal(saved["bias"], layer.bias)
    for name in ("low", "high", "size", "mean", "spread"):
        np.testing.assert_array_equal(data[name], getattr(pretrained.network, name))


def test_page_has_every_slider_with_its_bounds(pretrained, reader):
    sliders = {a["id"]: a for tag, a in reader.tags if tag == "input" and a["type"] == "range"}
    bounds = dict(zip(PARAMETERS, pretrained.scene.family.bounds, strict=True))
    bounds["reynolds"] = np.log(pretrained.scene.reynolds)
    assert sliders.keys() == bounds.keys()
    for name, slider in sliders.items():
        assert [float(slider["min"]), float(slider["max"])] == list(bounds[name])
        assert bounds[name][0] <= float(slider["value"]) <= bounds[name][1]
    labels = {a["for"] for tag, a in reader.tags if tag == "label"}
    assert labels == sliders.keys()


def test_page_needs_nothing_from_outside(text, reader):
    assert "://" not in text
    for tag, attributes in reader.tags:
        assert tag not in ("img", "iframe", "object", "embed")
        assert "src" not in attributes
        if tag == "link":
            assert attributes["href"].startswith("data:")
    for loader in ("fetch(", "XMLHttpRequest", "import ", "@import", "url("):
        assert loader not in text


def test_page_says_what_it_knows(pretrained, text):
    record = pretrained.record
    assert f"{100 * record['drag_error_mean']:.2f} %" in text
    assert f"{100 * record['drag_error_max']:.2f} %" in text
    assert "Trained" in text
    assert f"{record['held_out']} unseen bodies" in text


def test_every_element_the_script_asks_for_exists(reader):
    present = {attributes.get("id") for _, attributes in reader.tags}
    assert set(re.findall(r'element\("([\w-]+)"\)', reader.scripts["view"])) <= present
    for name in PARAMETERS:
        assert {name, f"{name}-value", f"{name}-way"} <= present


def test_numbers_of_the_page_agree_with_python(pretrained, reader, cases, tmp_path):
    """Drag, gradient, opening and contour to 1e-9."""
    bodies, reynolds = cases
    found = evaluate(
        reader,
        f"{json.dumps(bodies.tolist())}.map((body, k) => ({{...model.drag(body, "
        f"{json.dumps(reynolds.tolist())}[k]), opening: model.opening(body), "
        "contour: model.contour(body, 64)}))",
        tmp_path,
    )
    drag = jax.jit(jax.value_and_grad(pretrained.drag))
    for body, re_, row in zip(bodies, reynolds, found, strict=True):
        cd, gradient = drag(jnp.asarray(body), jnp.asarray(re_))
        assert row["cd"] == pytest.approx(float(cd), rel=1e-9)
        np.testing.assert_allclose(row["gradient"], gradient, rtol=1e-9, atol=1e-9)
        assert row["opening"] == pytest.approx(float(opening(jnp.asarray(body))), abs=1e-9)
        np.testing.assert_allclose(
            row["contour"], family_markers(jnp.asarray(body), 64), rtol=0, atol=1e-9
        )


@pytest.mark.parametrize("reynolds", [1.0, 20.0, 40.0])
def test_least_drag_button_finds_the_optimum(pretrained, reader, reynolds, tmp_path):
    found = evaluate(reader, f"model.leastDrag(model.cylinder, {reynolds})", tmp_path)
    expected = optimise(Problem(pretrained.scene, reynolds), pretrained)
    assert pretrained.scene.family.contains(np.array(found["parameters"]))
    assert found["cd"] == pytest.approx(expected.drag, rel=1e-4)


def test_bodies_that_cross_themselves_are_told(reader, tmp_path):
    verdicts = evaluate(
        reader, "[[2, 0.9, 0, 0], [2, 0, 0, 0], [2, 0, -0.6, 0]].map(model.valid)", tmp_path
    )
    assert verdicts == [False, True, False]


def test_page_is_written_whole(pretrained, text, tmp_path):
    assert write_page(pretrained, tmp_path / "explore.html").read_text(encoding="utf-8") == text
    assert [path.name for path in tmp_path.iterdir()] == ["explore.html"]


def test_explore_command(tmp_path, capsys):
    out = tmp_path / "page.html"
    assert run(explore.main, ["--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["bytes"] == out.stat().st_size
    for bad in (["--out", str(tmp_path / "page.txt")], ["--out", str(out), "--surrogate", "none"]):
        assert run(explore.main, bad) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
