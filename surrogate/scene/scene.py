"""A scene: a family of bodies in a stream over a range of Reynolds numbers.

In a file it is a few lines of TOML; keys that are left out have their values in ``Scene()``:

    dimension = 2
    stream = "tunnel:12"
    reynolds = [5, 45]
    fidelity = "standard"
    [family]
    aspect = [1, 3]
    beta2 = [-0.3, 0.3]
"""

import dataclasses
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from surrogate.body.family import Family
from surrogate.body.nose import nose_of_ellipse
from surrogate.body.registry import check_dimension
from surrogate.checks import did_you_mean, interval, whole_number
from surrogate.errors import InvalidInput
from surrogate.files import make_folder, path_of, target_of, whole_file
from surrogate.scene.explain import explain_scene
from surrogate.scene.fidelity import NAMED, Fidelity, read_fidelity
from surrogate.scene.limits import ROUNDING, check_reynolds
from surrogate.scene.stream import Stream, Unbounded, describe_stream, parse_stream

LONGEST = 400  # letters of a message that quotes a file


@dataclasses.dataclass(frozen=True)
class Scene:
    """A family of bodies in a stream over a range of Reynolds numbers: what is modelled.

    Args:
      stream: ``Unbounded()`` or ``Tunnel(height)``, or "unbounded" or "tunnel:H".
      reynolds: least and greatest U D / nu.
      family: ranges of the bodies' parameters; by default ``Family(dimension)``.
      fidelity: "draft", "standard" or "fine", or a ``Fidelity``.
      dimension: 2 or 3, that of the family.

    Raises:
      InvalidInput: one of them cannot be modelled.
    """

    stream: Stream | Any = Unbounded()
    reynolds: tuple[float, float] | Any = (1.0, 40.0)
    family: Family | Any = None
    fidelity: Fidelity | Any = "standard"
    dimension: int | Any = None

    def __post_init__(self):
        def put(name, value):
            object.__setattr__(self, name, value)

        if self.family is None:
            put("family", Family(dimension=2 if self.dimension is None else self.dimension))
        if not isinstance(self.family, Family):
            raise InvalidInput(f"scene: {self.family!r} is no family; Family(aspect=(1, 5)) is")
        given = self.family.dimension if self.dimension is None else self.dimension
        if check_dimension(given) != self.family.dimension:
            raise InvalidInput(
                f"scene: dimension {self.dimension!r}, but a family of dimension "
                f"{self.family.dimension}; Family(dimension=...) sets it"
            )
        put("dimension", self.family.dimension)
        reynolds = interval("Reynolds range", self.reynolds)
        for end in reynolds:
            check_reynolds(end, self.dimension)
        put("reynolds", reynolds)
        put("fidelity", read_fidelity(self.fidelity, self.dimension))
        if not isinstance(self.stream, Stream):
            put("stream", parse_stream(self.stream))
        if self.dimension == 3 and self.stream != Unbounded():
            raise InvalidInput(f"stream {self.stream}: 3-D bodies are modelled without walls")

    def __str__(self) -> str:
        low, high = self.reynolds
        ranges = (f"{name} {a:g} to {b:g}" for name, (a, b) in self.family.ranges)
        return (
            f"{describe_stream(self.stream)}, {self.dimension}-D, Re {low:g} to {high:g}, grid "
            f"{self.fidelity.name}: bodies of {', '.join(ranges)}"
        )

    @classmethod
    def read(cls, path: str | Path) -> "Scene":
        """Return the scene of a TOML file.

        Raises:
          InvalidInput: it cannot be read, is not TOML, or describes no scene.
        """
        try:
            return cls.of(tomllib.loads(path_of(path).read_text(encoding="utf-8-sig")))
        except OSError as problem:
            raise InvalidInput(f"scene {path}: cannot be read ({problem.strerror})") from None
        except InvalidInput as problem:
            raise InvalidInput(f"scene {path}: {str(problem)[:LONGEST]}") from None
        except (ValueError, RecursionError) as problem:
            raise InvalidInput(f"scene {path}: is not TOML ({str(problem)[:LONGEST]})") from None

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "Scene":
        """Return the scene of plain values, as in a file or from ``record``.

        Raises:
          InvalidInput: they describe no scene.
        """
        if not isinstance(record, Mapping):
            raise InvalidInput("scene: must be a table")
        values = dict(record)
        known = [field.name for field in dataclasses.fields(cls)]
        if foreign := [key for key in values if key not in known]:
            raise InvalidInput(
                f"scene: no key {foreign[0]!r}; {', '.join(known)}{did_you_mean(foreign[0], known)}"
            )
        if "family" in values:
            if not isinstance(values["family"], Mapping):
                raise InvalidInput("family: must be a table of ranges")
            if not all(isinstance(name, str) for name in values["family"]):
                raise InvalidInput("family: its parameters have names")
            if "dimension" in values["family"]:
                raise InvalidInput("family: the dimension is the scene's, not in its table")
            values["family"] = Family(values.get("dimension", 2), **values["family"])
        return cls(**values)

    @property
    def record(self) -> dict[str, Any]:
        """The scene as plain values, for JSON."""
        return {
            "dimension": self.dimension,
            "stream": str(self.stream),
            "reynolds": list(self.reynolds),
            "fidelity": dataclasses.asdict(self.fidelity),
            "family": {name: list(ends) for name, ends in self.family.ranges},
        }

    def write(self, path: str | Path) -> None:
        """Write the scene as a TOML file, whole or not at all; a file that is there is replaced.

        Raises:
          InvalidInput: the path is a folder, or its folder is not writable.
        """
        if path_of(path).is_dir():
            raise InvalidInput(f"{path}: is a folder; a file is needed")
        make_folder(target_of(path).parent)
        plain = self.record
        if NAMED[self.dimension].get(self.fidelity.name) == self.fidelity:
            plain["fidelity"] = self.fidelity.name
        with whole_file(path) as part:
            part.write_text(tomli_w.dumps(plain), encoding="utf-8")

    @property
    def extent(self) -> tuple[float, ...]:
        """Sides in D of a centred box that holds every body and the cylinder or sphere of D = 1."""
        return tuple(max(float(side), 1.0) for side in self.family.extent)

    @property
    def fidelity_for_bodies(self) -> Fidelity:
        """The fidelity with a domain for the longest wake and cells for the thinnest layer."""
        reynolds, height = self.reynolds[1], max(self.extent[1:])
        nose = nose_of_ellipse(self.family.chord)
        fidelity = self.fidelity.for_layers(reynolds, nose).for_wake(reynolds, height)
        lifting = self.dimension == 2 and self.family.has_lift
        return fidelity.for_modes(self.family.highest_mode, lifting)

    def check_reynolds(self, reynolds: object) -> float:
        """Check that the scene covers a Reynolds number, and return it as a float.

        Raises:
          InvalidInput: it is not a number, or outside the scene's range.
        """
        low, high = self.reynolds
        value = check_reynolds(reynolds, self.dimension)
        if not low * (1 - ROUNDING) <= value <= high * (1 + ROUNDING):
            raise InvalidInput(f"Reynolds number {value:g}: the scene covers {low:g} to {high:g}")
        return value

    def explain(self, bodies: int = 64) -> str:
        """Return in words what is modelled, what is left out, and what long work will cost.

        Args:
          bodies: number of bodies of a training, by default that of ``train``.

        Raises:
          InvalidInput: ``bodies`` is no number of them, or memory is likely too small for the grid.
        """
        bodies = whole_number("bodies", bodies, 1, 10**9)
        modelled = self.stream, self.reynolds, self.family, self.fidelity
        return explain_scene(*modelled, self.fidelity_for_bodies, bodies)
