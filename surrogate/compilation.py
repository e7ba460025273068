"""How programs are compiled: quickly, since most of them run for less time than they compile."""

import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar

import jax

from surrogate.checks import transformed
from surrogate.lowering import from_file

# On a CPU, XLA compiles without the costlier optimisations of LLVM, and in 2-D with its older
# emitters (but see ``same_options``), which compile a flow in half the time. They would save a
# sixth of the time that a 3-D flow takes to compile, and the flow itself would take longer (study
# ``compilation``).
QUICK_3D = {"xla_backend_optimization_level": 1}
QUICK = QUICK_3D | {"xla_cpu_use_fusion_emitters": False}

CompilerOptions = dict[str, bool | int | str]

# Devices wait for each other at the end of each chunk of bodies, and flows differ in cost; without
# this XLA warns where CPU cores wait for 20 seconds and ends a process where they wait a minute.
PATIENT = (
    "--xla_cpu_collective_call_terminate_timeout_seconds=86400 "
    "--xla_cpu_collective_call_warn_stuck_timeout_seconds=86400"
)


def let_devices_wait() -> None:
    """Add the flags ``PATIENT`` to ``XLA_FLAGS``, so that devices may wait a day for each other.

    To be called before the first computation by JAX.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if "terminate_timeout" not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {PATIENT}".strip()


def quick_options(dimension: int = 2) -> CompilerOptions:
    """Return options by which XLA compiles programs quickly on a CPU.

    There are none elsewhere, or where the user has set ``XLA_FLAGS``.

    Args:
      dimension: of the flow, 3 for programs that solve 3-D flows.
    """
    own = os.environ.get("XLA_FLAGS", "").replace(PATIENT, "").strip()
    quick = jax.default_backend() == "cpu" and not own
    return (QUICK_3D if dimension == 3 else QUICK) if quick else {}


def same_options(dimension: int = 2, gradients: bool = False) -> CompilerOptions:
    """Return quick options by which results are the same on any number of devices.

    There must be no more devices than cores, as XLA has the larger number of threads, on which the
    rounding of large matrix products depends. XLA runs its algebraic simplifier once more on
    partitioned programs, and orders the operands of products and sums otherwise, which changes the
    rounding. With that pass disabled, and without the older emitters where there are adjoints,
    results agree to the last bit, at 5 % more time on a CPU. XLA's library of small products
    (YNNPACK, jaxlib 0.10) then crashes now and then, so the pass that calls it,
    ``dot-library-rewriter``, is disabled too.

    Args:
      dimension: of the flow, as for ``quick_options``.
      gradients: whether the program may solve adjoints; it then compiles for longer in 2-D.
    """
    same = {"xla_disable_hlo_passes": "algsimp,dot-library-rewriter"}
    quick = quick_options(dimension)
    if quick and gradients:
        quick = QUICK_3D  # without the older emitters
    return quick | (same if jax.default_backend() == "cpu" else {})


MOST_MAPS = 0.6  # share of the memory maps that Linux allows a process; then programs are dropped
Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")
Function = Callable[Parameters, Result]


def compiled(
    *static: str, options: Callable[..., CompilerOptions] | None = None
) -> Callable[[Function], Function]:
    """Return a decorator like ``jax.jit`` that compiles quickly, with these ``static`` arguments.

    Static arguments are hashed. Inside another transformation of JAX it is ``jax.jit`` itself, as
    only an outermost program has options of compilation. Where the user has set ``XLA_FLAGS`` these
    rule. On one CPU device later processes need not trace it (``lowering``).

    Args:
      static: names of the static arguments.
      options: function of the arguments of a call that returns the options of its compilation; by
        default they are those of ``quick_options``.
    """

    def decorate(function: Function) -> Function:
        nested = jax.jit(function, static_argnames=static, inline=True)

        @functools.cache
        def program(*chosen):
            traced = from_file(function, static) if _on_one_cpu() else function
            return jax.jit(traced, static_argnames=static, compiler_options=dict(chosen))

        @functools.cache
        def usual_program():
            return program(*quick_options().items())

        @functools.wraps(function)
        def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
            if jax.config.jax_disable_jit:
                return function(*args, **kwargs)
            if transformed(*jax.tree.leaves((args, kwargs))):
                return nested(*args, **kwargs)
            whole = program(*options(*args, **kwargs).items()) if options else usual_program()
            known = whole._cache_size()
            result = whole(*args, **kwargs)
            if whole._cache_size() > known:
                limit_memory_maps()
            return result

        return call

    return decorate


def limit_memory_maps() -> None:
    """Drop all compiled programs from memory where the process has too many memory maps.

    A program takes dozens, and Linux allows a process 65,530 unless set otherwise, so that hundreds
    of programs would crash it. Those that are needed again are loaded from JAX's cache.
    """
    maps, most = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")
    if not (maps.exists() and most.exists()):
        return
    if maps.read_text().count("\n") > MOST_MAPS * int(most.read_text()):
        jax.clear_caches()


def _on_one_cpu():
    """Whether JAX has one CPU device and no other.

    Results of lowered programs are committed to a device, which would be wrong among several.
    """
    return jax.default_backend() == "cpu" and jax.device_count() == 1
