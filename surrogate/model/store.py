"""Surrogates on disk: a folder of weights and a record of scene, training, versions and error."""

import json
import math
import warnings
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np

from surrogate.checks import did_you_mean, expect, whole_number
from surrogate.errors import InvalidInput
from surrogate.files import (
    check_target,
    file_digest,
    json_digest,
    path_of,
    strict_json,
    whole_files,
)
from surrogate.flow.grid.discretise import traction_modes
from surrogate.leaves import read_leaves, write_leaves
from surrogate.model.card import model_card
from surrogate.model.evaluation import network_loads
from surrogate.model.inputs import scene_inputs
from surrogate.model.network import LoadNetwork, blank_network, head_count
from surrogate.model.outputs import LOAD_NAMES
from surrogate.model.surrogate import Surrogate
from surrogate.scene.samples import LARGEST_SEED
from surrogate.scene.scene import Scene
from surrogate.versions import versions

FORMAT = 4
RECORD, WEIGHTS, CARD = "surrogate.json", "weights.eqx", "card.txt"
# One surrogate per method, from one setup: of three seeds the one whose designs take fewest flows.
PRETRAINED = Path(__file__).parent / "pretrained"
BEST = "hig"  # the method of least mean error on held-out bodies
MAX_WIDTH, MAX_DEPTH = 4096, 8  # of a network that is read: bounds what a damaged record may ask
MAX_RECORD = 1 << 24  # bytes
ERRORS = "mean", "p95", "max", "scale"
MOST = 10**6  # samples or held-out bodies
COUNTS = {"seed": LARGEST_SEED, "samples": MOST, "held_out": MOST, "held_out_failed": MOST}


def save(folder: str | Path, surrogate: Surrogate) -> None:
    """Save a surrogate to a folder, in place of an older one there; files are written atomically.

    Raises:
      InvalidInput: it is no surrogate, or the folder holds something that is not a surrogate, or
        is not writable.
    """
    expect("save", surrogate, Surrogate, "Surrogate")
    check_surrogate_folder(folder)
    with whole_files(folder, RECORD) as part:
        write_leaves(part / WEIGHTS, surrogate.network)
        record = {
            **surrogate.record,
            "format": FORMAT,
            "scene": surrogate.scene.record,
            "sizes": [int(layer.weight.shape[0]) for layer in surrogate.network.layers],
            "weights_sha256": file_digest(part / WEIGHTS),
            "scene_sha256": json_digest(surrogate.scene.record),
            "versions": versions(),
        }
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")
        (part / CARD).write_text(model_card(surrogate.scene, record), encoding="utf-8")


def check_surrogate_folder(folder: str | Path) -> None:
    """Raise InvalidInput unless a surrogate may be written to this folder."""
    check_target(folder, RECORD, ("format", "weights_sha256"))


def load(name: str | Path) -> Surrogate:
    """Load a surrogate from a folder, or one that ships with the package.

    A surrogate of large error (``Surrogate.inaccuracy``) is loaded with a warning.

    Args:
      name: a folder; ``"pretrained"`` for the most accurate one in 2-D, ``"pretrained:METHOD"`` for
        that of a method, ``"pretrained:lift"`` for the one of sections with camber and incidence in
        2-D, ``"pretrained:space"`` for the one in 3-D, ``"pretrained:particle"`` for the one of
        3-D bodies at any incidence.

    Raises:
      InvalidInput: it is missing, damaged, or not a surrogate.
    """
    surrogate = read_surrogate(name)
    warn_of_inaccuracy(surrogate, f"surrogate {name}", stacklevel=3)
    return surrogate


def warn_of_inaccuracy(surrogate: Surrogate, what: str, stacklevel: int = 2) -> None:
    """Warn if the error of a surrogate is large; the warning begins with ``what``."""
    if surrogate.inaccuracy:
        warnings.warn(f"{what}: {surrogate.inaccuracy}", stacklevel=stacklevel)


def read_surrogate(name: str | Path) -> Surrogate:
    """Load a surrogate as ``load`` does, but without a warning."""
    folder = path_of(name)
    kind, _, method = str(name).partition(":")
    if kind == "pretrained":
        folder = PRETRAINED / (method or BEST)
    what = f"surrogate {folder}"  # begins messages
    if not folder.is_dir():
        shipped = [f"pretrained:{one.name}" for one in sorted(PRETRAINED.iterdir())]
        short = f"pretrained:{name}"
        hint = did_you_mean(short if short in shipped else name, shipped)
        words = f"no such folder; what ships: pretrained, {', '.join(shipped)}{hint}"
        raise InvalidInput(f"surrogate {name}: {words}")
    record = read_record(folder)
    try:
        scene = Scene.of(record["scene"])
        sizes = [whole_number("layer", size, 1, MAX_WIDTH) for size in record["sizes"]]
    except (KeyError, TypeError) as problem:
        raise InvalidInput(f"{what}: damaged or not a surrogate, {problem}") from None
    except InvalidInput as problem:
        raise InvalidInput(f"{what}: {problem}") from None
    heads = head_count(traction_modes(scene), scene.family.body_class)
    if not 1 <= len(sizes) <= MAX_DEPTH or sizes[-1] != heads:
        raise InvalidInput(
            f"{what}: its layers {sizes} do not end in the {heads} outputs of its scene"
        )
    blank = eqx.filter_eval_shape(
        lambda: blank_network(scene, tuple(sizes[:-1]), jax.random.key(0))
    )
    network = read_leaves(folder / WEIGHTS, blank, "surrogate")
    if file_digest(folder / WEIGHTS) != record.get("weights_sha256"):
        raise InvalidInput(f"{what}: damaged, {WEIGHTS} is not what was saved")
    if record.get("scene_sha256") != json_digest(record["scene"]):
        raise InvalidInput(f"{what}: damaged, its scene is not what was saved")
    _check_numbers(network, scene, what)
    return Surrogate(network, scene, record)


def read_record(folder: Path) -> dict[str, Any]:
    """Read the record of a surrogate's folder.

    Raises:
      InvalidInput: it is missing, damaged, not a surrogate's, or of another format.
    """
    what, path = f"surrogate {folder}", folder / RECORD
    if path.is_file() and path.stat().st_size > MAX_RECORD:
        raise InvalidInput(f"{what}: damaged or not a surrogate, {RECORD} is too large")
    try:
        record = strict_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise InvalidInput(f"{what}: damaged or not a surrogate, {RECORD} is unreadable") from None
    if not isinstance(record, dict) or "format" not in record:
        raise InvalidInput(f"{what}: damaged or not a surrogate")
    if record["format"] != FORMAT:
        raise InvalidInput(f"{what}: format {record['format']!r:.40}, this version reads {FORMAT}")
    _check_values(record, what)
    return record


def _check_values(record: dict[str, Any], what: str) -> None:
    """Refuse a record whose numbers are none, or in which numbers, lists or tables are not."""
    errors = (f"{load}_error_{kind}" for load in LOAD_NAMES for kind in ERRORS)
    for name in (*errors, "budget_s"):
        number = record.get(name)
        if number is None and (name == "budget_s" or name not in record):
            continue
        if not isinstance(number, int | float) or not 0 <= number < math.inf:
            raise InvalidInput(f"{what}: its record's {name} is no number")
    for name, most in COUNTS.items():
        if name in record and not _is_count(record[name], most):
            raise InvalidInput(f"{what}: its record's {name} is no whole number up to {most}")
    infill = record.get("infill", [])
    if not isinstance(infill, list) or not all(map(_is_count, infill)):
        raise InvalidInput(f"{what}: its record's infill is no list of whole numbers")
    if not isinstance(record.get("versions", {}), dict):
        raise InvalidInput(f"{what}: its record's versions are no table")


def _is_count(value: object, most: int = MOST) -> bool:
    return isinstance(value, int) and 0 <= value <= most


def _check_numbers(network: LoadNetwork, scene: Scene, what: str) -> None:
    """Refuse weights that are not finite, and scaled inputs that are not those of the scene."""
    if not all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(network)):
        raise InvalidInput(f"{what}: damaged, its weights are not all finite")
    middle = scene.family.bounds.mean(axis=1), np.asarray(scene.reynolds[0], float)
    if not 0 < float(np.asarray(network_loads(network, *middle))[0]) < np.inf:
        raise InvalidInput(f"{what}: damaged, its weights give no drag")
    known, own = (np.array([i.low, i.high]) for i in (scene_inputs(scene), network.inputs))
    if not np.allclose(known, own, atol=1e-9):
        raise InvalidInput(f"{what}: damaged, its weights are of other ranges than its scene")
