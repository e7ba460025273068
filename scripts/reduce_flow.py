"""Solve some flows of a scene and keep their common modes: what a cheap certificate starts from.

python scripts/reduce_flow.py --preset full --out out/flows.npz
"""

import sys
import time
from collections.abc import Sequence
from typing import Any

import jax
from common import Parser, command_line, emit, progress_bar, run

from surrogate.errors import InvalidInput
from surrogate.files import check_file
from surrogate.reduced import FEWEST, reduce_flow, save_reduced
from surrogate.training.physics import draw_samples
from surrogate.training.presets import preset


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Draw bodies, solve, decompose, save."""
    arguments = _parser().parse_args(argv)
    plan = preset("sip", arguments.preset, arguments.seed)
    count = plan.samples // 2 if arguments.bodies is None else arguments.bodies
    if not FEWEST <= count <= 4096:
        raise InvalidInput(f"--bodies {count}: from {FEWEST} to 4096")
    out = check_file(arguments.out, ".npz")
    samples = draw_samples(plan.scene, jax.random.split(jax.random.key(plan.seed), 3)[0], count)
    start = time.perf_counter()
    with progress_bar("solving flows and adjoints") as progress:
        reduced, work = reduce_flow(plan.scene, samples, report=progress)
    result = {
        "samples": count,
        "seed": plan.seed,
        "green_applications": work,
        "seconds": time.perf_counter() - start,
        "command": command_line(),
    }
    reduced.record.update(result)
    save_reduced(out, reduced)
    result |= {"out": str(out), "bytes": out.stat().st_size}
    text = (
        f"{count} flows and adjoints, {work} applications of G, {result['seconds']:.0f} s -> {out} "
        f"({result['bytes'] / 1e6:.1f} MB)"
    )
    return emit(result, arguments.json, text)


def _parser():
    parser = Parser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", default="quick", choices=["quick", "full"])
    parser.add_argument("--bodies", type=int, help="flows to solve; half the preset's samples")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", required=True, help="the file, .npz")
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout")
    return parser


if __name__ == "__main__":
    sys.exit(run(main))
