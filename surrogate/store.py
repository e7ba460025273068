"""A surrogate is one folder: weights, scene, method, seed, versions, error, command."""

import dataclasses
import hashlib
import importlib.metadata
import itertools
import json
import zipfile
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body import PARAMETERS, Family
from surrogate.errors import InvalidInput
from surrogate.files import check_target, whole_folder
from surrogate.network import DragNetwork
from surrogate.scene import Fidelity, Scene, Tunnel, Unbounded

FORMAT = 1
BROKEN = (OSError, KeyError, TypeError, ValueError, AttributeError, EOFError)
RECORD = "surrogate.json"
PRETRAINED = Path(__file__).parent / "pretrained"  # one a method, from one bench
BEST = "sip"  # of these, by its mean error on unseen bodies


@dataclasses.dataclass(frozen=True)
class Surrogate:
    """A trained network with the scene it knows and the record of how it came about."""

    network: DragNetwork
    scene: Scene
    record: dict[str, Any]

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: float | Float[AnyArray, ""]
    ) -> Float[AnyArray, ""]:
        """Cd; differentiable, and to be vmapped over bodies and Reynolds numbers."""
        return self.network.drag(parameters, jnp.asarray(reynolds, float))

    def knows(self, parameters: AnyArray, reynolds: float) -> bool:
        """Whether body and Reynolds number lie within the trained ranges."""
        low, high = self.scene.reynolds
        inside = low * (1 - 1e-9) <= reynolds <= high * (1 + 1e-9)
        return inside and self.scene.family.contains(np.asarray(parameters))

    def beyond(self, parameters: AnyArray, reynolds: float) -> dict[str, float]:
        """How far each parameter, or log Re, lies outside its trained range, in ranges."""
        bounds = np.concatenate([self.scene.family.bounds, np.log([self.scene.reynolds])])
        values = np.append(np.asarray(parameters, float), np.log(reynolds))
        low, high = bounds.T
        distance = np.maximum(np.maximum(low - values, values - high), 0) / (high - low)
        names = (*PARAMETERS, "log Re")
        return {k: float(d) for k, d in zip(names, distance, strict=True) if d > 1e-9}

    def recorded(self, key: str) -> Any:
        """A value of the record, as trainings leave it.

        Raises:
          InvalidInput: the record lacks it.
        """
        if key not in self.record:
            raise InvalidInput(f"surrogate: its record lacks {key}; train_surrogate.py writes it")
        return self.record[key]


def save_surrogate(folder: str | Path, surrogate: Surrogate) -> None:
    """Write the folder whole or not at all, replacing an older surrogate there.

    Raises:
      InvalidInput: the path holds something that is not a surrogate, or is not writable.
    """
    folder = Path(folder)
    check_target(folder, RECORD)
    with whole_folder(folder) as part:
        leaves = jax.tree.leaves(surrogate.network)
        weights = part / "weights.npz"
        np.savez(weights, **{f"leaf{k}": np.asarray(leaf) for k, leaf in enumerate(leaves)})
        record = {
            **surrogate.record,
            "format": FORMAT,
            "scene": scene_record(surrogate.scene),
            "sizes": [int(layer.weight.shape[0]) for layer in surrogate.network.layers],
            "weights_sha256": _digest(weights),
            "versions": {
                name: importlib.metadata.version(name) for name in ("jax", "jaxlib", "numpy")
            },
        }
        (part / RECORD).write_text(json.dumps(record, indent=1) + "\n")


def load_surrogate(name: str | Path) -> Surrogate:
    """Load a folder, or one that ships with the package.

    ``"pretrained"`` is the most accurate of these, ``"pretrained:METHOD"`` that of a method.

    Raises:
      InvalidInput: it is missing, damaged, or not a surrogate.
    """
    kind, _, method = str(name).partition(":")
    folder = PRETRAINED / (method or BEST) if kind == "pretrained" else Path(name)
    if not folder.is_dir():
        raise InvalidInput(f"surrogate {folder}: no such folder; train_surrogate.py makes one")
    weights = folder / "weights.npz"
    try:
        record = json.loads((folder / RECORD).read_text())
        if record["format"] != FORMAT:
            raise InvalidInput(
                f"surrogate {folder}: format {record['format']}, this version reads {FORMAT}"
            )
        if _digest(weights) != record["weights_sha256"]:
            raise InvalidInput(f"surrogate {folder}: damaged, weights.npz is not what was saved")
        scene = read_scene(record["scene"])
        with np.load(weights, allow_pickle=False) as saved:
            leaves = [jnp.asarray(saved[f"leaf{k}"]) for k in range(len(saved.files))]
        structure = jax.tree.structure(_blank(record["sizes"], scene))
        return Surrogate(jax.tree.unflatten(structure, leaves), scene, record)
    except (*BROKEN, zipfile.BadZipFile) as problem:
        if isinstance(problem, InvalidInput):
            raise
        raise InvalidInput(f"surrogate {folder}: damaged or not a surrogate") from None


def scene_record(scene: Scene) -> dict[str, Any]:
    """A scene as plain JSON."""
    stream = "unbounded" if scene.stream == Unbounded() else f"tunnel:{scene.stream.height!r}"
    return {**dataclasses.asdict(scene), "stream": stream}


def read_scene(record: dict[str, Any]) -> Scene:
    """The scene of a record."""
    kind, _, height = record["stream"].partition(":")
    return Scene(
        stream=Unbounded() if kind == "unbounded" else Tunnel(float(height)),
        reynolds=tuple(record["reynolds"]),
        family=Family(**{name: tuple(bounds) for name, bounds in record["family"].items()}),
        fidelity=Fidelity(**record["fidelity"]),
    )


def _blank(sizes, scene):
    """A network of the right structure, for its tree alone."""
    fans = [len(scene.family.bounds) + 1, *sizes]
    key = jax.random.key(0)
    layers = tuple(eqx.nn.Linear(a, b, key=key) for a, b in itertools.pairwise(fans))
    return DragNetwork(layers, *map(jnp.zeros, (fans[0], fans[0], 3, fans[-1], fans[-1])))


def _digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()
