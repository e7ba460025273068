"""A design: the optimum that a search found, with its verification by the flow."""

import dataclasses
import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from shapeopt.problem.problem import Problem
from shapeopt.search.optimality import KKT_ACCEPTED, Derivatives, multipliers
from shapeopt.search.verify import Verified, verify
from surrogate.arrays import AnyArray
from surrogate.body.parameters import PARAMETERS
from surrogate.body.shape import family_shape
from surrogate.scene.limits import onset_of
from surrogate.summary import aligned, listed, steady_text


@dataclasses.dataclass(frozen=True, eq=False)
class Design:
    """The best body that a search found, with the objective of the model that was searched.

    Attributes:
      problem: what was minimised.
      variables: of the search, in the order of ``problem.variables``: the body's parameters, and
        those that the objective adds.
      objective: value of the problem's objective, by the surrogate or, after a search on the flow,
        by the flow.
      loads: Cd, Cl and Cm of ``parameters`` at the objective's nominal Reynolds number, by the same
        model and by the problem's reference length; NaN where that flow did not converge.
      kkt_residual: optimality residual on that model, per width of a variable's range; 0 at a
        local optimum.
      start: objective where the search began.
      path: bodies on the way.
      calls: number of drags that surrogates were evaluated for.
      flows: flows that were solved, one per scenario and body.
      green_applications: their convolutions with the Green's function (G), with their adjoints'.
      seconds: wall time of the search.
      derivatives: of objective and load constraints at the body, where the search knows them.
      on_flow: whether the search ended on the flow, whose the objective and the loads are then.
    """

    problem: Problem
    variables: Float[AnyArray, " variables"]
    objective: float
    loads: tuple[float, float, float]
    kkt_residual: float
    start: float
    path: Float[AnyArray, "steps parameters"]
    calls: int
    flows: int
    green_applications: int
    seconds: float
    derivatives: Derivatives | None = None
    on_flow: bool = False

    def __repr__(self) -> str:
        lift = f"Cl {self.lift:.4f}, " if self._has_lift else ""
        lift += "over c, " if self.problem.by_chord else ""
        work = f"{self.flows} flows, KKT residual {self.kkt_residual:.0e}"
        return f"Design({listed(self._named)}: Cd {self.drag:.4f}, {lift}{work})"

    def summary(self) -> str:
        """Return the body, and how it was found, as lines of text.

        Where each of several lifts has an incidence, body and loads are those of the first lift.
        """
        by_chord = f", by the chord {self.chord_reynolds:.4g}"
        by_chord = by_chord if self.problem.scene.dimension == 2 else ""
        start = self.start + 0.0  # no minus zero
        over = [" over c", " over c^2"] if self.problem.by_chord else ["", ""]
        lift = {}
        if self._has_lift:
            lift["Cl" + over[0]] = f"{self.lift:.5g}"
            lift["Cm" + over[1]] = f"{self.moment:.5g}, about the centroid"
        single = len(self.problem.scenarios.weight) == 1
        objective = "-Cl / Cd" if single and bool(self.problem.scenarios.glide) else "objective"
        return aligned(
            {
                "body": listed(self._named),
                "Reynolds number": f"{self.reynolds:.4g}{by_chord}",
                "chord": f"{self.chord:.4g} D",
                "thickness": self._in_chords(self.thickness),
                **self._camber,
                objective: f"{self.objective:.5g}, from {start:.5g} where the search began",
                "Cd" + over[0]: f"{self.drag:.5g}",
                **lift,
                **self._incidences,
                **self._ends,
                **self._slopes,
                "steady": steady_text(self.reynolds, self.onset),
                "KKT residual": f"{self.kkt_residual:.1e}, 0 at a local optimum",
                "work": f"{self.calls} calls of models, {self.flows} flows, {self.seconds:.2f} s",
            }
        )

    @property
    def parameters(self) -> Float[AnyArray, " parameters"]:
        """The body, in the order of ``problem.scene.family.names``; see ``Problem.body``."""
        return self.problem.body(self.variables)

    @property
    def drag(self) -> float:
        """Cd at the nominal Reynolds number."""
        return self.loads[0]

    @property
    def lift(self) -> float:
        """Cl at the nominal Reynolds number; 0 where all bodies are symmetric."""
        return self.loads[1]

    @property
    def moment(self) -> float:
        """Cm, about the centroid and nose up, at the nominal Reynolds number."""
        return self.loads[2]

    @property
    def _has_lift(self):
        return self.problem.scene.family.has_lift

    @property
    def _named(self):
        return self.problem.scene.family.named(self.parameters)

    @property
    def _camber(self):
        body = self.problem.scene.family.body_class
        if not body.camber_modes:
            return {}
        return {"camber": self._in_chords(float(body.camber(self.parameters)))}

    def _in_chords(self, length):
        """Return a length of the body, in D, as text in D and in chords."""
        return f"{length:.3g} D, {length / self.chord:.1%} of the chord"

    @property
    def _incidences(self):
        """The incidences of the cases, if the objective leaves them free."""
        added = self.problem.variables[len(self.parameters) :]
        if not added:
            return {}
        return dict(zip(added, map("{:.4g}".format, self.variables[-len(added) :]), strict=True))

    @property
    def _ends(self):
        names = self.problem.at_range_ends(self.variables)
        return {"at the end of its range": ", ".join(names)} if names else {}

    @property
    def _slopes(self):
        found, glide = self.multipliers, bool(self.problem.scenarios.glide)
        if not found:
            return {}
        kind, words = multiplier_words(found, glide)
        return {kind + ("" if self.problem.objective.fixed else ", at this Re"): words}

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "verified"}

    @property
    def chord(self) -> float:
        """The body's length from nose to tail, in D."""
        return float(self.problem.scene.family.body_class.length(self.parameters))

    @property
    def thickness(self) -> float:
        """The body's greatest thickness, in 3-D its height, in D."""
        return float(self.problem.scene.family.body_class.thickness(self.parameters))

    @property
    def reynolds(self) -> float:
        """The nominal Reynolds number U D / nu."""
        return self.problem.reference.query(self.parameters, self.problem.objective.nominal)[1]

    @property
    def chord_reynolds(self) -> float:
        """The nominal Reynolds number U c / nu, by the chord c."""
        return self.reynolds * self.chord

    @functools.cached_property
    def onset(self) -> float:
        """An estimate of the Re beyond which the steady flow past the body is unstable.

        It is the least one over the bodies of all cases, where these differ.
        """
        scene = self.problem.scene
        bodies = np.unique(self.problem.scenarios.bodies(self.variables), axis=0)
        named = map(scene.family.named, bodies)
        return min(onset_of(family_shape(body, dimension=scene.dimension)) for body in named)

    @property
    def converged(self) -> bool:
        """Whether the KKT residual is at most 1e-2, up to which the flow's designs are accepted."""
        return self.kkt_residual <= KKT_ACCEPTED

    @property
    def multipliers(self) -> dict[str, float]:
        """The change of the optimal objective per unit of each active bound, to first order.

        A bound is named as in ``Problem``, that on one of several lifts as "lift 0.3", the end of a
        range by its variable. See ``multipliers``
        in ``shapeopt.search.optimality``; empty where the derivatives are not known.
        """
        if self.derivatives is None:
            return {}
        return multipliers(self.problem, self.variables, self.derivatives)

    @functools.cached_property
    def verified(self) -> Verified:
        """The flows of all scenarios, solved with error estimates when first accessed.

        Raises:
          NotConverged: a flow did not converge.
        """
        return verify(self.problem, self.variables)


def multiplier_words(found: Mapping[str, float], glide: bool) -> tuple[str, str]:
    """Return multipliers as words: what they are, and their values by bound or end of a range.

    Args:
      found: derivatives of the objective by the name of a bound or a parameter.
      glide: whether the objective is -Cl / Cd; the words are then of Cl / Cd.
    """
    words = []
    for name, slope in found.items():
        ends = name.partition(" at ")[0] in PARAMETERS
        end = f"{'lower' if slope > 0 else 'upper'} end of " if ends else ""
        words.append(f"{end}{name.replace('_', ' ')} {-slope if glide else slope:+.3g}")
    return f"d({'Cl / Cd' if glide else 'objective'}) / d(bound)", ", ".join(words)


def padded_loads(
    loads: Sequence[float] | Float[AnyArray, " loads"],
) -> tuple[float, float, float]:
    """Return Cd, Cl and Cm as a tuple; loads that a model does not have are zero."""
    drag, lift, moment = (*map(float, loads), 0.0, 0.0)[:3]
    return drag, lift, moment
