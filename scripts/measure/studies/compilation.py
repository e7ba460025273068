"""Where the seconds of a first hour go: compilation by program, and how fast quick code runs."""

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from study import Row, Run, Study, Table, cases, columns
from tools import cold_cache

from surrogate import Flow, Scene
from surrogate.compilation import QUICK, QUICK_3D
from surrogate.flow.solver import steady

ROOT = Path(__file__).parents[3]
EXAMPLE, COMMAND = "the README's example", "the README's first command"
PAYOFF = "from shapeopt.commands.payoff_command import main\n"
PAYOFF += 'main(["--preset", "quick", "--out", "quick"])'
SHOWN = 8  # programs of each run
ROUNDS = 9  # runs of a program, of which the fastest counts
SHORT = "import surrogate, jax.numpy\njax.numpy.arange(3.0).sum()"  # of tiny runs
# What surrounds the code of a child process: it lists all programs that are compiled or loaded.
CHILD = """
import json, time
start, programs, traced = time.perf_counter(), [], 0.0
import jax
def listen(event, seconds, **more):
    global traced
    if event == "/jax/core/compile/backend_compile_duration":
        programs.append([more.get("fun_name", "?"), seconds])
    elif event.startswith("/jax/core/compile/jaxpr_"):
        traced += seconds
jax.monitoring.register_event_duration_secs_listener(listen)
{code}
seconds = time.perf_counter() - start
print(json.dumps({{"seconds": seconds, "programs": programs, "traced": traced}}))
"""


def processes(run: Run, what: str) -> list[Row]:
    """Run code in a new process, first without compiled code, then with what the first left."""
    code = run.pick(SHORT, PAYOFF if what == COMMAND else _example())
    with tempfile.TemporaryDirectory() as scratch:
        return [{"cache": cache} | _process(code, scratch, cache) for cache in ("empty", "filled")]


def _example():
    return re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.S)[0]


def _process(code, scratch, name):
    """Return the seconds of a process, of all its programs, and of the longest by name."""
    folder = Path(scratch, name)
    folder.mkdir()
    argv = [sys.executable, "-c", CHILD.format(code=code)]
    paths = {"XDG_CACHE_HOME": scratch, "PYTHONPATH": str(ROOT), "XLA_FLAGS": ""}
    out = subprocess.run(
        argv, stdout=subprocess.PIPE, text=True, check=True, cwd=folder, env=os.environ | paths
    ).stdout
    said, total = json.loads(out.splitlines()[-1]), defaultdict(float)
    for program, seconds in said["programs"]:
        total[program] += seconds
    longest = sorted(total.items(), key=lambda item: -item[1])[:SHOWN]
    return {
        "seconds": said["seconds"],
        "programs": len(said["programs"]),
        "trace_s": said["traced"],
        "compile_s": sum(total.values()),
        "longest": ", ".join(f"{program} {seconds:.1f} s" for program, seconds in longest),
    }


def options(run: Run, dimension: int, name: str, options: Row) -> Row:
    """Return the processor time that compiling a flow and running it take, with XLA's options."""
    level = "standard" if dimension == 2 else "draft"
    flow = Flow(scene := Scene(dimension=dimension, fidelity=run.fidelity(level, dimension)))
    markers = flow.bodies.markers(jnp.asarray(scene.family.ellipse(2.0)))

    def body_flow(markers, reynolds):
        operators = steady.assemble(flow.domain, markers, reynolds)
        return steady.body_flow(flow.domain, operators)

    at = markers, jnp.asarray(20.0)
    with cold_cache():
        lowered = jax.jit(body_flow).lower(*at)
        start = time.process_time()
        solve = lowered.compile(options)
        compiling = time.process_time() - start
    seconds = []
    for _ in range(run.pick(1, ROUNDS)):
        start = time.process_time()
        jax.block_until_ready(solve(*at))
        seconds.append(time.process_time() - start)
    return {"compile_s": compiling, "run_s": float(np.min(seconds))}


PROCESSES = columns(
    "process {what} | cache {cache} | in all {seconds:.0f} s | programs {programs}"
    " | tracing and lowering them {trace_s:.0f} s | compiling or loading them {compile_s:.0f} s"
    " | most of it {longest}"
)
OPTIONS = columns(
    "flow {dimension}-D | XLA's options {name} | compiling a flow {compile_s:.1f} s"
    " | running it {run_s:.3f} s"
)
WAYS = [
    {"dimension": dimension, "name": name, "options": options}
    for dimension in (3, 2)
    for name, options in (
        ("default", {}),
        ("without costlier optimisations", QUICK_3D),
        ("and with older emitters", QUICK),
    )
]
STUDIES = {
    "compilation": Study(
        [
            Table(cases(what=(EXAMPLE, COMMAND)), processes, PROCESSES),
            Table(WAYS, options, OPTIONS, key="options", tiny="last"),
        ]
    )
}
