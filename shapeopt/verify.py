"""Verification: what the flow itself says of a body the surrogate proposed."""

import numpy as np

from surrogate.arrays import AnyArray
from surrogate.body import ellipse, family_markers
from surrogate.flow.drag import DragReport, report
from surrogate.scene import Scene
from surrogate.training.physics import scene_domain

CYLINDER = ellipse(1.0)


def verify(scene: Scene, parameters: AnyArray, reynolds: float) -> DragReport:
    """Body flow of a family body on the scene's own grid.

    Raises:
      NotConverged: the flow was not found.
    """
    domain = scene_domain(scene)
    return report(domain, np.asarray(family_markers(parameters, domain.nodes)), reynolds)
