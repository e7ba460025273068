"""Careless, hostile and unlucky uses: nothing of the user's is lost, nothing wrong is said."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import threading
import time
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from PIL import Image

from shapeopt import (
    LogNormal,
    Problem,
    Robust,
    Station,
    Weighted,
    load_run,
    optimise,
    save_run,
    verify,
)
from shapeopt.commands import cli, explore, march, payoff, render
from shapeopt.commands import optimise as optimise_shape
from shapeopt.commands.entry import loading
from shapeopt.payoff.queries import query_stream
from shapeopt.render.figures import plt, save_figure
from surrogate import (
    Family,
    Flow,
    InvalidInput,
    Particle,
    Scene,
    contour_shape,
    family_shape,
    load,
    naca4,
    read_contour,
    save,
    train,
)
from surrogate.body.contour import smooth_contour
from surrogate.scene.fidelity import Fidelity
from surrogate.training.samples import training_samples

ROOT = Path(__file__).parents[1]
BODY = [2.0, 0.1, 0.0, 0.0]
T = np.linspace(0, 2 * np.pi, 80, endpoint=False)
ROUND = np.stack([np.cos(T), 0.5 * np.sin(T)], axis=1)


@pytest.fixture(scope="module")
def net():
    return load("pretrained")


@pytest.fixture(scope="module")
def designed(net):
    return optimise(Problem(net.scene, 20.0), net)


# Loss: only files that the project wrote are replaced.


@pytest.mark.parametrize("name", ["contour.csv", "notes.txt", "run.json"])
def test_a_folder_that_is_not_a_runs_is_refused(designed, tmp_path, name):
    (tmp_path / name).write_text('{"scripts": "mine"}')
    with pytest.raises(InvalidInput, match="choose another folder"):
        save_run(tmp_path, designed)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == '{"scripts": "mine"}'


def test_a_folder_in_the_place_of_a_file_is_seen_before_the_work(designed, tmp_path):
    (tmp_path / "run" / "body.stl").mkdir(parents=True)
    with pytest.raises(InvalidInput, match=r"body\.stl"):
        save_run(tmp_path / "run", designed)


def test_marches_and_payoffs_leave_strangers_folders(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    words = ["--aspect", "1", "--reynolds", "20", "--out", str(tmp_path)]
    with pytest.raises(InvalidInput, match=r"thesis\.txt"):
        march.main(words)
    (tmp_path / "payoff" / "run-0").mkdir(parents=True)
    (tmp_path / "payoff" / "run-0" / "notes.txt").write_text("mine")
    with pytest.raises(InvalidInput, match=r"run-0: is not empty"):
        payoff.main(["--out", str(tmp_path / "payoff")])


def test_marches_and_payoffs_leave_strangers_pictures(tmp_path):
    for folder, name in (("march", "march.gif"), ("payoff", "shapes.png")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).write_text("mine")
    march_words = ["--aspect", "1", "--reynolds", "20", "--out", str(tmp_path / "march")]
    for main, words in ((march.main, march_words), (payoff.main, ["--out", f"{tmp_path}/payoff"])):
        with pytest.raises(InvalidInput, match=r"(march\.gif|shapes\.png): is of another program"):
            main(words)


def test_a_memory_lies_beside_the_run(tmp_path):
    words = ["--until", "flow", "--reynolds", "20", "--out", f"{tmp_path}/a"]
    with pytest.raises(InvalidInput, match="name a place beside it"):
        optimise_shape.main([*words, "--memory", f"{tmp_path}/a/memory.json"])


def test_a_page_of_the_users_own_stays(net, tmp_path):
    (tmp_path / "page.html").write_text("<html>mine</html>")
    with pytest.raises(InvalidInput, match="another program"):
        explore.main(["--out", str(tmp_path / "page.html")])
    assert (tmp_path / "page.html").read_text() == "<html>mine</html>"
    for _ in range(2):  # its own it writes again
        assert explore.main(["--out", str(tmp_path / "own.html")])["bytes"] > 1000


@pytest.mark.parametrize("name", ["photo.png", "film.gif"])
def test_pictures_of_the_users_own_stay(designed, tmp_path, name):
    save_run(tmp_path / "run", designed, verify=False)
    (tmp_path / name).write_bytes(b"mine")
    words = ["--runs", str(tmp_path / "run"), "--out", str(tmp_path / name)]
    with pytest.raises(InvalidInput, match="another program"):
        render.main(words)
    assert (tmp_path / name).read_bytes() == b"mine"
    (tmp_path / name).unlink()
    if name.endswith(".png"):
        words.append("--surface")
    for _ in range(2):  # its own it draws again
        render.main(words)
    with Image.open(tmp_path / name) as picture:
        for frame in range(getattr(picture, "n_frames", 1)):
            picture.seek(frame)
            picture.load()
        if name.endswith(".png"):
            assert picture.info["Source"] == "drag-surrogates"


def test_other_formats_are_not_signed(tmp_path):
    for name in ("figure.svg", "figure.pdf", "figure.jpg", "figure.PNG"):
        save_figure(plt.figure(figsize=(1, 1)), tmp_path / name)
        signed = (tmp_path / name).read_bytes()[-64:].count(b"drag-surrogates")
        assert signed == (name == "figure.PNG")
    for name in ("figure.jpg", "figure.PNG"):
        Image.open(tmp_path / name).load()


def test_a_link_stays_a_link(tmp_path):
    from surrogate.files import whole_file

    (tmp_path / "kept.json").write_text("old")
    (tmp_path / "link.json").symlink_to(tmp_path / "kept.json")
    with whole_file(tmp_path / "link.json") as part:
        part.write_text("new")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "kept.json").read_text() == "new"


# Silence: the API refuses what the scripts refuse.

CROSSING = [2.0, 0.9, 0.0, 0.0]
NO_BODIES = [[2.0, 0.1, 0.0], [*BODY, 0.0], "abcd", None, {"aspect": 2}, [2.0, "0.1", 0, 0], [BODY]]


@pytest.mark.parametrize("bad", NO_BODIES, ids=str)
def test_no_door_takes_what_is_no_body(net, designed, bad, unchecked):
    flow = Flow(Scene(fidelity="draft"))
    for door in (net.beyond, net.knows, flow.slope):
        with pytest.raises(InvalidInput):
            door(bad, 20.0)
    with pytest.raises(InvalidInput):
        verify(designed.problem, bad)


def test_slopes_and_labels_check_bodies_and_reynolds_numbers(unchecked):
    flow = Flow(Scene(fidelity="draft"))
    for body, reynolds in (
        ([-1.0, 0.1, 0, 0], 20.0),
        (BODY, -1.0),
        (BODY, 200.0),
        (CROSSING, 20.0),
        ([9.0, 0.0, 0.0, 0.0], 20.0),
        (BODY, np.nan),
    ):
        with pytest.raises(InvalidInput):
            flow.slope(body, reynolds)
        with pytest.raises(InvalidInput):
            flow.labels(np.array([body]), np.array([reynolds]))
    with pytest.raises(InvalidInput, match="1 bodies"):
        flow.labels(np.array([BODY]), np.array([1.0, 2.0]))


@pytest.mark.parametrize("bad", [0, -1, "20", None, [10, 20], np.bool_(True), np.nan, 10**400])
def test_what_is_no_reynolds_number_lies_in_no_range(net, bad, unchecked):
    with pytest.raises(InvalidInput):
        net.beyond(BODY, bad)


def test_traced_batches_are_told_of_vmap(net):
    for model in (net, Flow(Scene(fidelity="draft"))):
        with pytest.raises(InvalidInput, match=r"jax\.vmap"):
            jax.jit(model.drag)(jnp.array([BODY]), jnp.array([20.0]))
        with pytest.raises(InvalidInput, match=r"\(4,\)"):
            jax.jit(model.drag)(jnp.array(BODY[:3]), jnp.asarray(20.0))


WRONG_WORDS = {
    "optimise": lambda net: optimise("x", net),
    "stations": lambda net: Problem(net.scene, 20.0, stations=[(0.5, 0.3)]),
    "within": lambda net: Problem(net.scene, 20.0, within="aspect"),
    "list of numbers": lambda net: Weighted(10, 40),
    "no aspect": lambda net: family_shape({"beta2": 0.1}),
    "no parameter": lambda net: family_shape({"aspect": 2, "beta13": 0.1}),
    "path": lambda net: load(5),
    "density": lambda net: Particle("heavy", 1e-6, 1e-4),
    "viscosity": lambda net: Particle(2.0, 1e-300, 1e-4),
    "shape": lambda net: contour_shape(np.ones((12, 2)) * 1j),
    "points": lambda net: contour_shape(np.ones((0, 2))),
    "masked": lambda net: contour_shape(np.ma.masked_less(ROUND, 0.5)),
    "aspect, beta2": lambda net: net.scene.family.parameters({}),
    "aspect '2'": lambda net: net.scene.family.parameters({"aspect": "2"}),
    "dimension 4": lambda net: family_shape({"aspect": 2}, 0, 4),
    "count -1": lambda net: net.scene.family.sample(jax.random.key(0), -1),
    "fidelity": lambda net: Fidelity(None, 8, 3, 4, 4),
    "range of aspect": lambda net: Family(aspect=np.array(5)),
    "Reynolds range": lambda net: Scene(reynolds=np.array(40)),
    "a list of numbers": lambda net: Weighted(np.array(5.0), np.array(1.0)),
    "preset": lambda net: train(preset=[]),
    "dimension array": lambda net: Scene(dimension=np.array([2, 3])),
    "until": lambda net: optimise(Problem(net.scene, 20), net, until=np.array(["a", "b"])),
    "points -5": lambda net: naca4("0012", -5),
    "NewtonSettings": lambda net: Flow(net.scene, settings="x"),
    "too long": lambda net: load("x" * 5000),
    "pretrained:sip": lambda net: load("pretrained:nope"),
    "path ''": lambda net: load(""),
    "Unicode": lambda net: load("\udcff"),
    "number": lambda net: net.drag(BODY, np.array("20")),
    "body": lambda net: net.drag(jax.random.key(0), 20.0),
    "traced as key": lambda net: jax.jit(lambda key: net.drag(key, 20.0))(jax.random.key(0)),
    "one number": lambda net: net.drag(BODY, np.array(True)),
    "must be numbers": lambda net: net.drag([2.0, False, 0, 0], 20.0),
    "jax.numpy array": lambda net: jax.grad(lambda a: net.drag([a, 0.1, 0, 0], 20.0))(2.0),
    "complex128": lambda net: jax.jit(net.drag)(jnp.array(BODY) + 1j, 20.0),
    "'20'": lambda net: jax.jit(lambda body: net.drag(body, "20"))(jnp.array(BODY)),
    "'2'": lambda net: jax.jit(lambda re: net.drag(["2", "0", "0", "0"], re))(20.0),
    "cylinder": lambda net: verify(Problem(net.scene, 20), BODY, cylinder=[np.inf]),
    "million cells": lambda net: Fidelity("", 128, 80, 80, 80),
    "path ": lambda net: Scene.read(b"x"),
    "save": lambda net: save("x", None),
    "save_run": lambda net: save_run("x", None),
    "four digits": lambda net: naca4(12),
    "bodies 'x'": lambda net: net.scene.explain("x"),
    "real numbers": lambda net: contour_shape([[1, 2], [3]]),
}


@pytest.mark.parametrize("words", WRONG_WORDS)
def test_wrong_kinds_get_one_clear_line(net, words, unchecked):
    with pytest.raises(InvalidInput, match=words.strip()) as refusal:
        WRONG_WORDS[words](net)
    assert len(str(refusal.value).splitlines()) == 1


def test_numbers_of_every_kind_are_numbers(net, unchecked):
    plain = float(net.drag(BODY, 20.0))
    for body, reynolds in (
        ([Decimal(2), Fraction(1, 10), 0, np.float32(0)], Fraction(20)),
        (np.array(BODY), np.float16(20)),
        ((2, np.array(0.1), jnp.array(0.0), 0), np.int8(20)),
    ):
        assert net.drag(body, reynolds) == pytest.approx(plain, rel=1e-12)
    exact = {"max_length": Fraction(9, 5), "trust": Decimal("0.01")}
    stations = (Station(Fraction(1, 2), Decimal("0.3")),)
    problem = Problem(net.scene, Robust(Decimal(20), LogNormal(Decimal("0.2")), cases=4), **exact)
    assert optimise(dataclasses.replace(problem, stations=stations), net).kkt_residual < 1e-3


def test_a_body_that_crosses_itself_has_no_drag_under_jit_either(net):
    crossing = jnp.array([1.0, -0.3, -0.15, -0.1])  # within the trained ranges
    with pytest.raises(InvalidInput, match="cross"):
        net.drag(crossing, 20.0)
    for extrapolate in (False, True):
        drag = jax.jit(lambda body, e=extrapolate: net.drag(body, 20.0, extrapolate=e))
        assert np.isnan(drag(crossing))
        assert np.isfinite(drag(jnp.array(BODY)))


def test_a_scene_replaces_the_file_that_is_named_but_no_folder(tmp_path):
    for _ in range(2):
        Scene().write(tmp_path / "scene.toml")
    assert Scene.read(tmp_path / "scene.toml") == Scene()
    with pytest.raises(InvalidInput, match="is a folder"):
        Scene().write(tmp_path)


def test_a_scene_that_was_altered_is_noticed(net, tmp_path):
    save(tmp_path / "net", net)
    path = tmp_path / "net" / "surrogate.json"
    record = json.loads(path.read_text())
    path.write_text(json.dumps(record | {"scene": record["scene"] | {"stream": "tunnel:4"}}))
    with pytest.raises(InvalidInput, match="scene is not what was saved"):
        load(tmp_path / "net")
    path.write_text(json.dumps(record | {"method": np.nan}))
    with pytest.raises(InvalidInput, match="unreadable"):
        load(tmp_path / "net")


def test_huge_weights_weigh_as_others_do(net):
    scenarios = Weighted((10, 40), (1e308, 1e308)).scenarios(net.scene)
    assert scenarios.weight == pytest.approx([0.5, 0.5])


def test_a_family_whose_bodies_all_cross_is_refused_however_few_are_asked_for():
    family = Family(aspect=(1, 3), beta2=(0.9, 1.0))
    with pytest.raises(InvalidInput, match="nearly all"):
        training_samples(Scene(family=family), 0, 4)


def test_no_query_is_a_stream_too(net):
    assert query_stream(net.scene, 0, 0) == []


@pytest.mark.parametrize(
    "change",
    [{"path": []}, {"path": [[2.0, 0.9, 0.0, 0.0]]}, {"surrogate": 5}, {"cd_verified": "abc"},
     {"cd_start": -1.0}, {"cases": 5}, {"reynolds": 1e9}],
    ids=str,
)  # fmt: skip
def test_a_run_that_was_altered_is_refused(designed, tmp_path, change):
    save_run(tmp_path / "run", designed)
    record = json.loads((tmp_path / "run" / "run.json").read_text())
    (tmp_path / "run" / "run.json").write_text(json.dumps(record | change))
    with pytest.raises(InvalidInput, match="damaged or of another program"):
        load_run(tmp_path / "run")


# Contours: large, odd, in every usual format.


@pytest.mark.parametrize("count", [20_000, 1_000_000])
def test_contours_of_many_points(count):
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    points = np.stack([2 * np.cos(t), np.sin(t)], axis=1)
    few = smooth_contour(ROUND, 200)
    assert np.abs(smooth_contour(points, 200) - few).max() < 0.01


def test_a_contour_that_smoothing_would_lose_is_refused():
    radius = np.where(np.arange(400) % 2, 1.0, 0.1)
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    with pytest.raises(InvalidInput, match="lost to smoothing"):
        contour_shape(np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1))
    with pytest.raises(InvalidInput, match="far from the origin"):
        contour_shape(ROUND + 1e12)


def lines(points, gap=" "):
    return "\n".join(f"{x:.6f}{gap}{y:.6f}" for x, y in points) + "\n"


SECTION = naca4("2412", 60)
UPPER, LOWER = SECTION[:31], np.concatenate([SECTION[:1], SECTION[:29:-1]])
FORMATS = {
    "selig": lines(SECTION),
    "selig, a title of one number": "2412\n" + lines(SECTION),
    "selig, a title of two numbers": "63 412\n" + lines(SECTION),
    "lednicer": f"NACA\n{len(UPPER)}. {len(LOWER)}.\n\n" + lines(UPPER) + "\n" + lines(LOWER),
    "semicolons": lines(SECTION, ";"),
    "decimal commas": lines(SECTION, ";").replace(".", ","),
    "decimal commas in columns": lines(SECTION, "  ").replace(".", ","),
    "Fortran": "\n".join(f"{x:.5f}D+00 {y:.5f}d0" for x, y in SECTION),
    "tabs": lines(SECTION, "\t"),
    "bars": lines(SECTION, " | "),
    "trailing commas": lines(SECTION, ",").replace("\n", ",\n"),
    "quotes": lines(SECTION, '","').replace("\n", '"\n').replace("-", "-"),
    "comments behind rows": lines(SECTION).replace("\n", " % a point\n"),
    "minus signs": lines(SECTION).replace("-", "\N{MINUS SIGN}"),
    "comments": "# one\n# two\nx,y\n" + lines(SECTION, ","),
}


@pytest.mark.parametrize("form", FORMATS)
def test_contours_of_every_usual_format_are_read(tmp_path, form):
    (tmp_path / "c.dat").write_text(FORMATS[form])
    found = smooth_contour(read_contour(tmp_path / "c.dat"), 200)
    assert np.abs(found - smooth_contour(SECTION, 200)).max() < 2e-3


@pytest.mark.parametrize(
    "spoil",
    [
        lambda row, k: row + " 0" if k < 25 else row,
        lambda row, k: f"P{k} {row}" if k < 15 else row,
        lambda row, k: row.replace(".", ",").replace(" ", ",") if k < 12 else row,
        lambda row, k: f"y x\n{row}" if k == 0 else row,
    ],
    ids=["third column", "names", "commas", "y first"],
)
def test_no_row_of_a_contour_is_dropped_in_silence(tmp_path, spoil):
    rows = lines(SECTION).splitlines()
    (tmp_path / "c.dat").write_text("\n".join(spoil(row, k) for k, row in enumerate(rows)))
    with pytest.raises(InvalidInput, match=r"c\.dat: row \d"):
        read_contour(tmp_path / "c.dat")


def test_a_contour_without_an_end_is_refused():
    with pytest.raises(InvalidInput, match="is larger than"):
        read_contour("/dev/zero")


def test_counts_that_are_wrong_are_named(tmp_path):
    text = f"NACA\n{len(UPPER)} {len(LOWER) - 2}\n" + lines(UPPER) + "\n" + lines(LOWER)
    (tmp_path / "c.dat").write_text(text)
    with pytest.raises(InvalidInput, match=r"row 2 counts 31 \+ 29 points, where 62 follow"):
        read_contour(tmp_path / "c.dat")


@pytest.mark.parametrize("text", ["", "x,y\n", "0,5;0,2;1\n", "\n\n"])
def test_what_holds_no_contour_says_what_would(tmp_path, text):
    (tmp_path / "c.csv").write_text(text)
    with pytest.raises(InvalidInput, match=r"c\.csv: (none of its|row)"):
        read_contour(tmp_path / "c.csv")


# The machine fails.


def started(script, *words, **options):
    return subprocess.Popen(
        [sys.executable, str(ROOT / "scripts" / script), *words],
        text=True,
        **({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options),
    )


def test_nobody_listens_to_progress_and_the_run_is_kept_all_the_same(tmp_path):
    """stderr full, a pipe that broke, or closed."""
    words = ["--reynolds", "20", "--json", "--out"]
    with open("/dev/full", "w") as full:
        process = started("optimize_shape.py", *words, str(tmp_path / "full"), stderr=full)
        assert json.loads(process.communicate()[0])["converged"]
        assert process.returncode == 0
    reading, writing = os.pipe()
    os.close(reading)
    process = started("optimize_shape.py", *words, str(tmp_path / "pipe"), stderr=writing)
    os.close(writing)
    assert json.loads(process.communicate()[0])["converged"]
    assert process.returncode == 0
    assert (tmp_path / "full" / "run.json").is_file()
    assert (tmp_path / "pipe" / "run.json").is_file()


def test_a_full_disk_is_seen_before_the_work_and_a_full_stdout_told(tmp_path):
    out = str(tmp_path / "run")
    limited = f"ulimit -f 8; exec {sys.executable} {ROOT}/scripts/optimize_shape.py"
    done = subprocess.run(
        ["bash", "-c", f"{limited} --reynolds 20 --out {out}"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert "is not writable" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    with open("/dev/full", "w") as full:
        process = started("predict_drag.py", "--aspect", "2", "--reynolds", "20", stdout=full)
        _, said = process.communicate()
    assert process.returncode == 4
    assert "No space left" in said.splitlines()[-1]


def test_terminated_in_the_middle_it_ends_with_one_line_and_goes_on(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'fidelity = {name = "tiny", cells = 8, upstream = 2.5, downstream = 4, height = 4}\n'
        "[family]\naspect = [1, 2]\n"
    )
    words = ["--method", "hig", "--samples", "8", "--budget-seconds", "600"]
    words += ["--scene", str(scene), "--out", str(tmp_path / "hig")]
    process = started("train_surrogate.py", *words)
    for line in process.stderr:
        if "step" in line:
            break
    time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said.splitlines()[-1].startswith("train_surrogate.py: interrupted")
    assert "Traceback" not in said


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_a_callback_drops_is_raised_again(ending):
    class Collected:
        def __del__(self):
            signal.raise_signal(ending)  # Python prints what is raised in here and goes on

    def main(argv):
        collected = Collected()
        del collected
        late.wait()
        raise AssertionError("the interrupt was lost")

    late = threading.Event()
    alarm = threading.Timer(20, late.set)
    alarm.start()
    for _ in range(10):
        assert cli.run(main) == 130
    alarm.cancel()
    assert not late.is_set()  # a call that waits is woken


@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_while_libraries_load_is_one_line(ending, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["scripts/any.py"])
    with pytest.raises(SystemExit) as ended, loading():
        signal.raise_signal(ending)
    assert ended.value.code == 130
    assert capsys.readouterr().err == "any.py: interrupted before it began\n"
    with loading():
        pass  # nothing is left of it


def test_a_script_that_is_interrupted_at_once_says_so_and_no_more():
    words = ["-X", "importtime", str(ROOT / "scripts" / "predict_drag.py"), "--help"]
    process = subprocess.Popen([sys.executable, *words], stderr=subprocess.PIPE, text=True)
    for line in process.stderr:
        if line.split("|")[-1].strip() == "shapeopt.commands.entry":
            break
    time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=120)
    said = [line for line in said.splitlines() if not line.startswith("import time:")]
    assert said == ["predict_drag.py: interrupted before it began"]
    assert process.returncode == 130


# Words.


@pytest.mark.parametrize("script", sorted(path.name for path in (ROOT / "scripts").glob("*.py")))
def test_help_tells_examples_and_statuses(script, capsys):
    import importlib

    with pytest.raises(SystemExit) as ended:
        importlib.import_module(script.removesuffix(".py")).main(["--help"])
    text = capsys.readouterr().out
    assert ended.value.code == 0
    assert f"python scripts/{script}" in text
    for status in ("0 done", "2 bad input", "3 not converged", "4 not written", "130 interrupted"):
        assert status in " ".join(text.split())


def test_a_cache_that_cannot_be_is_done_without(tmp_path):
    (tmp_path / "file").write_text("")
    words = ["--aspect", "2", "--reynolds", "20"]
    home = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "file")}
    process = started("predict_drag.py", *words, env=home)
    _, said = process.communicate()
    assert (process.returncode, said) == (0, "")


def test_an_empty_cache_home_is_none(monkeypatch, tmp_path):
    from surrogate.cache import use_compilation_cache

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    before = jax.config.jax_compilation_cache_dir
    use_compilation_cache()
    chosen = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", before)
    assert Path(chosen).is_absolute()
    assert not list(tmp_path.iterdir())
