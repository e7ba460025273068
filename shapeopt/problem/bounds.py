"""Checks of the bounds that a problem is given."""

from shapeopt.problem.constraints import Station
from shapeopt.problem.scenarios import NO_LIFT, UNBOUNDED
from surrogate.checks import finite_number, shown
from surrogate.errors import InvalidInput
from surrogate.scene.scene import Scene


def checked_station(given: object, unit: str) -> Station:
    """Return a lower bound on the thickness at a place along the chord, as floats.

    Args:
      given: x/c and thickness.
      unit: of the thickness, for messages.

    Raises:
      InvalidInput: it is none.
    """
    if not isinstance(given, list | tuple) or len(given) != 2:
        raise InvalidInput(f"stations: {shown(given)} is no Station(x, thickness)")
    given = Station(*given)
    x = finite_number("station x/c", given.x)
    if not 0 < x < 1:
        raise InvalidInput(f"station x/c = {x:g}: between 0 (nose) and 1 (tail)")
    return Station(x, checked_length(f"thickness at {x:g} c", given.thickness, unit))


def checked_load(scene: Scene, name: str, given: object) -> float:
    """Return a bound on Cl or Cm as a float.

    Args:
      scene: of the problem, whose bodies need lift.
      name: of the bound.
      given: its value.

    Raises:
      InvalidInput: it is no coefficient, or the bodies have no lift.
    """
    text = name.replace("_", " ")
    if not scene.family.has_lift:
        raise InvalidInput(f"{text}: {NO_LIFT}")
    value = finite_number(text, given)
    if not abs(value) < UNBOUNDED:
        raise InvalidInput(f"{text} {value:g}: a coefficient below {UNBOUNDED:g} in magnitude")
    return value


def checked_length(name: str, given: object, unit: str) -> float:
    """Return a bound on a length as a float.

    Args:
      name: of the bound.
      given: its value.
      unit: of the length, for messages.

    Raises:
      InvalidInput: it is not above 0.
    """
    text = name.replace("_", " ")
    length = finite_number(text, given)
    if not length > 0:
        raise InvalidInput(f"{text} {length:g}: must be above 0, in {unit}")
    return length
