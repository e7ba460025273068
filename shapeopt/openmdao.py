"""Loads of a surrogate or of the flow as a component of OpenMDAO, with analytic derivatives.

Needs OpenMDAO: pip install 'drag-surrogates[openmdao]'. ``scripts/settling_speed.py`` couples one
with the balance of weight and drag.
"""

from collections.abc import Mapping

import jax
import numpy as np

from surrogate.body.parameters import Kind
from surrogate.errors import InvalidInput, NotConverged
from surrogate.flow.flow import Flow
from surrogate.flow.loads import LOADS
from surrogate.model.surrogate import Surrogate

try:
    import openmdao.api as om
    from openmdao.jacobians.jacobian import Jacobian
    from openmdao.vectors.vector import Vector
except ImportError:
    raise ImportError(
        "shapeopt.openmdao needs OpenMDAO: pip install 'drag-surrogates[openmdao]'"
    ) from None

REYNOLDS = "reynolds"


MEANINGS = {
    "cd": "drag coefficient by the equivalent diameter D",
    "cl": "lift coefficient by D",
    "cm": "moment coefficient by D, about the centroid, nose up",
}


class LoadsComponent(om.ExplicitComponent):
    """An OpenMDAO component that evaluates the loads on a body of the model's family.

    Inputs are the parameters of the family by name (``incidence`` in degrees) and ``reynolds``,
    U D / nu; outputs are ``cd`` and, for bodies with lift, ``cl`` and ``cm``. A body that the model
    refuses, and a flow that does not converge, is an ``AnalysisError``, so that a driver can step
    back.

    Options:
      model: a ``Surrogate`` or a ``Flow``.
    """

    def initialize(self) -> None:
        """Declare the option ``model``."""
        self.options.declare("model", types=(Surrogate, Flow), desc="answers the loads")

    @property
    def ranges(self) -> Mapping[str, tuple[float, float]]:
        """Lower and upper bound of each input, for ``add_design_var``."""
        scene = self.options["model"].scene
        return {**dict(scene.family.ranges), REYNOLDS: scene.reynolds}

    def setup(self) -> None:
        """Declare the inputs, the outputs and the derivatives."""
        model = self.options["model"]
        kinds = {p.name: p for p in model.scene.family.body_class.parameters}
        for name, (low, high) in self.ranges.items():
            known = kinds.get(name)
            meaning = known.meaning if known else "U D / nu"
            units = "deg" if known and known.kind is Kind.INCIDENCE else None
            start = np.sqrt(low * high) if name == REYNOLDS else (low + high) / 2
            about = f"{meaning}; {low:g} to {high:g}"
            self.add_input(name, val=float(start), units=units, desc=about)
        self._load_names = list(LOADS)[: None if model.scene.family.has_lift else 1]
        for name in self._load_names:
            self.add_output(name, val=1.0 if name == "cd" else 0.0, desc=MEANINGS[name])
        self.declare_partials("*", "*")
        self._load_derivatives = jax.jit(jax.jacobian(model.loads, (0, 1)))

    def compute(self, inputs: Vector, outputs: Vector) -> None:
        """Evaluate the load coefficients of the body.

        Raises:
          AnalysisError: the model refuses the body, or its flow does not converge.
        """
        try:
            loads = self.options["model"].loads(*self._body(inputs))
        except (InvalidInput, NotConverged) as reason:
            raise om.AnalysisError(str(reason)) from None
        for name, load in zip(self._load_names, loads, strict=False):  # others are 0 by symmetry
            outputs[name] = float(load)

    def compute_partials(self, inputs: Vector, partials: Jacobian) -> None:
        """Evaluate the derivatives of the loads, by the network or by one adjoint for each load.

        Raises:
          AnalysisError: as ``compute``.
        """
        by_body, by_reynolds = map(np.asarray, self._load_derivatives(*self._body(inputs)))
        rows = np.column_stack([by_body, by_reynolds])
        if not np.all(np.isfinite(rows)):
            raise om.AnalysisError("loads: no derivatives of a body that the model does not answer")
        for output, row in zip(self._load_names, rows, strict=False):
            for name, slope in zip(self.ranges, row, strict=True):
                partials[output, name] = slope

    def _body(self, inputs):
        values = [float(inputs[name].item()) for name in self.ranges]
        return np.array(values[:-1]), values[-1]
