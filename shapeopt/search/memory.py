"""What the flow has told so far: drags with slopes, kept between designs, in a file if asked."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import jax
import numpy as np
from filelock import FileLock
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.devices import Devices, choose_devices
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import check_file, json_digest, strict_json, whole_file
from surrogate.flow.derivatives import DragGradient
from surrogate.flow.flow import Flow
from surrogate.model.inputs import scene_inputs
from surrogate.model.kriging import Hyper, Kriging, Observation, kriging, likeliest
from surrogate.model.network import DragNetwork
from surrogate.scene.limits import REYNOLDS

KIND = "flows of a designer"
LARGEST = 1e7  # drag or slope that a flow may have told
REFIT = 1.3  # lengths are sought again when so many times the flows are known


class Memory:
    """All flows and adjoints of a scene that were asked for; one that is known costs nothing.

    ``flows`` and ``green_applications`` count what was solved here.
    """

    def __init__(
        self,
        flow: Flow,
        base: DragNetwork | None,
        file: str | Path | None = None,
        devices: Devices | None = None,
    ):
        self.flow, self.base, self.devices = flow, base, devices or choose_devices()
        self.file = None if file is None else check_file(file, ".json")
        self.told: list[Observation] = []
        self.flows, self.green_applications = 0, 0
        self._hyper: Hyper | None = None
        self._fitted = 0
        self.refresh()

    def ask(self, parameters: Float[AnyArray, " parameters"], reynolds: float) -> Observation:
        """Drag and slopes of a body, by flow and adjoint unless they are known.

        Raises:
          NotConverged: flow or adjoint was not found.
        """
        return self.ask_all([(parameters, reynolds)])[0]

    def ask_all(self, queries: Sequence[tuple[AnyArray, float]]) -> list[Observation]:
        """The same of many bodies, each with its Reynolds number; spread over the devices.

        Raises:
          NotConverged: as ``ask``.
        """
        asked = {_body(*query): query for query in queries}
        known = {_body(told.parameters, told.reynolds): told for told in self.told}
        unknown = [query for body, query in asked.items() if body not in known]
        for (parameters, reynolds), found in zip(unknown, self._solve(unknown), strict=True):
            if not bool(found.converged):
                raise NotConverged(f"optimise on the flow: no flow or adjoint at Re {reynolds:g}")
            self.flows += 1
            self.green_applications += int(found.green_applications)
            drag = float(found.drag)
            slopes = np.append(found.gradient, reynolds * found.by_reynolds) / drag
            told = Observation(np.asarray(parameters, float), float(reynolds), drag, slopes)
            self.told.append(told)
            known[_body(parameters, reynolds)] = told
        return [known[_body(*query)] for query in queries]

    def _solve(self, queries: Sequence[tuple[AnyArray, float]]) -> Iterator[DragGradient]:
        """One after another on one device, where no number of them needs compiling anew."""
        if self.devices.count == 1 or len(queries) < 2:
            yield from (self.flow.slope(*query) for query in queries)
        else:
            found = self.flow.slopes(*map(np.array, zip(*queries, strict=True)), self.devices)
            yield from (jax.tree.map(lambda leaf, k=k: leaf[k], found) for k in range(len(queries)))

    def model(self, tight: int = 0) -> Kriging | DragNetwork | None:
        """The base corrected by all that was told; None where there is neither.

        It is taken for less noisy, by a factor e each, the tighter it is to follow.
        """
        if not self.told:
            return self.base
        inputs = scene_inputs(self.flow.scene)
        if self._hyper is None or len(self.told) >= REFIT * self._fitted:
            self._hyper = likeliest(self.told, inputs, self.base)
            self._fitted = len(self.told)
        closer = self._hyper._replace(noise=self._hyper.noise - tight)
        return kriging(self.told, inputs, self.base, closer)

    def refresh(self) -> None:
        """Learn what other processes have put into the file meanwhile.

        Raises:
          InvalidInput: the file is damaged, foreign or of another scene.
        """
        if self.file is not None and self.file.is_file():
            known = {_body(told.parameters, told.reynolds) for told in self.told}
            theirs = _read(self.file, self.flow)
            self.told += [t for t in theirs if _body(t.parameters, t.reynolds) not in known]

    def save(self) -> None:
        """Add to the file, if there is one, what it lacks; several processes may share it."""
        if self.file is None:
            return
        with FileLock(f"{self.file}.lock"):
            self.refresh()
            flows = [
                [t.parameters.tolist(), t.reynolds, t.drag, t.slopes.tolist()] for t in self.told
            ]
            record = {"kind": KIND, "scene": self.flow.scene.record, "sha256": json_digest(flows)}
            record["flows"] = flows
            with whole_file(self.file) as part:
                part.write_text(json.dumps(record) + "\n")


def _body(parameters, reynolds):
    return (*np.asarray(parameters, float).tolist(), float(reynolds))


def _read(file: Path, flow: Flow) -> list[Observation]:
    """The flows of a file.

    Raises:
      InvalidInput: it is damaged, foreign, or of another scene.
    """
    try:
        record = strict_json(file.read_text(encoding="utf-8"))
        if record["kind"] != KIND or not isinstance(record["scene"], dict):
            raise ValueError
        right = json_digest(record["flows"])
        if record.get("sha256", right) != right:  # older files have none
            raise ValueError
        told = [Observation(np.array(p), re, cd, np.array(s)) for p, re, cd, s in record["flows"]]
        size, (least, most) = len(flow.scene.family.names), REYNOLDS[flow.scene.dimension]
        for flow_ in told:
            numbers = np.concatenate([flow_.parameters, flow_.slopes])
            good = numbers.dtype.kind == "f" and numbers.shape == (2 * size + 1,)
            bounded = good and np.all(np.abs(numbers) < LARGEST)
            if not (bounded and 0 < flow_.drag < LARGEST and least <= flow_.reynolds <= most):
                raise ValueError
        if told:
            flow.scene.family.check_all(np.array([flow_.parameters for flow_ in told]))
    except OSError as problem:
        raise InvalidInput(f"{file}: cannot be read ({problem.strerror})") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InvalidInput(f"{file}: damaged, or no {KIND}; name another file") from None
    if record["scene"] != flow.scene.record:
        raise InvalidInput(f"{file}: is of another scene; name another file")
    return told
