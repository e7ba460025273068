"""Supervised regression: every sample's body flow is solved once, the network learns the answer.

The baseline a user would pick: exact targets first, then only Adam, same loss as SIP's.
"""

from surrogate.training.methods.method import Method
from surrogate.training.methods.sip import imitation
from surrogate.training.methods.targets import full_inversion


def supervised(
    batch: int = 8,
    network_steps: int = 50,
    learning_rate: float = 3e-3,
    goal: float = 30.0,
    modes: float = 0.0,
    slopes: float = 1.0,
) -> Method:
    """Body flows of a batch where labels are missing, then Adam on all labels so far.

    At its best it regresses on the drag and its slopes; with ``modes`` 1 and ``slopes`` 0 on
    traction and drag, as is usual.
    """
    invert = full_inversion(slopes=slopes > 0)
    return imitation(invert, batch, network_steps, learning_rate, goal, modes, slopes)
