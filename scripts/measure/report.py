"""Fill RESULTS.md and the tables of the README from the records in results/.

python scripts/measure/report.py
python scripts/measure/report.py --payoff out/full/payoff.json --took 240,430
python scripts/measure/report.py --check
"""

import json
import re
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from run import PICTURES, RESULTS, keep, load_study
from studies import accelerator, lift_designs, particle, training
from study import Result, words
from tools import mean_and_most

from shapeopt.commands.cli import Parser, emit, run
from shapeopt.commands.ranges import numbers
from shapeopt.payoff.tables import SHOWN_DESIGNS, payoff_tables, short_table
from surrogate import InvalidInput, load
from surrogate.files import whole_file
from surrogate.training.plan import PRESETS

BOOK = Path(__file__).parent / "RESULTS.md"
README = Path(__file__).parents[2] / "README.md"


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Keep the records of other commands that are given, then write the README and RESULTS.md."""
    parser = Parser(__doc__)
    parser.add_argument("--payoff", type=Path, help="result of scripts/payoff.py, to be kept")
    parser.add_argument(
        "--took", help="seconds of the README's first command, least and most of all machines"
    )
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
            raise InvalidInput(f"{path.name}: differs from what scripts/measure/report.py writes")
        if new != old:
            with whole_file(path) as part:
                part.write_text(new)
    return emit({"texts": [README.name, BOOK.name]}, arguments.json, f"-> {README}, {BOOK}")


def filled(text: str, block: Callable[[str, Result], str], folder: Path = RESULTS) -> str:
    """Return the text with its blocks between ``<!-- name -->`` and ``<!-- /name -->`` replaced.

    ``block(name, record)`` returns their contents; nothing stands there where there is no record.
    """

    def put(match):
        path = folder / f"{SOURCES.get(match[1], match[1])}.json"
        body = block(match[1], json.loads(path.read_text())) if path.is_file() else None
        inside = ["", body, ""] if body else []
        return "\n".join([f"<!-- {match[1]} -->", *inside, f"<!-- /{match[1]} -->"])

    return re.sub(r"<!-- (\w+) -->\n.*?<!-- /\1 -->", put, text, flags=re.S)


def keep_payoff(path: Path, out: Path = RESULTS, pictures: Path = PICTURES) -> None:
    """Copy the payoff's result and pictures, those of 3-D scenes under names of their own."""
    result = json.loads(path.read_text())
    space = "_space" if result.get("scene", {}).get("dimension") == 3 else ""
    command = result.pop("command", f"python scripts/payoff.py --out {path.parent}")
    keep(f"payoff{space}", result, command, result.pop("seconds", None), out)
    for name in ("payoff", "shapes"):
        shutil.copyfile(path.with_name(f"{name}.png"), pictures / f"{name}{space}.png")


def whole_block(name: str, record: Result) -> str:
    """Return the tables and picture of a study, then its command, date, duration and machine."""
    result, command, payoff = record["result"], record["command"], name.startswith("payoff")
    text = payoff_tables(result) if payoff else load_study(name).markdown(result)
    if not payoff:  # older records name a file of the study's own
        command = re.sub(r"measure/(?!run\.py)\w+\.py", f"measure/run.py {name}", command)
    picture = PICTURES / f"{name}.png"
    shown = [f"![{name}](../../.pictures/{name}.png)"] if picture.is_file() else []
    minutes = None if record["seconds"] is None else record["seconds"] / 60
    form = "`{command}` on {day}" + ("" if minutes is None else ", {minutes:.1f} minutes") + "; "
    form += ("{accelerator}, " if record["machine"]["accelerator"] else "") + "{cores} cores of "
    details = record["machine"] | {"day": record["date"][:10], "jax": record["versions"]["jax"]}
    details |= {"command": command, "minutes": minutes}
    return "\n\n".join([text, *shown, words(form + "{processor}, jax {jax}", **details)])


def short_block(name: str, record: Result) -> str:
    """Return the part of the README on a study."""
    tell = {
        "training": _training,
        "accuracy": _accuracy,
        "space": _space,
        "payoff": _payoff,
        "payoff_space": _payoff_space,
        "lift_designs": lift_designs.when_to_train,
        "duration": _duration,
    }
    return tell[name](record["result"])


def _training(result: Result) -> str:
    errors = {row["method"]: row["error_mean"] for row in training.summary(result)}
    form = (
        "In study `training`, rivals fitted to {bodies} flows err on average by "
        "{gradient-enhanced kriging} (gradient-enhanced kriging), {kriging} (kriging) and "
        "{polynomial} (a polynomial of degree 4); the methods as published by {sip, as published} "
        "(SIP), {hig, as published} (HIG) and {dp, as published} (DP)."
    )
    return words(form, bodies=PRESETS["full"].samples, **errors)


def _accuracy(result: Result) -> str:
    off = mean_and_most(
        row["error"]
        for row in result["rows"]
        if row["panel"] == "accuracy" and row["row"].startswith("standard")
    )
    form = (
        "On the standard grid Cd of the cylinder (unbounded and in two tunnels, Re 1 to 40) "
        "differs from body-fitted finite elements by {off[0]:.2%} on average and {off[1]:.2%} at "
        "most, that of {count} random sections at incidence by {cd[0]:.2%} and {cd[1]:.2%}, their "
        "Cl by {cl[0]:.2%} and {cl[1]:.2%} of Cd."
    )
    kept = json.loads((RESULTS / "random_sections.json").read_text())["result"]["rows"]
    rows = [row for row in kept if row["fidelity"] == "standard"]
    loads = {load: mean_and_most(row[f"{load}_error"] for row in rows) for load in ("cd", "cl")}
    return words(form, off=off, count=len(rows), **loads)


def _space(result: Result) -> str:
    def errors(panel):
        rows = [row for row in result["rows"] if row["panel"].startswith(panel)]
        return [row["error"] for row in rows if "standard" in (row["row"], row["column"])]

    form = (
        "In 3-D it differs by {sphere[1]:.2%} at most for the sphere (Re 0.1 to 100), "
        "{exact[1]:.2%} for ellipsoids in Stokes flow (Oberbeck) and {revolved[1]:.2%} for {count} "
        "other bodies of revolution (elements). `pretrained:space` differs from this flow by "
        "{drag_error_mean:.2%} on average, {drag_error_max:.2%} at most."
    )
    names = {"sphere": "sphere", "exact": "ellipsoids", "revolved": "aspect"}
    off = {name: mean_and_most(errors(panel)) for name, panel in names.items()}
    text = words(form, count=len(errors("aspect")), **off, **load("pretrained:space").record)
    kept = RESULTS / "particle.json"
    return f"{text} {particle.in_short(json.loads(kept.read_text())['result'])}"


def _payoff(result: Result) -> str:
    times = {row["method"]: row["break_even_s"] for row in result["payoff"]}
    form = (
        "Means over {count} designs, each a local optimum of the flow itself; trainings on "
        "{bodies} bodies unless said; in brackets 95 % intervals. By wall clock `hig` pays against "
        "`direct` after {hig:.0f} designs, `dp` after {dp:.0f}. Kriging with memory needs "
        "{late:.0f} G a design in the end, so here, with four parameters in 2-D, {paying} pays "
        "against it. A robust design of {cases} cases takes {network, and kriging:.0f} flows led "
        "by the network, {kriging from nothing:.0f} by kriging, {direct:.0f} by `direct`."
    )
    counts = {"count": len(result["queries"]), "bodies": PRESETS["full"].samples}
    kriging = next(row for row in result["payoff"] if row["method"] == "kriging with memory")
    *_, (early, fifty), (late, thousand) = zip(SHOWN_DESIGNS, kriging["cumulative_g"], strict=True)
    counts["late"] = (thousand - fifty) / (late - early)
    counts["paying"] = ", ".join(f"`{row['method']}`" for row in _over_kriging(result))
    counts["paying"] = counts["paying"] or "no training"
    robust = json.loads((RESULTS / "scenarios.json").read_text())["result"]["rows"]
    counts["cases"] = max(row["cases"] for row in robust)
    flows = {row["way"]: row["flows"] for row in robust if row["cases"] == counts["cases"]}
    return f"{short_table(result['payoff'])}\n\n{words(form, **counts | times | flows)}"


def _over_kriging(result):
    """Return the rows of the trainings that pay against kriging with memory."""
    rows = [row for row in result["payoff"] if row["training_g"]]
    return [row for row in rows if row["beats_kriging_g"] is not None]


def _payoff_space(result: Result) -> str:
    rows = result["payoff"]
    paid = [row for row in rows if row["training_g"] and row["break_even_g"] is not None]
    first = min(paid, key=lambda row: row["break_even_g"])
    form = "In 3-D ({queries} queries) `{method}` pays first, after {break_even_g:.1f} designs"
    first = first | {"queries": len(result["queries"])}
    over = _over_kriging(result)
    if not over:
        return words(form + ", and none beats kriging with memory.", **first)
    best = min(over, key=lambda row: row["beats_kriging_g"])
    best = first | {"from_design": best["beats_kriging_g"], "best": best["method"]}
    own = "" if best["best"] == first["method"] else " `{best}`"
    form += f", and{own} beats kriging with memory from design {{from_design}} on."
    return words(form, **best)


def _duration(result: Result) -> str:
    form = (
        "It takes {least:.0f} to {most:.0f} minutes on two cores, the install included. A GPU "
        '({device}; `pip install "jax[cuda13]"`) solves batches of flows {gain:.0f} times as fast '
        "as one core."
    )
    least, most = (seconds / 60 for seconds in result["seconds"])
    kept = json.loads((RESULTS / "accelerator.json").read_text())["result"]
    return words(form, least=least, most=most, **accelerator.gain(kept, "2-D, standard"))


SOURCES = {"accuracy": "flow", "space": "flow_3d"}  # of blocks with another name than the study

if __name__ == "__main__":
    sys.exit(run(main))
