"""Scenes: files written and read again, what explain() says, and the refusals of bad files."""

import dataclasses
import json
import re
import time

import numpy as np
import pytest
from conftest import TINY
from hypothesis import given, settings
from hypothesis import strategies as st

from surrogate import (
    FIDELITIES,
    Family,
    Fidelity,
    Flow,
    InvalidInput,
    Scene,
    Tunnel,
    Unbounded,
    family_shape,
)
from surrogate.body.parameters import PARAMETERS
from surrogate.errors import TooLarge
from surrogate.progress import duration
from surrogate.scene.fidelity import LONGEST_DOWNSTREAM
from surrogate.scene.limits import (
    ONSET_OF_INSTABILITY,
    check_reynolds,
    check_stream,
)
from surrogate.scene.stream import parse_stream

TUNNEL = """
dimension = 2
stream = "tunnel:12"      # slip walls
reynolds = [5, 45]
fidelity = "standard"
[family]
aspect = [1, 3]
beta2 = [-0.3, 0.3]
"""


def ends(low, high):
    pair = st.tuples(*(st.floats(low, high) for _ in range(2)))
    return pair.map(sorted).filter(lambda pair: pair[0] < pair[1]).map(tuple)


families = st.builds(
    lambda aspect, betas: Family(aspect=aspect, **betas),
    ends(0.1, 20),
    st.dictionaries(
        st.sampled_from([name for name in PARAMETERS if name.startswith("beta")]), ends(-1, 1)
    ),
)
domains = (st.floats(1, 40),) * 3
texts = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=8)
fidelities = st.sampled_from(list(FIDELITIES.values())) | st.builds(
    Fidelity,
    texts,
    st.integers(3, 64),
    *domains,
    st.integers(1, 31),
    st.floats(0, 1),
    st.floats(0, 1),
)
streams = st.just(Unbounded()) | st.builds(Tunnel, st.floats(1, 1000, exclude_min=True))
scenes = st.builds(Scene, streams, ends(1e-3, 300), families, fidelities)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes") / "scene.toml"


@settings(max_examples=60, deadline=None, derandomize=True)
@given(scenes)
def test_robust_any_scene_survives_its_file(path, scene):
    scene.write(path)
    assert Scene.read(path) == scene
    assert hash(Scene.read(path)) == hash(scene)
    assert Scene.of(json.loads(json.dumps(scene.record))) == scene


def test_a_tunnel_in_a_file(tmp_path):
    path = tmp_path / "tunnel.toml"
    path.write_text(TUNNEL)
    scene = Scene.read(path)
    assert scene == Scene(
        stream=Tunnel(12), reynolds=(5, 45), family=Family(aspect=(1, 3), beta2=(-0.3, 0.3))
    )
    words = scene.explain()
    for word in ("tunnel of height 12 D", "Re 5 to 45", "aspect 1 to 3", "beta2 -0.3 to 0.3"):
        assert word in words


def test_a_fidelity_of_ones_own_in_a_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(
        "[fidelity]\nname = 'tiny'\ncells = 8\nupstream = 2.5\ndownstream = 4\nheight = 4\n"
        "harmonics = 5\nwake = 0\n"
    )
    assert Scene.read(path) == Scene(fidelity=TINY)


def test_what_a_file_leaves_out_is_as_in_scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text("")
    assert Scene.read(path) == Scene() == Scene.of({})


def test_numbers_of_numpy_and_names_make_the_same_scene(tmp_path, unchecked):
    scene = Scene(
        stream=Tunnel(np.float64(12)),
        reynolds=np.array([5, 45]),
        family=Family(aspect=[1, np.float32(3)], beta2=np.array([-0.25, 0.25])),
        fidelity=dataclasses.replace(TINY, cells=np.int64(8), upstream=np.float64(2.5)),
    )
    plain = Scene(
        stream="tunnel:12",
        reynolds=(5, 45),
        family=Family(aspect=(1, 3), beta2=(-0.25, 0.25)),
        fidelity=TINY,
    )
    assert scene == plain
    assert json.dumps(scene.record) == json.dumps(plain.record)
    scene.write(tmp_path / "scene.toml")
    assert Scene.read(tmp_path / "scene.toml") == plain
    assert Scene(fidelity="draft") == Scene(fidelity=FIDELITIES["draft"])


@pytest.mark.parametrize(
    "scene",
    [
        Scene(),
        Scene(stream=Tunnel(12), fidelity="draft"),
        Scene(stream=Tunnel(50)),
        Scene(family=Family(aspect=(0.5, 2)), fidelity="draft"),  # bluff bodies have long wakes
    ],
    ids=["standard", "tunnel", "wide tunnel", "bluff"],
)
def test_explain_says_what_is_modelled_and_what_it_costs(scene):
    words = scene.explain(bodies=64)
    assert str(np.prod(Flow(scene).domain.lattice.shape)) + " cells" in words
    for word in ("Re 1 to 40", "Left out", "64 bodies", "convolutions with G", " ms", " s"):
        assert word in words
    assert ("unbounded stream" in words) == (scene.stream == Unbounded())


def test_only_levels_are_said_to_be_made_for_an_error(tiny_scene):
    """A custom fidelity states its tolerance."""
    assert "Made for drags within 0.4 % over Re 0.5" in Scene().explain()
    words = tiny_scene.explain()
    assert "The tolerance of its drags is 1.5 %" in words
    assert "Made for" not in words


def test_a_level_with_other_numbers_is_no_level():
    words = Scene(fidelity=Fidelity("standard", 4, 2, 3, 3)).explain()
    assert "The tolerance of its drags is 1.5 %" in words
    assert "Made for" not in words


def test_explain_refuses_grids_that_memory_is_too_small_for():
    """As the flow does, before a benchmark would allocate arrays of this size."""
    scene = Scene(dimension=3, fidelity=Fidelity("huge", 96, 6, 6, 12))
    with pytest.raises(InvalidInput, match=r"huge: a quarter of the domain has 382\.2 million"):
        scene.explain()


def test_durations_have_the_unit_that_is_read_most_easily():
    times = (0.0042, 1.234, 99.7, 110.0, 5400.0, 7000.0, 4e6)
    texts = ["4.2 ms", "1.2 s", "100 s", "1.8 min", "90 min", "1.9 h", "1100 h"]
    assert [duration(time) for time in times] == texts


def test_explain_is_quick(compilations):
    scene = Scene()
    scene.explain()
    compilations.clear()
    start = time.perf_counter()
    assert scene.explain() == Scene().explain()
    assert time.perf_counter() - start < 1
    assert compilations == []


BAD = {
    "words": ("a scene of bodies", "is not TOML"),
    "key": ("flow = 3", "no key 'flow'; stream, reynolds, family, fidelity, dimension"),
    "reversed": ("reynolds = [40, 1]", "low must not be above high"),
    "one number": ("reynolds = 40", "must be two numbers, low and high"),
    "three numbers": ("reynolds = [1, 2, 3]", "must be two numbers, low and high"),
    "text": ("reynolds = ['1', '40']", "must be one number"),
    "nan": ("reynolds = [nan, 40]", "must be a finite number"),
    "inf": ("reynolds = [1, inf]", "must be a finite number"),
    "zero": ("reynolds = [0, 40]", "must be a finite number above 0"),
    "fast": ("reynolds = [1, 4000]", "tested up to 350"),
    "dimension": ("dimension = 4", "must be 2 or 3"),
    "dimension text": ("dimension = '2'", "must be 2 or 3"),
    "dimensions": ("dimension = [3]", "must be 2 or 3"),
    "dimension below": ("[family]\naspect = [1, 2]\ndimension = 3", "the dimension is the scene's"),
    "walls in space": ("dimension = 3\nstream = 'tunnel:12'", "modelled without walls"),
    "slow in space": ("dimension = 3\nreynolds = [0.0001, 1]", "tested from 0.001"),
    "flat plane": (
        "[family]\naspect = [1, 2]\nflatness = [1, 2]",
        "no parameter 'flatness' of 2-D",
    ),
    "too flat": ("dimension = 3\n[family]\naspect = [1, 2]\nflatness = [1, 9]", "from 0.2 to 5"),
    "stream": ("stream = 'river'", "'unbounded' or 'tunnel:H'"),
    "narrow": ("stream = 'tunnel:0.5'", "'unbounded' or 'tunnel:H' with H above 1"),
    "nan wide": ("stream = 'tunnel:nan'", "'unbounded' or 'tunnel:H'"),
    "stream number": ("stream = 12", "'unbounded' or 'tunnel:H'"),
    "no family": ("family = 'wings'", "family: must be a table of ranges"),
    "no aspect": ("[family]\nbeta2 = [0, 0.1]", "aspect needs a range, as aspect = "),
    "beta13": ("[family]\naspect = [1, 2]\nbeta13 = [0, 0.1]", "no parameter 'beta13'"),
    "beta1": ("[family]\naspect = [1, 2]\nbeta1 = [0, 0.1]", "no parameter 'beta1'"),
    "beta02": ("[family]\naspect = [1, 2]\nbeta02 = [0, 0.1]", "no parameter 'beta02'"),
    "spaces": ("[family]\naspect = [1, 2]\n'a b' = [0, 0.1]", "no parameter 'a b'"),
    "self": ("[family]\naspect = [1, 2]\nself = [0, 0.1]", "no parameter 'self'"),
    "family text": ("[family]\naspect = ['1', '2']", "must be one number"),
    "family number": ("[family]\naspect = 2", "must be two numbers, low and high"),
    "family reversed": ("[family]\naspect = [5, 1]", "low must not be above high"),
    "family nan": ("[family]\naspect = [1, nan]", "must be a finite number"),
    "no width": ("[family]\naspect = [2, 2]", "2 to 2: low must be below high"),
    "fidelity": ("fidelity = 'perfect'", "one of draft, standard, fine"),
    "fidelity number": ("fidelity = 16", "one of draft, standard, fine"),
    "fidelity key": (
        "[fidelity]\ncels = 3",
        "has 'cels'; did you mean cells?; a name, or a table of name, cells",
    ),
    "fidelity without": (
        "[fidelity]\ncells = 8",
        "lacks upstream; a name, or a table of name, cells",
    ),
    "half cells": (
        "[fidelity]\ncells = 8.5\nupstream = 4\ndownstream = 8\nheight = 8",
        "a whole number from 3 to 128 is needed",
    ),
    "text cells": (
        "[fidelity]\ncells = '8'\nupstream = 4\ndownstream = 8\nheight = 8",
        "must be one number",
    ),
    "small domain": (
        "[fidelity]\ncells = 8\nupstream = 0.1\ndownstream = 8\nheight = 8",
        "upstream 0.1: from 1 to 80",
    ),
}


@pytest.mark.parametrize("bad", BAD)
def test_bad_files_get_one_clear_line(bad, tmp_path, unchecked):
    text, remedy = BAD[bad]
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(InvalidInput) as refusal:
        Scene.read(path)
    line = str(refusal.value)
    assert line.startswith(f"scene {path}: ")
    assert remedy in line
    assert "\n" not in line


def test_files_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(InvalidInput, match="cannot be read"):
        Scene.read(tmp_path / "missing.toml")
    with pytest.raises(InvalidInput, match="cannot be read"):
        Scene.read(tmp_path)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidInput, match="is not TOML"):
        Scene.read(tmp_path / "binary")


@pytest.mark.parametrize(
    "wrong",
    [
        {"stream": 12},
        {"family": {"aspect": (1, 5)}},
        {"fidelity": 16},
        {"reynolds": 40},
        {"reynolds": "1,40"},
    ],
    ids=lambda wrong: next(iter(wrong)),
)
def test_scenes_that_are_none_are_refused(wrong):
    with pytest.raises(InvalidInput):
        Scene(**wrong)


def test_bodies_that_do_not_fit_a_scene_are_refused_before_any_work():
    short = dataclasses.replace(FIDELITIES["draft"], upstream=2)
    with pytest.raises(InvalidInput, match="leaves less than half a diameter"):
        Flow(Scene(stream=Tunnel(1.5))).domain  # noqa: B018
    with pytest.raises(TooLarge, match="too large for the draft domain"):
        Flow(Scene(family=Family(aspect=(15, 20)), fidelity=short)).domain  # noqa: B018


def test_reynolds_numbers_of_a_scene():
    scene = Scene(reynolds=(1, 60))
    assert scene.check_reynolds(np.float32(50)) == 50
    for outside in (0.9, 61):
        with pytest.raises(InvalidInput, match="the scene covers 1 to 60"):
            scene.check_reynolds(outside)
    onset = ONSET_OF_INSTABILITY[2]
    assert check_reynolds(46, onset=onset) == 46
    assert check_reynolds(50) == 50
    with pytest.raises(InvalidInput, match="allow_unsteady"):
        check_reynolds(50, onset=onset)


@pytest.mark.parametrize("wide", [{"fidelity": Fidelity("c", 16, 3, 6, 4)}, {"fidelity": None}])
def test_a_domain_of_ones_own_in_3d_is_not_lengthened_by_the_wake_of_2d(wide, tmp_path):
    """It would have 3 million cells."""
    path = tmp_path / "scene.toml"
    path.write_text(
        "dimension = 3\n[fidelity]\ncells = 16\nupstream = 3\ndownstream = 6\nheight = 4\n"
    )
    scene = Scene(dimension=3, **wide) if wide["fidelity"] else Scene.read(path)
    assert scene.fidelity.wake == 0
    assert scene.fidelity_for_bodies == scene.fidelity
    assert Scene(fidelity=Fidelity("c", 16, 3, 6, 4)).fidelity.wake == 0.2


@pytest.mark.parametrize("fidelity", FIDELITIES.values(), ids=FIDELITIES)
def test_no_domain_is_longer_than_the_longest(fidelity):
    longest = max(fidelity.for_wake(re, 3.0).downstream for re in range(1, 300))
    assert longest == LONGEST_DOWNSTREAM


def test_a_narrow_tunnel_is_refused_by_the_height_of_the_turned_body():
    shape = family_shape({"aspect": 2.0}, 60.0)
    wanted = r"box 1\.\d+ D high .* (tunnel:2\.\d+) would do"
    with pytest.raises(InvalidInput, match=wanted) as refused:
        check_stream(Tunnel(2.0), FIDELITIES["draft"], shape.extent, (1.0, 0.5))
    check_stream(Tunnel(shape.extent[1] + 1), FIDELITIES["draft"], shape.extent, (1.0, 0.5))
    suggested = parse_stream(re.search(wanted, str(refused.value))[1])
    check_stream(suggested, FIDELITIES["draft"], shape.extent, (1.0, 0.5))


@pytest.mark.parametrize("height", [1.0, 1.1234565, 1.3, 2.7182818, 3.1415926, 10 / 3])
def test_the_tunnel_that_a_refusal_suggests_is_accepted(height):
    """With six digits, rounded to the nearest, it would often be a little too low."""
    at = FIDELITIES["standard"], np.array([1.0, height]), (1.0, 0.5)
    with pytest.raises(InvalidInput, match="would do") as refused:
        check_stream(Tunnel(1.5), *at)
    check_stream(parse_stream(re.search(r"tunnel:[\d.]+(?= would)", str(refused.value))[0]), *at)


def test_no_domain_for_a_wake_is_higher_than_the_highest():
    assert Fidelity("wide", 10, 30, 30, 78).for_wake(40, 2.2).height == 80
