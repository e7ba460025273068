"""Options for devices and processes, and the supervision of a process of a distributed command.

JAX aborts all processes when one of them is lost. Each process therefore runs the command in a
child, relays what it prints without the messages of JAX's runtime, and turns an abort into one
line and exit status 5.
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

from shapeopt.commands.cli import LOST, Parser, ProcessLost, memory_is_full
from surrogate.checks import whole_number
from surrogate.compilation import let_devices_wait
from surrogate.devices import ACCELERATOR_BATCH
from surrogate.errors import InvalidInput
from surrogate.processes import join, scheduled

CHILD = "DRAG_SURROGATES_CHILD"  # environment variable of a supervised process
RUNTIME = re.compile(r"\[Gloo\]|[EIW]\d{4} ")  # messages of JAX's runtime
FATAL = re.compile(r"F\d{4} |\*\*\* |terminate called|E\d{4} .*(coordination|distributed)")


def add_device_argument(parser: Parser, purpose: str = "") -> None:
    """Add the option ``--devices``, the number of devices of this process.

    Args:
      parser: of the command.
      purpose: what the command spreads over them, which begins the help.
    """
    words = f"{purpose}devices used by this process, CPU cores or GPUs (1)"
    parser.add_argument("--devices", type=int, help=words)


def use_devices(count: int | None) -> int | None:
    """Make ``count`` CPU cores visible to JAX as devices, where a number is given."""
    if count is not None:
        count = whole_number("--devices", count, 1, 4096)
        with contextlib.suppress(RuntimeError):  # JAX is running; choose_devices checks the number
            jax.config.update("jax_num_cpu_devices", count)
        let_devices_wait()
    return count


def add_distributed_arguments(parser: Parser) -> None:
    """Add the options of devices and of processes that share a job."""
    add_device_argument(parser)
    parser.add_argument(
        "--device-batch",
        type=int,
        help=f"batch size per device, from 1 (1 on a CPU, {ACCELERATOR_BATCH} elsewhere)",
    )
    parser.add_argument("--coordinator", help="HOST:PORT of the first process, the same for all")
    parser.add_argument("--processes", type=int, help="number of processes, from 1 (1)")
    parser.add_argument("--process", type=int, help="index of this process, from 0 (0)")


def needs_supervision(arguments: argparse.Namespace) -> bool:
    """Return whether the command is distributed and this process is not a supervised child.

    Raises:
      InvalidInput: --processes or --process is given without --coordinator.
    """
    many = arguments.coordinator is not None or scheduled()
    if not many and (arguments.processes is not None or arguments.process is not None):
        raise InvalidInput("--processes and --process: go with --coordinator HOST:PORT")
    return many and CHILD not in os.environ


def initialise(arguments: argparse.Namespace) -> int | None:
    """Set up this process's devices and join the others; return how many devices to use in all."""
    count = use_devices(arguments.devices)
    if CHILD not in os.environ:
        return count
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    join(arguments.coordinator, arguments.processes, arguments.process)
    return None


def supervise(command: str, argv: Sequence[str]) -> None:
    """Run a command in a child process and relay its output.

    Raises:
      SystemExit: the child ended with another status than 0, which is passed on.
      ProcessLost: it was aborted, because another process was lost or because it was killed.
    """
    child = subprocess.Popen(
        [sys.executable, "-m", "shapeopt.commands.entry", command, *argv],
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
    if status < 0 or status in (1, LOST):  # JAX ends processes by a signal or by status 1
        raise ProcessLost(
            "a process was lost; the same command on all machines resumes from the last checkpoint"
        )
    if status:
        raise SystemExit(status)


@contextlib.contextmanager
def exit_when_disconnected() -> Iterator[None]:
    """End a supervised process at once when JAX's runtime has lost the others."""
    try:
        yield
    except jax.errors.JaxRuntimeError as error:
        if CHILD not in os.environ or memory_is_full(error):
            raise
        os._exit(LOST)


def _relay(source: TextIO, sink: TextIO) -> None:
    shown = True
    for line in source:
        shown = shown and not FATAL.match(line)
        if shown and not RUNTIME.match(line):
            print(line, end="", file=sink, flush=True)


def _exit_with_parent() -> None:
    sys.stdin.read()  # returns when the parent has ended
    os._exit(LOST)
