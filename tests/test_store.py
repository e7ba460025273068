"""Surrogates on disk: saved and loaded, refused if damaged; the shipped ones are accurate."""

import dataclasses
import hashlib
import json
import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import Family, Flow, InvalidInput, Scene, load, save
from surrogate.leaves import write_leaves
from surrogate.model.network import blank_network
from surrogate.model.store import BEST, CARD, PRETRAINED
from surrogate.scene.samples import held_out_samples
from surrogate.training.loop import load_errors
from surrogate.training.plan import METHODS, make_plan
from surrogate.training.record import plan_differences
from surrogate.versions import command_line

BODY = np.array([2.0, 0.1, 0.0, 0.0])


@pytest.fixture
def folder(tmp_path):
    """A surrogate of the user's own."""
    shipped = load("pretrained")
    save(tmp_path / "mine", dataclasses.replace(shipped, record={"method": "sip", "seed": 4}))
    return tmp_path / "mine"


def edited(folder, change):
    """Change the record of a folder."""
    path = folder / "surrogate.json"
    record = json.loads(path.read_text())
    path.write_text(json.dumps({**record, **change(record)}))


def with_weights(folder, network):
    """Write other arrays to a folder, with their digest in its record."""
    path = folder / "weights.eqx"
    write_leaves(path, network)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    edited(folder, lambda record: {"weights_sha256": digest})


def refused(folder, words):
    with pytest.raises(InvalidInput, match=words) as refusal:
        load(folder)
    assert "\n" not in str(refusal.value)
    assert str(folder) in str(refusal.value)


def test_round_trip(folder, tmp_path):
    loaded = load(folder)
    shipped = load("pretrained")
    assert float(loaded.drag(BODY, 10.0)) == float(shipped.drag(BODY, 10.0))
    assert loaded.scene == shipped.scene == Scene()
    assert loaded.recorded("method") == "sip"
    with pytest.raises(InvalidInput, match="lacks samples"):
        loaded.recorded("samples")
    halved = loaded.network.with_weights(loaded.network.weights / 2)
    save(folder, dataclasses.replace(loaded, network=halved))  # replaces its own kind
    assert np.array_equal(load(folder).network.weights, halved.weights)


def test_files_of_the_users_own_stay(folder):
    (folder / "notes.txt").write_text("keep me")
    save(folder, load("pretrained"))
    assert (folder / "notes.txt").read_text() == "keep me"
    assert sorted(path.name for path in folder.iterdir()) == [
        "card.txt",
        "notes.txt",
        "surrogate.json",
        "weights.eqx",
    ]


def test_folders_with_other_files_and_files_are_refused(tmp_path):
    (tmp_path / "thesis.txt").write_text("do not delete")
    with pytest.raises(InvalidInput, match=r"not empty and has no surrogate\.json but thesis"):
        save(tmp_path, load("pretrained"))
    with pytest.raises(InvalidInput, match="a folder is needed"):
        save(tmp_path / "thesis.txt", load("pretrained"))
    assert (tmp_path / "thesis.txt").read_text() == "do not delete"
    with pytest.raises(InvalidInput, match="no such folder"):
        load(tmp_path / "nowhere")
    with pytest.raises(InvalidInput, match="no such folder"):
        load("pretrained:magic")


def test_a_folder_left_half_written_can_be_saved_again(folder):
    """A power cut between its two files: the record is there, the weights are not."""
    (folder / "weights.eqx").unlink()
    refused(folder, r"weights\.eqx")
    save(folder, load("pretrained"))
    assert float(load(folder).drag(BODY, 10.0)) > 0


@pytest.mark.parametrize("kept", [0, 100, -7])
def test_truncated_weights_are_refused(folder, kept):
    weights = folder / "weights.eqx"
    weights.write_bytes(weights.read_bytes()[:kept])
    refused(folder, "damaged")


def test_other_bytes_and_missing_weights_are_refused(folder):
    weights = folder / "weights.eqx"
    intact = weights.read_bytes()
    weights.write_bytes(intact[:-7] + b"damaged")
    refused(folder, r"damaged, weights\.eqx is not what was saved")
    weights.write_bytes(intact + b"more")
    refused(folder, "damaged, or its arrays are of other shapes")
    weights.unlink()
    refused(folder, "damaged")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_that_are_not_finite_are_refused_whatever_the_hash(folder, value):
    network = load(folder).network
    with_weights(folder, network.with_weights(network.weights.at[3].set(value)))
    refused(folder, "its weights are not all finite")


def test_weights_of_other_shapes_or_ranges_are_refused(folder):
    network = load(folder).network
    with_weights(folder, blank_network(Scene(), (8,), jax.random.key(0)))
    refused(folder, "its arrays are of other shapes")
    with_weights(folder, eqx.tree_at(lambda n: n.inputs.high, network, network.inputs.high + 1))
    refused(folder, "of other ranges than its scene")
    with_weights(folder, network)
    assert float(load(folder).drag(BODY, 10.0)) > 0


RECORDS = {
    "other sizes": ({"sizes": [32, 16, 15]}, "of other shapes"),
    "fewer modes": ({"sizes": [32, 32, 13]}, "do not end in the 15 outputs of its scene"),
    "huge": ({"sizes": [10**9, 10**9, 15]}, "a whole number from 1 to 4096"),
    "gigabytes": ({"sizes": [4096] * 7 + [15]}, "of other shapes"),
    "astronomic": ({"sizes": [10**400, 32, 15]}, "must be one number"),
    "endless": ({"sizes": [32] * 100 + [15]}, "do not end in"),
    "none": ({"sizes": []}, "do not end in"),
    "text sizes": ({"sizes": "32"}, "layer '3': must be one number"),
    "number sizes": ({"sizes": 32}, "damaged or not a surrogate"),
    "format": ({"format": 99}, "format 99, this version reads 4"),
    "scene": ({"scene": {"reynolds": [40, 1]}}, "low must not be above high"),
    "scene text": ({"scene": "tunnel"}, "must be a table"),
    "dimension": ({"scene": {"dimension": 3}}, "do not end in the 27 outputs"),
    "digest": ({"weights_sha256": None}, "is not what was saved"),
    "error": ({"drag_error_mean": "small"}, "drag_error_mean is no number"),
    "negative error": ({"drag_error_mean": -0.1}, "drag_error_mean is no number"),
    "negative bound": ({"drag_error_scale": -1.0}, "drag_error_scale is no number"),
    "bound that is text": ({"drag_error_scale": "x"}, "drag_error_scale is no number"),
    "budget that is text": ({"budget_s": "x"}, "budget_s is no number"),
    "seed that is text": ({"seed": "x"}, "seed is no whole number"),
    "negative seed": ({"seed": -1}, "seed is no whole number"),
    "endless samples": ({"samples": 10**9}, "samples is no whole number"),
    "held-out bodies that are text": ({"held_out": "x"}, "held_out is no whole number"),
    "infill that is none": ({"infill": ["x"]}, "infill is no list"),
    "versions that are none": ({"versions": [1]}, "versions are no table"),
    "nan error": ({"drag_error_max": float("nan")}, "is unreadable"),
}


@pytest.mark.parametrize("damage", RECORDS)
def test_damaged_records_are_refused(folder, damage, unchecked):
    change, words = RECORDS[damage]
    edited(folder, lambda record: change)
    refused(folder, words)


@pytest.mark.parametrize(
    "text",
    ["", "no JSON", "[]", "3", "null", "[" * 100_000, '{"format": 4}', "\udcff"],
    ids=["empty", "words", "list", "number", "null", "nested", "bare", "bytes"],
)
def test_records_that_are_none_are_refused(folder, text):
    (folder / "surrogate.json").write_bytes(text.encode(errors="surrogateescape"))
    refused(folder, "damaged or not a surrogate")


def test_records_of_gigabytes_are_refused_unread(folder):
    with (folder / "surrogate.json").open("r+b") as file:
        file.truncate(1 << 30)  # a hole: takes no room
    refused(folder, r"surrogate\.json is too large")


def test_distance_beyond_the_trained_range():
    net = load("pretrained")
    assert net.outside(np.array([2.0, 0.3, 0.0, 0.0]), 40.0) == {}
    outside = net.outside(np.array([7.0, -0.6, 0.0, 0.0]), 1 / 40)
    assert outside == pytest.approx({"aspect": 0.5, "beta2": 0.5, "log Re": 1.0})
    assert net.outside(BODY, 41.0)
    one = dataclasses.replace(net, scene=dataclasses.replace(net.scene, reynolds=(40.0, 40.0)))
    assert one.outside(BODY, 41.0) == {"log Re": pytest.approx(np.log(41 / 40))}
    with pytest.raises(InvalidInput, match="must be finite"):
        net.outside(np.array([np.nan, 0, 0, 0]), 20.0)


def test_what_lies_outside_is_that_of_the_nearest_description_of_a_body():
    """An incidence of 130 degrees is one of 50 seen from behind, and -30 the image of 30."""
    net = load("pretrained:particle")
    for incidence in (130.0, -30.0, 50.0):
        assert net.outside([5.0, 1.0, 0.0, incidence], 10.0) == pytest.approx({"aspect": 1 / 3.7})
    with pytest.raises(InvalidInput) as refused:
        net.loads([5.0, 1.0, 0.0, 130.0], 10.0)
    assert "aspect 5 (trained from 0.3 to 4)" in str(refused.value)
    assert "incidence" not in str(refused.value)
    lifting = load("pretrained:lift")  # -15 degrees is the image of 15, with another camber
    names = dict.fromkeys(lifting.scene.family.names, 0.0)
    body = names | {"aspect": 3.0, "gamma2": 0.3, "incidence": -15.0}
    assert set(lifting.outside(body, 20.0)) == {"incidence"}
    with pytest.raises(InvalidInput, match="did you mean pretrained:lift"):
        load("lift")


def test_the_shipped_surrogate_is_the_best_of_those_that_ship():
    shipped = {method: load(f"pretrained:{method}") for method in METHODS}
    errors = {name: s.record["drag_error_mean"] for name, s in shipped.items()}
    assert min(errors, key=errors.get) == BEST
    assert np.array_equal(load("pretrained").network.weights, shipped[BEST].network.weights)
    assert len({s.network.weights.size for s in shipped.values()}) == 1
    assert len({s.record["samples"] for s in shipped.values()}) == 1


def test_a_surrogate_of_another_plan_is_not_taken_for_it():
    record = load("pretrained:sip").record | {"held_out": 128}  # measured on more since
    assert plan_differences(make_plan(None, "sip", seed=0), record) == ""
    narrow = Scene(family=Family(**dict(Family().ranges) | {"aspect": (1, 3)}))
    others = {
        "samples 256, not 64; held-out bodies 128, not 48; iterations 400, not 160": make_plan(
            None, "sip", "quick", seed=0
        ),
        "method sip, not hig; iterations 400, not 100": make_plan(None, "hig", seed=0),
        "seed 0, not 1": make_plan(None, "sip", seed=1),
        "samples 256, not 64": make_plan(None, "sip", samples=64, seed=0),
        "published False, not True": make_plan(None, "sip", published=True, seed=0),
        "budget in seconds none, not 9": make_plan(None, "sip", budget_seconds=9, seed=0),
        "family aspect 1 to 5, not 1 to 3": make_plan(narrow, "sip", seed=0),
        "reynolds 1 to 40, not 1 to 20": make_plan(Scene(reynolds=(1, 20)), "sip", seed=0),
    }
    for words, plan in others.items():
        assert plan_differences(plan, record) == words
    unfinished = {**record, "iterations": 7}
    assert "7, not 400" in plan_differences(make_plan(None, "sip", seed=0), unfinished)


def test_a_surrogate_of_large_error_says_so_when_it_is_loaded(folder):
    """Large is beyond the flow's tolerance, 0.4 %, on average or ten times that at most."""
    for mean, most, large in ((0.0039, 0.039, False), (0.0041, 0.02, True), (0.003, 0.041, True)):
        edited(
            folder,
            lambda record, e=(mean, most): dict(
                zip(("drag_error_mean", "drag_error_max"), e, strict=True)
            ),
        )
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert bool(load(folder).inaccuracy) == large
        assert len(caught) == large
        if large:
            words = str(caught[0].message)
            assert words.startswith(f"surrogate {folder}: its loads are inaccurate")
            assert f"{mean:.2%} on average and {most:.2%} at most" in words
            assert "tolerance is 0.40%" in words


def test_what_would_help_an_inaccurate_surrogate():
    net = load("pretrained")
    rough = {"drag_error_mean": 0.064, "drag_error_max": 0.3, "samples": 64, "budget_s": 1.0}
    for record, words in (
        (rough, "a budget above 1 s or more samples than 64 would help"),
        (rough | {"budget_s": None}, "; more samples than 64 would help"),
        ({"drag_error_mean": 0.1}, "; more samples would help"),
    ):
        assert words in dataclasses.replace(net, record=record).inaccuracy
    assert net.inaccuracy is None
    assert dataclasses.replace(net, record={}).inaccuracy is None


def test_what_ships_is_accurate():
    for method in (*METHODS, "space"):
        assert load(f"pretrained:{method}").inaccuracy is None


@pytest.mark.parametrize("folder", sorted(PRETRAINED.iterdir()), ids=lambda path: path.name)
def test_the_model_card_of_what_ships(folder):
    """It is in the folder, and has the errors of the record and the ranges of the scene."""
    surrogate = load(f"pretrained:{folder.name}")
    card = (folder / CARD).read_text(encoding="utf-8")
    assert card == surrogate.card
    assert f"mean {100 * surrogate.record['drag_error_mean']:.3f} %" in card
    for name, (low, high) in surrogate.scene.family.ranges:
        assert f"{name} {low:g} to {high:g}" in card


def test_a_model_card_names_what_is_not_recorded():
    net = load("pretrained")
    card = dataclasses.replace(net, record={}).card
    assert "Training: not recorded." in card
    assert "Errors: not recorded." in card
    assert "None" not in card
    some = {"method": "hig", "samples": 9, "seed": 4, "held_out": 5, "drag_error_mean": 0.001}
    card = dataclasses.replace(net, record=some).card
    assert "Training: half-inverse gradients on 9 bodies, seed 4." in card
    assert "Errors over Cd on 5 unseen bodies" in card
    assert "Cd: mean 0.100 %" in card
    for less in ({"method": "hig"}, {"drag_error_mean": 0.001}, {"method": "none", "seed": 3}):
        card = dataclasses.replace(net, record=less).card
        assert "None" not in card
        assert " 0 bodies" not in card


@pytest.mark.slow
def test_golden_lifting_surrogate_on_unseen_bodies():
    """Loads of six sections of another seed: 0.1 % of Cd on average, 0.6 % at most."""
    net = load("pretrained:lift")
    samples = held_out_samples(net.scene, 987, 6)
    loads = Flow(net.scene).solve_all(*samples, allow_unsteady=True).loads
    errors = load_errors(net.network, samples, jnp.asarray(loads))
    assert float(errors.mean()) < 0.001, errors
    assert float(errors.max()) < 0.006, errors


def test_an_altered_scene_is_detected(folder):
    path = folder / "surrogate.json"
    record = json.loads(path.read_text())
    path.write_text(json.dumps(record | {"scene": record["scene"] | {"stream": "tunnel:4"}}))
    with pytest.raises(InvalidInput, match="scene is not what was saved"):
        load(folder)
    path.write_text(json.dumps(record | {"method": np.nan}))
    with pytest.raises(InvalidInput, match="unreadable"):
        load(folder)


def test_the_command_of_a_record_can_be_run(monkeypatch):
    """A script of one's own is not taken for one of the project."""
    for given, stored in (
        (["scripts/train_surrogate.py", "--json"], "python scripts/train_surrogate.py --json"),
        (["/home/me/mine.py"], "python /home/me/mine.py"),
        (["/usr/bin/drag-surrogates", "train"], "drag-surrogates train"),
        (["mine.py", "--out", "out/my run"], "python mine.py --out 'out/my run'"),
    ):
        monkeypatch.setattr("sys.argv", given)
        assert command_line() == stored
