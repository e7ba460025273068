"""The shape parameters of bodies: what each one means, its limits and its neutral value.

A new parameter is one more row of ``PARAMETERS`` and its use in the body classes that have it.
"""

from typing import NamedTuple


class Parameter(NamedTuple):
    """One shape parameter.

    ``neutral`` is its value in bodies that do not name it. ``mode`` is the k of the sine mode
    sin kt that it weighs, None for a ratio of lengths: drag is smooth in the logarithms of ratios.
    """

    name: str
    low: float
    high: float
    neutral: float
    meaning: str
    label: str
    mode: int | None = None


def _sine_mode(k, effect):
    beta = f"\N{GREEK SMALL LETTER BETA}{k}"
    return Parameter(f"beta{k}", -1.0, 1.0, 0.0, effect.lower(), f"{effect}, {beta}", k)


EFFECTS = {2: "Fuller fore or aft", 3: "Blunt or pointed ends", 4: "Finer fore and aft"}
PARAMETERS = {  # limits of the ratios: what the flow solver is tested for
    parameter.name: parameter
    for parameter in (
        Parameter("aspect", 0.1, 20.0, 1.0, "length / thickness", "Aspect, length to thickness"),
        Parameter("flatness", 0.2, 5.0, 1.0, "width / height", "Flatness, width to height"),
        *(_sine_mode(k, EFFECTS.get(k, "Waves of the contour")) for k in range(2, 13)),
    )
}
