"""Tables of parameters by name, of one body or of many, as arrays in a family's order."""

from collections.abc import Callable, Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray, Number, Numbers
from surrogate.body.parameters import PARAMETERS
from surrogate.checks import did_you_mean, one_number, real_numbers, shown, traced
from surrogate.errors import InvalidInput


def body_of_table(
    names: Sequence[str], named: Mapping[str, Number]
) -> Float[AnyArray, " parameters"]:
    """Return the parameters of one body from a table by name; those not named are neutral.

    JAX may trace the values.

    Args:
      names: of the family's parameters, in their order.
      named: a number for each of some names.

    Raises:
      InvalidInput: a name is not the family's, the aspect is missing, or a value is not a number.
    """
    return _in_order(names, named, one_number)


def bodies_of_table(
    names: Sequence[str], named: Mapping[str, Numbers]
) -> Float[AnyArray, "*bodies parameters"]:
    """Return the parameters of many bodies, as ``body_of_table``, from a table of arrays by name.

    Args:
      names: of the family's parameters, in their order.
      named: for each of some names numbers or arrays, which broadcast as in NumPy.

    Raises:
      InvalidInput: as ``body_of_table``; or the arrays do not broadcast.
    """
    return _in_order(names, named, _array)


def is_of_arrays(named: Mapping[str, object]) -> bool:
    """Return whether a value of a table is an array, a list or a tuple."""
    return any(isinstance(x, list | tuple) or getattr(x, "ndim", 0) > 0 for x in named.values())


def wanted(names: Sequence[str]) -> str:
    """Return what a family's bodies need, as words for messages."""
    return f"{len(names)} parameters are needed: {', '.join(names)}"


def _in_order(names: Sequence[str], named: Mapping, read: Callable) -> AnyArray:
    """Return the values of a table, each read by its name, in the last axis of an array."""
    if "aspect" not in named:
        raise InvalidInput(f"body: has no aspect; {wanted(names)}")
    given = {name: read(name, value) for name, value in named.items()}
    _refuse_others(names, given)
    values = {name: PARAMETERS[name].neutral for name in names} | given
    xp = jnp if traced(*values.values()) else np
    try:
        columns = xp.broadcast_arrays(*(xp.asarray(value, float) for value in values.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {np.shape(value)}" for name, value in given.items())
        raise InvalidInput(f"body: arrays that do not broadcast, of shapes {shapes}") from None
    return xp.stack(columns[: len(names)], axis=-1)


def _refuse_others(names, values):
    """Raise InvalidInput where a parameter that the family lacks is not neutral."""
    for name, value in values.items():
        known = PARAMETERS.get(name)
        neutral = known and not traced(value) and np.all(value == known.neutral)
        if name in names or neutral:
            continue
        hint = did_you_mean(name, names)
        if known:
            hint = (
                f"; scenes that give {name} a range have it (pretrained:lift has camber and "
                "incidence in 2-D, pretrained:particle flatness and incidence in 3-D)"
            )
        raise InvalidInput(f"body: {name} is none of the family's {', '.join(names)}{hint}")


def _array(name, value):
    """Return a value as an array of numbers, which JAX may trace."""
    if isinstance(value, list | tuple) and traced(*value):
        return jnp.stack(value)
    found = value if traced(value) else real_numbers(value)
    if found is None:
        raise InvalidInput(f"body: {name} {shown(value)}: must be numbers")
    return found
