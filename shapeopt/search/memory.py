"""Observations of the flow, loads with their slopes, kept between designs and in a file."""

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
from surrogate.flow.derivatives import LoadsAndGradients
from surrogate.flow.flow import Flow
from surrogate.model.gaussian_process import Hyper
from surrogate.model.inputs import scene_inputs
from surrogate.model.kriging import Kriging, Observation, kriging, likeliest, uncorrected
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import gradients_of_outputs

KIND = "flows of a designer"  # "kind" of the file
REFIT = 1.3  # growth of the number of observations after which kriging's lengths are fitted anew


class Memory:
    """A store of all observations of a scene's flow: a body that is known is not solved again.

    ``flows`` counts the flows that this object has solved, with their adjoints;
    ``green_applications`` the convolutions with the Green's function (G) that they took, and those
    that did not converge.

    Args:
      flow: of the scene.
      base: the network that kriging corrects; None to interpolate the loads themselves.
      file: JSON file of observations, which is read if it exists.
      devices: over which the flows are spread.
    """

    def __init__(
        self,
        flow: Flow,
        base: LoadNetwork | None,
        file: str | Path | None = None,
        devices: Devices | None = None,
    ):
        self.flow, self.base, self.devices = flow, base, devices or choose_devices()
        self.file = None if file is None else check_file(file, ".json")
        self.observations: list[Observation] = []
        self.flows, self.green_applications = 0, 0
        self._hyper: Hyper | None = None
        self._fitted = 0
        self.refresh()

    def evaluate(self, parameters: Float[AnyArray, " parameters"], reynolds: float) -> Observation:
        """Return the loads of a body and their slopes, by a flow and its adjoints unless known.

        Raises:
          InvalidInput: the scene's grid does not resolve the body.
          NotConverged: the flow or its adjoint did not converge.
        """
        return self.evaluate_all([(parameters, reynolds)])[0]

    def evaluate_all(self, queries: Sequence[tuple[AnyArray, float]]) -> list[Observation]:
        """Return loads and slopes for every (body, Reynolds number), solved on all devices.

        Flows that were solved are kept, also where another one does not converge.

        Raises:
          InvalidInput: the scene's grid does not resolve a body.
          NotConverged: a flow or its adjoint did not converge.
        """
        wanted = {_key(*query): query for query in queries}
        known = {_key(seen.parameters, seen.reynolds): seen for seen in self.observations}
        unknown = [query for key, query in wanted.items() if key not in known]
        failed: list[float] = []
        for (parameters, reynolds), found in zip(unknown, self._solve(unknown), strict=True):
            self.green_applications += int(found.green_applications)
            if bool(found.converged):
                known[_key(parameters, reynolds)] = self._keep(parameters, reynolds, found)
            else:
                failed.append(reynolds)
                if self.devices.count == 1:
                    break  # the next are not solved yet
        if failed:
            raise NotConverged(f"optimise on the flow: no flow or adjoint at Re {failed[0]:g}")
        return [known[_key(*query)] for query in queries]

    def _keep(self, parameters, reynolds, found):
        """Store a converged flow as an observation, and return this."""
        found = jax.tree.map(np.asarray, found)
        gradients = np.column_stack([found.gradients, reynolds * found.by_reynolds])
        slopes = np.asarray(gradients_of_outputs(found.loads, gradients))
        body = np.asarray(parameters, float)
        self.observations.append(Observation(body, float(reynolds), found.loads, slopes))
        self.flows += 1
        return self.observations[-1]

    def _solve(self, queries: Sequence[tuple[AnyArray, float]]) -> Iterator[LoadsAndGradients]:
        """Solve one by one on a single device, where another number would be compiled anew."""
        if self.devices.count == 1 or len(queries) < 2:
            for query in queries:
                yield self.flow.loads_and_gradients(*query, allow_unsteady=True, partial=True)
        else:
            bodies = map(np.array, zip(*queries, strict=True))
            kinds = {"gradients": True, "allow_unsteady": True, "partial": True}
            found = self.flow.solve_all(*bodies, self.devices, **kinds)
            yield from (jax.tree.map(lambda leaf, k=k: leaf[k], found) for k in range(len(queries)))

    def model(self, tightness: int = 0) -> Kriging | None:
        """Return the base model corrected by kriging through all observations.

        Without observations the correction is zero; without a base network too, where the search
        starts from the flow alone, there is no model. Each unit of ``tightness`` divides the
        assumed noise of the observations by e, so that the model interpolates the observed
        gradients more closely.
        """
        inputs = scene_inputs(self.flow.scene)
        if not self.observations:
            loads = len(self.flow.bodies.loads)
            return None if self.base is None else uncorrected(inputs, self.base, loads)
        if self._hyper is None or len(self.observations) >= REFIT * self._fitted:
            self._hyper = likeliest(self.observations, inputs, self.base)
            self._fitted = len(self.observations)
        hyper = self._hyper._replace(noise=self._hyper.noise - tightness)
        return kriging(self.observations, inputs, self.base, hyper)

    def refresh(self) -> None:
        """Read what other processes have added to the file.

        Raises:
          InvalidInput: the file is damaged, of another program or of another scene.
        """
        if self.file is not None and self.file.is_file():
            known = {_key(seen.parameters, seen.reynolds) for seen in self.observations}
            read = _read(self.file, self.flow)
            self.observations += [o for o in read if _key(o.parameters, o.reynolds) not in known]

    def save(self) -> None:
        """Write all observations to the file, if there is one.

        Several processes may share it: what they have added is read first and kept.
        """
        if self.file is None:
            return
        with FileLock(f"{self.file}.lock"):
            self.refresh()
            flows = [[np.asarray(part).tolist() for part in seen] for seen in self.observations]
            record = {"kind": KIND, **_origin(self.flow), "sha256": json_digest(flows)}
            record["flows"] = flows
            with whole_file(self.file) as part:
                part.write_text(json.dumps(record) + "\n")


def _origin(flow):
    """Return the scene and the solver's settings, which all flows of a file share."""
    settings = {name: float(value) for name, value in flow.settings._asdict().items()}
    return {"scene": flow.scene.record, "settings": settings}


def _key(parameters, reynolds):
    return (*np.asarray(parameters, float).tolist(), float(reynolds))


def _read(file: Path, flow: Flow) -> list[Observation]:
    """Return the observations of a file.

    Raises:
      InvalidInput: it is damaged, of another program, or of another scene or solver setting.
    """
    try:
        record = strict_json(file.read_text(encoding="utf-8"))
        if record["kind"] != KIND or not isinstance(record["scene"], dict):
            raise ValueError
        other = [name for name, value in _origin(flow).items() if record[name] != value]
        rows = [] if other else _rows(record)
    except OSError as problem:
        raise InvalidInput(f"{file}: cannot be read ({problem.strerror})") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InvalidInput(f"{file}: damaged, or no {KIND}; name another file") from None
    if other:
        what = "scene" if "scene" in other else "setting of the solver"
        raise InvalidInput(f"{file}: is of another {what}; name another file")
    return rows


def _rows(record):
    """Return the observations of a file's record; ValueError, KeyError or TypeError if damaged."""
    if record["sha256"] != json_digest(record["flows"]):
        raise ValueError
    return [
        Observation(np.array(p), re, np.array(loads), np.array(slopes))
        for p, re, loads, slopes in record["flows"]
    ]
