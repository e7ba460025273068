"""Products of matrices in single precision, which accelerators round further unless asked not to.

A GPU's TF32 keeps 11 bits of a factor: GMRES then does not converge to its tolerance, and some
flows that converge on a CPU do not.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ROUGH_3D, SECTIONS, TINY
from jax.extend.core import jaxprs_in_params

from surrogate import Flow, Scene
from surrogate.flow.solver import steady, tangent
from surrogate.flow.solver.adjoint import Effort
from surrogate.scene.samples import held_out_samples

SCENES = {
    "symmetric": Scene(fidelity=TINY),
    "lift": Scene(fidelity=TINY, family=SECTIONS),
    "space": Scene(dimension=3, fidelity=ROUGH_3D),
}
SINGLE = {np.dtype("float32"), np.dtype("complex64")}
EFFORT = Effort(1e-3, 5)


def rounded_products(jaxpr) -> tuple[int, list[str]]:
    """Number of products of matrices in single precision, and those that may be rounded further."""
    count, rounded = 0, []
    for equation in jaxpr.eqns:
        types = {variable.aval.dtype for variable in equation.invars if hasattr(variable, "aval")}
        if equation.primitive.name == "dot_general" and types <= SINGLE:
            count += 1
            if equation.params["precision"] != (jax.lax.Precision.HIGHEST,) * 2:
                rounded.append(str(equation))
        for part in jaxprs_in_params(equation.params):
            more, found = rounded_products(part)
            count, rounded = count + more, rounded + found
    return count, rounded


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_flows_and_their_gradients_keep_single_precision(scene):
    bodies, _ = held_out_samples(scene, seed=0, count=1)
    traced = jax.make_jaxpr(Flow(scene).loads_and_gradients)(bodies[0], 10.0)
    count, rounded = rounded_products(traced.jaxpr)
    assert count > 5
    assert not rounded


def test_slip_jacobian_keeps_single_precision(cylinder_domain):
    angle = 2 * np.pi * np.arange(96) / 96
    markers = jnp.asarray(np.stack([-np.cos(angle), np.sin(angle)], axis=1) / 2)

    def take():
        operators = steady.assemble(cylinder_domain, markers, jnp.asarray(20.0))
        state = steady.body_flow(cylinder_domain, operators)[0]
        return tangent.slip_jacobian(cylinder_domain, operators, state, EFFORT)

    count, rounded = rounded_products(jax.make_jaxpr(take)().jaxpr)
    assert count > 5
    assert not rounded
