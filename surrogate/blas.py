"""How long the threads of OpenBLAS wait for work."""

import os

SHORTEST = "4"  # wait, as a power of two of processor cycles


def let_blas_threads_sleep() -> None:
    """Let the threads of OpenBLAS sleep as soon as they have no work, unless the user says other.

    jaxlib inverts small matrices by SciPy's OpenBLAS, whose threads spin for some 30 ms after every
    call, on the cores on which the flow goes on: flows of bodies with lift took up to a quarter
    longer. OpenBLAS reads the variable when SciPy's linear algebra is first imported; if that was
    before this call, it has no effect.
    """
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", SHORTEST)
