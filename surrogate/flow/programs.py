"""The compiled programs of one flow, which drags, gradients, designs and solutions share.

They depend on the discrete problem, not on the class of bodies: whatever is asked of bodies on one
domain, its operators, its Newton solver and its adjoint are compiled once. Each program has the
arguments of the function of the same name in ``solver/steady.py`` or ``solver/adjoint.py``;
``solve`` is ``steady.body_flow``. The domain is to be given by position.
"""

from typing import Any

from surrogate.compilation import CompilerOptions, compiled, quick_options
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver import adjoint, steady


def _options(*arguments: Any) -> CompilerOptions:
    """Return the options of compilation for the dimension of the domain among the arguments."""
    (domain,) = (argument for argument in arguments if isinstance(argument, Domain))
    return quick_options(domain.lattice.dimension)


stream_operators = compiled("domain", options=_options)(steady.stream_operators)
stream_derivatives = compiled("domain", options=_options)(steady.stream_derivatives)
assemble = compiled("domain", options=_options)(steady.assemble)
solve = compiled("domain", "settings", options=_options)(steady.body_flow)
load_gradients = compiled("loads", "domain", "efforts", options=_options)(adjoint.load_gradients)
by_stream = compiled("domain", "efforts", options=_options)(adjoint.by_stream)
