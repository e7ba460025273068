"""What the flow in single precision throughout costs and loses, against the solver's double."""

import jax
import jax.numpy as jnp
from study import Row, Run, Study, Table, columns
from tools import medians

from surrogate import Unbounded, family_shape
from surrogate.flow.grid.domain import fitted_domain
from surrogate.flow.loads.forces import drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import single

CASES = [(1.0, re) for re in (1.0, 1e-3, 0.1, 10.0, 40.0, 100.0, 300.0)]
CASES += [(0.5, 40.0), (5.0, 40.0), (10.0, 300.0)]  # aspect, Re


def measure(run: Run, aspect: float, reynolds: float) -> Row:
    """Solve in both precisions with the same operators."""
    shape = family_shape({"aspect": aspect})
    domain = fitted_domain(Unbounded(), run.fidelity("standard"), shape, reynolds)
    markers, re = jnp.asarray(shape.draw(domain.nodes)), jnp.asarray(reynolds)
    double = jax.jit(lambda markers, re: steady.prepare(domain, markers, re))(markers, re)
    solve = jax.jit(lambda operators: steady.body_flow(domain, operators))
    both = double, single(double)
    (a, info), (b, rough) = map(solve, both)
    seconds = medians([lambda operators=operators: solve(operators) for operators in both], 5)
    difference = abs(drag_coefficient(b.amplitude) / drag_coefficient(a.amplitude) - 1)
    return {
        "double": int(info.products) if info.converged else None,
        "single": int(rough.products) if rough.converged else None,
        "difference": float(difference) if info.converged & rough.converged else None,
        "time_ratio": seconds[1] / seconds[0],
    }


COLUMNS = "aspect {aspect:g} | Re {reynolds:g} | float64 {double} G | float32 {single} G"
COLUMNS += " | difference of Cd {difference:.0e} | time, float32 over float64 {time_ratio:.2f}"
ROWS = [{"aspect": aspect, "reynolds": re} for aspect, re in CASES]
STUDY = Study([Table(lambda run: ROWS, measure, columns(COLUMNS))])
