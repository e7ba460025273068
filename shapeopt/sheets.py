"""What goes on a sheet of pictures: a run's cylinder and its optimum, both solved."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from shapeopt.render import Panel
from shapeopt.verify import CYLINDER
from surrogate.body import PARAMETERS, family_markers
from surrogate.flow.drag import solve_with_continuation
from surrogate.store import read_scene
from surrogate.training.physics import scene_domain


def before_and_after(record: dict[str, Any]) -> list[Panel]:
    """Two panels: the cylinder, and the run's verified optimum.

    Raises:
      NotConverged: one of the flows was not found.
    """
    domain, reynolds = scene_domain(read_scene(record["scene"])), record["reynolds"]
    optimum = np.array([record["parameters"][name] for name in PARAMETERS])
    panels = []
    for name, parameters in (("cylinder", CYLINDER), ("optimum, verified", optimum)):
        markers = family_markers(jnp.asarray(parameters), domain.nodes)
        solution = solve_with_continuation(domain, markers, reynolds)
        drag = float(solution.coefficients.drag)
        caption = f"Re {reynolds:g}, {name}: Cd {drag:.4f}"
        panels.append(Panel(domain, np.asarray(markers), solution, caption))
    return panels
