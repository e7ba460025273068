"""Fill RESULTS.md and the README's figures from the kept results.

python scripts/measure/report.py
python scripts/measure/report.py --payoff out/full/payoff.json --took 240,430
python scripts/measure/report.py --check
"""

import importlib
import json
import re
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import training
from study import PICTURES, RESULTS, Result, keep, table, words

from shapeopt.commands.cli import Parser, emit, numbers, run
from shapeopt.payoff.tables import payoff_tables, short_table
from surrogate import InvalidInput, load
from surrogate.files import whole_file

BOOK = Path(__file__).parent / "RESULTS.md"
README = Path(__file__).parents[2] / "README.md"


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Keep what other commands have found, then write both texts."""
    parser = Parser(__doc__)
    parser.add_argument("--payoff", type=Path, help="what scripts/payoff.py left, to be kept")
    parser.add_argument("--took", help="seconds of the README's first command, alone and busy")
    parser.add_argument("--check", action="store_true", help="only compare")
    arguments = parser.parse_args(argv)
    if arguments.payoff:
        keep_payoff(arguments.payoff)
    if arguments.took:
        command = re.findall(r"```bash\n(.*?)\n```", README.read_text())[0]
        keep("duration", {"seconds": numbers(arguments.took, "--took")}, command)
    for path, blocks in ((README, short_block), (BOOK, whole_block)):
        old = path.read_text()
        new = filled(old, blocks)
        if arguments.check and new != old:
            raise InvalidInput(f"{path.name}: is not what scripts/measure/report.py would write")
        if new != old:
            with whole_file(path) as part:
                part.write_text(new)
    return emit({"texts": [README.name, BOOK.name]}, arguments.json, f"-> {README}, {BOOK}")


def filled(text: str, block: Callable[[str, Result], str], folder: Path = RESULTS) -> str:
    """The text with ``block(name, record)`` between ``<!-- name -->`` and ``<!-- /name -->``.

    Nothing stands there where there is no record.
    """

    def put(match):
        path = folder / f"{SOURCES.get(match[1], match[1])}.json"
        body = block(match[1], json.loads(path.read_text())) if path.is_file() else None
        inside = ["", body, ""] if body else []
        return "\n".join([f"<!-- {match[1]} -->", *inside, f"<!-- /{match[1]} -->"])

    return re.sub(r"<!-- (\w+) -->\n.*?<!-- /\1 -->", put, text, flags=re.S)


def keep_payoff(path: Path, out: Path = RESULTS, pictures: Path = PICTURES) -> None:
    """The payoff's result and pictures beside those of the studies, in space by another name."""
    result = json.loads(path.read_text())
    space = "_space" if result.get("scene", {}).get("dimension") == 3 else ""
    command = result.pop("command", f"python scripts/payoff.py --out {path.parent}")
    keep(f"payoff{space}", result, command, result.pop("seconds", None), out)
    for name in ("payoff", "shapes"):
        shutil.copyfile(path.with_name(f"{name}.png"), pictures / f"{name}{space}.png")


def whole_block(name: str, record: Result) -> str:
    """All of a study: tables, picture; by which command, when, on what, for how long."""
    tell = (
        payoff_tables if name.startswith("payoff") else importlib.import_module(name).STUDY.tables
    )
    picture, machine = PICTURES / f"{name}.png", record["machine"]
    shown = [f"![{name}](../../.pictures/{name}.png)"] if picture.is_file() else []
    form = "`{command}` on {day}{time}; {on}{cores} cores of {processor}, jax {jax}"
    on = f"{machine['accelerator']}, " if machine["accelerator"] else ""
    time = "" if record["seconds"] is None else f", {record['seconds'] / 60:.1f} minutes"
    origin = {"day": record["date"][:10], "jax": record["versions"]["jax"], "time": time, "on": on}
    return "\n\n".join([tell(record["result"]), *shown, words(form, **machine, **record, **origin)])


def short_block(name: str, record: Result) -> str:
    """What the README says of a study."""
    tell = {
        "training": _training,
        "accuracy": _accuracy,
        "space": _space,
        "payoff": _payoff,
        "duration": _duration,
    }
    return tell[name](record["result"])


def _training(result: Result) -> str:
    heads = "method | error of Cd: mean | max | of its shape gradient | work, G | time"
    heads += " | with compilation"
    forms = "{method} | {error_mean} | {error_max} | {gradient} | {work:.0f} | {time} | {first}"
    return table(training.summary(result), heads, forms)


def _accuracy(result: Result) -> str:
    rows = [row for row in result["rows"] if row["panel"] == "accuracy"]
    errors = np.abs([row["error"] for row in rows if row["row"].startswith("standard")])
    form = (
        "The flow's Cd of the cylinder (unbounded and in two tunnels, Re 1 to 40, standard grid) "
        "is {mean:.2%} off body-fitted finite elements on average, {most:.2%} at most."
    )
    return words(form, mean=errors.mean(), most=errors.max())


def _space(result: Result) -> str:
    def errors(column, panel):
        chosen = [r for r in result["rows"] if (r["row"], r["column"])[panel != "sphere"] == column]
        return np.abs([r["error"] for r in chosen if r["panel"].startswith(panel)])

    held_out, exact = errors("standard", "aspect"), errors("standard", "ellipsoids")
    form = (
        "In space, standard: the sphere's Cd at Re 0.1 to 100 is {sphere:.2%} off at most, those "
        "of ellipsoids of two and three axes {exact:.2%} off Oberbeck's, those of {count} other "
        "bodies of revolution {mean:.2%} off axisymmetric elements on average, {most:.2%} at most. "
        "The network that ships for it, `pretrained:space`, is {net:.2%} off its flow on average, "
        "{worst:.2%} at most."
    )
    shipped = load("pretrained:space").record
    return words(
        form,
        sphere=errors("standard", "sphere").max(),
        exact=exact.max(),
        count=len(held_out),
        mean=held_out.mean(),
        most=held_out.max(),
        net=shipped["drag_error_mean"],
        worst=shipped["drag_error_max"],
    )


def _payoff(result: Result) -> str:
    form = (
        "One robust design asks for {calls:,} drags: {seconds:.1f} s by the network, compilation "
        "included, {hours:.1f} hours by flows and adjoints (extrapolated)."
    )
    hours = result["robust"]["direct_seconds_extrapolated"] / 3600
    return f"{short_table(result['payoff'])}\n\n{words(form, hours=hours, **result['robust'])}"


def _duration(result: Result) -> str:
    form = "It takes {:.0f} to {:.0f} minutes on two cores, the install included."
    return form.format(*(seconds / 60 for seconds in result["seconds"]))


SOURCES = {"accuracy": "flow"}  # of figures, where not of their own name

if __name__ == "__main__":
    sys.exit(run(main))
