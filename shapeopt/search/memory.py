"""What the flow has told so far: drags with slopes, kept between designs, in a file if asked."""

import json
from pathlib import Path

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import check_file, locked, whole_file
from surrogate.flow.flow import Flow
from surrogate.model.inputs import scene_inputs
from surrogate.model.kriging import Hyper, Kriging, Told, kriging, likeliest
from surrogate.model.network import DragNetwork

KIND = "flows of a designer"
REFIT = 1.3  # lengths are sought again when so many times the flows are known


class Memory:
    """All flows and adjoints of a scene that were asked for; one that is known costs nothing.

    ``flows`` and ``green_applications`` count what was solved here.
    """

    def __init__(self, flow: Flow, base: DragNetwork | None, file: str | Path | None = None):
        self.flow, self.base = flow, base
        self.file = None if file is None else check_file(file, ".json")
        self.told: list[Told] = []
        self.flows, self.green_applications = 0, 0
        self._hyper: Hyper | None = None
        self._fitted = 0
        self.refresh()

    def ask(self, parameters: Float[AnyArray, " parameters"], reynolds: float) -> Told:
        """Drag and slopes of a body, by flow and adjoint unless they are known.

        Raises:
          NotConverged: flow or adjoint was not found.
        """
        for known in self.told:
            if known.reynolds == reynolds and np.array_equal(known.parameters, parameters):
                return known
        found = self.flow.slope(parameters, reynolds)
        if not bool(found.converged):
            raise NotConverged(f"optimise on the flow: no flow or adjoint at Re {reynolds:g}")
        self.flows += 1
        self.green_applications += int(found.green_applications)
        drag = float(found.drag)
        slopes = np.append(found.gradient, reynolds * found.by_reynolds) / drag
        self.told.append(Told(np.asarray(parameters, float), float(reynolds), drag, slopes))
        return self.told[-1]

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
            known = {_body(told) for told in self.told}
            theirs = _read(self.file, self.flow)
            self.told += [told for told in theirs if _body(told) not in known]

    def save(self) -> None:
        """Add to the file, if there is one, what it lacks; several processes may share it."""
        if self.file is None:
            return
        with locked(self.file.parent):
            self.refresh()
            flows = [
                [t.parameters.tolist(), t.reynolds, t.drag, t.slopes.tolist()] for t in self.told
            ]
            record = {"kind": KIND, "scene": self.flow.scene.record, "flows": flows}
            with whole_file(self.file) as part:
                part.write_text(json.dumps(record) + "\n")


def _body(told):
    return (*told.parameters.tolist(), told.reynolds)


def _read(file: Path, flow: Flow) -> list[Told]:
    """The flows of a file.

    Raises:
      InvalidInput: it is damaged, foreign, or of another scene.
    """
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        if record["kind"] != KIND or not isinstance(record["scene"], dict):
            raise ValueError
        told = [Told(np.array(p, float), float(re), float(cd), np.array(s, float))
                for p, re, cd, s in record["flows"]]  # fmt: skip
        size = len(flow.scene.family.names)
        for flow_ in told:
            numbers = np.concatenate([flow_.parameters, flow_.slopes])
            good = numbers.shape == (2 * size + 1,) and np.all(np.isfinite(numbers))
            if not (good and 0 < flow_.drag < np.inf and 0 < flow_.reynolds < np.inf):
                raise ValueError
    except OSError as problem:
        raise InvalidInput(f"{file}: cannot be read ({problem.strerror})") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InvalidInput(f"{file}: damaged, or no {KIND}; name another file") from None
    if record["scene"] != flow.scene.record:
        raise InvalidInput(f"{file}: is of another scene; name another file")
    return told
