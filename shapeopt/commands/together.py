"""A command as one of many processes: joined, and watched, so that a lost one is told in a line.

JAX aborts all processes when one is lost. So each command runs as a child; its parent relays what
it says, leaves out what the runtime prints, and turns an abort into a message and a status.
"""

import argparse
import contextlib
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from typing import TextIO

import jax

from shapeopt.commands.cli import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    LOST,
    NOT_CONVERGED,
    NOT_WRITTEN,
    Parser,
    ProcessLost,
)
from surrogate.checks import whole_number
from surrogate.errors import InvalidInput
from surrogate.processes import join, scheduled

CHILD = "DRAG_SURROGATES_CHILD"  # set in the environment of a watched process
RUNTIME = re.compile(r"\[Gloo\]|[EIW]\d{4} ")  # lines of JAX's runtime
FATAL = re.compile(
    r"F\d{4} |\*\*\* |terminate called|E\d{4} .*(coordination|distributed)"
)  # the end


def add_devices(parser: Parser) -> None:
    """--devices."""
    parser.add_argument("--devices", type=int, help="of this process: CPU cores, or GPUs (1)")


def use_devices(count: int | None) -> int | None:
    """Make so many cores of a CPU devices, where so many are asked for."""
    if count is not None:
        count = whole_number("--devices", count, 1, 4096)
        with contextlib.suppress(RuntimeError):  # JAX has begun; whether it has them is seen later
            jax.config.update("jax_num_cpu_devices", count)
    return count


def add_arguments(parser: Parser) -> None:
    """--devices, --lanes, --coordinator, --processes, --process."""
    add_devices(parser)
    parser.add_argument(
        "--lanes", type=int, help="bodies solved at once on a device, from 1 (as many as pay)"
    )
    parser.add_argument("--coordinator", help="HOST:PORT of the first process, for all of them")
    parser.add_argument("--processes", type=int, help="how many there are, from 1 (1)")
    parser.add_argument("--process", type=int, help="which this is, from 0 (0)")


def is_parent(arguments: argparse.Namespace) -> bool:
    """Whether this is one of many processes that is not yet watched."""
    many = arguments.coordinator is not None or scheduled()
    if not many and (arguments.processes or arguments.process):
        raise InvalidInput("--processes and --process: go with --coordinator HOST:PORT")
    return many and CHILD not in os.environ


def come_together(arguments: argparse.Namespace) -> int | None:
    """Devices for this process as asked, the others joined; how many devices to use in all."""
    count = use_devices(arguments.devices)
    if CHILD not in os.environ:
        return count
    threading.Thread(target=_end_with_parent, daemon=True).start()
    join(arguments.coordinator, arguments.processes, arguments.process)
    return None


def watch(command: str, argv: Sequence[str]) -> None:
    """Run a command in a child process and relay it.

    Raises:
      SystemExit: with the child's status where that is not 0.
      ProcessLost: it was aborted, since another process was lost or it was killed itself.
    """
    words = [sys.executable, "-m", "shapeopt.commands.entry", command, *argv]
    child = subprocess.Popen(
        words,
        env=os.environ | {CHILD: "1"},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    relays = [
        threading.Thread(target=_relay, args=(source, sink))
        for source, sink in ((child.stdout, sys.stdout), (child.stderr, sys.stderr))
    ]
    for relay in relays:
        relay.start()
    try:
        status = child.wait()
    except KeyboardInterrupt:
        child.terminate()
        child.wait()
        raise
    finally:
        for relay in relays:
            relay.join()
    if status not in (DONE, BAD_INPUT, NOT_CONVERGED, NOT_WRITTEN, INTERRUPTED):
        raise ProcessLost(
            "a process was lost; the same command on all of them goes on from the last checkpoint"
        )
    if status:
        raise SystemExit(status)


@contextlib.contextmanager
def as_one() -> Iterator[None]:
    """End at once where the runtime can no longer reach the other processes."""
    try:
        yield
    except jax.errors.JaxRuntimeError:
        if CHILD not in os.environ:
            raise
        os._exit(LOST)


def _relay(source: TextIO, sink: TextIO) -> None:
    shown = True
    for line in source:
        shown = shown and not FATAL.match(line)
        if shown and not RUNTIME.match(line):
            print(line, end="", file=sink, flush=True)


def _end_with_parent() -> None:
    sys.stdin.read()
    os._exit(LOST)
