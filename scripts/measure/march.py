"""The cylinder marched in time by jax-cfd: does it settle on the steady drag, does it shed?

python scripts/measure/march.py
"""

import contextlib
import sys
import tempfile
from collections.abc import Callable

from study import Result, Study, run_study, words

from shapeopt.commands.march_flow import main as march

SETTLED = (
    "Re {reynolds:g}: Cd {cd:.4f} at the end; the steady flow has {cd_steady:.4f} ({gap:+.2%})"
)
SHEDS = "Re {reynolds:g}: Cd {cd_mean:.4f} on average, Cl ±{cl_amplitude:.3f}, Strouhal number "


def measure(tiny: bool, progress: Callable) -> Result:
    """By the command, below the onset of shedding and beyond it."""
    few = ["--time", "5", "--height", "6"] if tiny else []
    rows = []
    with tempfile.TemporaryDirectory() as out, contextlib.redirect_stdout(sys.stderr):
        for reynolds in ("20",) if tiny else ("20", "100"):
            found = march(["--aspect", "1", "--reynolds", reynolds, "--out", out, *few])
            rows.append(found | {"gif": None})
    return {"rows": rows}


def tables(result: Result) -> str:
    lines = [f"The body takes {result['rows'][0]['blockage']:.3f} of its period across the stream."]
    for row in result["rows"]:
        gap = row["cd"] / row["cd_steady"] - 1 if row["cd_steady"] else None
        form = SETTLED if row["cd_steady"] else SHEDS + "{strouhal:.4f}"
        lines.append(f"- {words(form, gap=gap, **row)}")
    return "\n".join(lines)


STUDY = Study("march", measure, tables)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
