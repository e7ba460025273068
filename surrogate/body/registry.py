"""The body classes by their dimension."""

from collections.abc import Iterable

import numpy as np

from surrogate.body.body_2d import Body2D
from surrogate.body.body_3d import Body3D
from surrogate.body.body_class import BodyClass
from surrogate.body.parameters import PARAMETERS, Kind
from surrogate.checks import did_you_mean
from surrogate.errors import InvalidInput

BODY_CLASSES: dict[int, type[BodyClass]] = {2: Body2D, 3: Body3D}


def check_dimension(value: object) -> int:
    """Check a dimension and return it as an int.

    Raises:
      InvalidInput: it is neither 2 nor 3.
    """
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or value not in BODY_CLASSES:
        raise InvalidInput(f"dimension {value!r}: must be 2 or 3")
    return int(value)


def body_class(names: Iterable[str], dimension: int = 2, owner: str = "body") -> BodyClass:
    """Return the class of bodies with these parameters, put into their usual order.

    Raises:
      InvalidInput: there is no such parameter in this dimension; ``owner`` begins the message.
    """
    kind, names = BODY_CLASSES[check_dimension(dimension)], list(names)
    for name in names:
        if name in PARAMETERS and PARAMETERS[name].kind is Kind.CAMBER and dimension == 3:
            raise InvalidInput(f"{name}: 3-D bodies have no camber; incidence turns them nose up")
        if name not in kind.available:
            known = ", ".join(kind.available)
            raise InvalidInput(
                f"{owner}: no parameter {name!r} of {dimension}-D bodies; {known}"
                f"{did_you_mean(name, kind.available)}"
            )
    return kind(tuple(name for name in PARAMETERS if name in names))
