"""The cylinder marched in time by jax-cfd, below and beyond the onset of vortex shedding."""

import contextlib
import sys
import tempfile

from study import Result, Row, Run, Study, Table, words

from shapeopt.commands.march import main as march

SETTLED = "Re {reynolds:g}: Cd {cd:.4f} at the end; steady flow {cd_steady:.4f} ({gap:+.2%})"
SHEDS = "Re {reynolds:g}: mean Cd {cd_mean:.4f}, Cl ±{cl_amplitude:.3f}, Strouhal number "
SHEDS += "{strouhal:.4f}"


def measure(run: Run, reynolds: float) -> Row:
    """By the command ``march_flow.py``."""
    few = run.pick(["--time", "5", "--height", "6"], [])
    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stdout(sys.stderr):
        argv = ["--aspect", "1", "--reynolds", f"{reynolds:g}", "--out", out, *few]
        return march(argv) | {"gif": None}


def text(result: Result) -> str:
    lines = [words("Blockage of the periodic domain: {blockage:.3f}.", **result["rows"][0])]
    for row in result["rows"]:
        gap = row["cd"] / row["cd_steady"] - 1 if row["cd_steady"] else None
        lines.append(f"- {words(SETTLED if row['cd_steady'] else SHEDS, gap=gap, **row)}")
    return "\n".join(lines)


CASES = [{"reynolds": 20.0}, {"reynolds": 100.0}]
STUDY = Study([Table(lambda run: CASES, measure)], text)
