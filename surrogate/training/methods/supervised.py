"""Supervised regression: each sample's flow is solved once, the network is fitted to the results.

The baseline of the other methods: labels by the full solver, and the same loss as SIP.
"""

import dataclasses

from surrogate.training.methods.inversion import FullSolve
from surrogate.training.methods.method import Evaluator
from surrogate.training.methods.sip import LabelRegression


@dataclasses.dataclass(frozen=True)
class Supervised(LabelRegression):
    """Supervised regression: solve body flows where labels are missing, then Adam on all labels."""

    @property
    def evaluator(self) -> Evaluator:
        """The full solution of the body flow."""
        return FullSolve(self.slopes > 0)
