"""What single precision throughout costs and loses in the flow, against the solver's double.

python scripts/measure/precision.py
"""

import sys
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from study import TINY, Result, Study, medians, run_study, table_of_rows

from surrogate import FIDELITIES, Fidelity, Unbounded, family_shape
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.loads import drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.solver.newton import single

CASES = [(1.0, re) for re in (1e-3, 0.1, 1.0, 10.0, 40.0, 100.0, 300.0)]
CASES += [(0.5, 40.0), (5.0, 40.0), (10.0, 300.0)]  # aspect, Re


def measure(tiny: bool, progress: Callable) -> Result:
    """Every case in both precisions after a common preparation."""
    cases = CASES[2:3] if tiny else CASES
    fidelity, rows = TINY if tiny else FIDELITIES["standard"], []
    for k, (aspect, reynolds) in enumerate(cases):
        progress(k / len(cases), f"aspect {aspect:g}, Re {reynolds:g}")
        rows.append({"aspect": aspect, "reynolds": reynolds} | _row(fidelity, aspect, reynolds))
    return {"rows": rows}


def _row(fidelity: Fidelity, aspect: float, reynolds: float) -> dict[str, Any]:
    shape = family_shape({"aspect": aspect})
    domain = fitted_domain(Unbounded(), fidelity, shape, reynolds)
    markers, re = jnp.asarray(shape.draw(domain.nodes)), jnp.asarray(reynolds)
    double = jax.jit(lambda markers, re: steady.assemble(domain, markers, re))(markers, re)
    solve = jax.jit(lambda case: steady.body_flow(domain, case))
    cases = double, single(double)
    (a, info), (b, rough) = map(solve, cases)
    seconds = medians([lambda case=case: solve(case) for case in cases], 5)
    both = info.converged & rough.converged
    difference = abs(drag_coefficient(b.amplitude) / drag_coefficient(a.amplitude) - 1)
    return {
        "double": int(info.products) if info.converged else None,
        "single": int(rough.products) if rough.converged else None,
        "difference": difference if both else None,
        "time_ratio": seconds[1] / seconds[0],
    }


HEADS = "aspect | Re | float64 | float32 | Cd differs by | time, 32 over 64"
FORMS = "{aspect:g} | {reynolds:g} | {double} G | {single} G | {difference:.0e} | {time_ratio:.2f}"
STUDY = Study("precision", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
