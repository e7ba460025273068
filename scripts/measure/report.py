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

from passages import passage
from run import PICTURES, RESULTS, keep, load_study
from study import words

from shapeopt.commands.cli import Parser, emit, run
from shapeopt.commands.ranges import numbers
from shapeopt.payoff.tables import payoff_tables
from surrogate import InvalidInput
from surrogate.files import whole_file

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
    for path, blocks in ((README, passage), (BOOK, study_block)):
        old = path.read_text()
        new = filled(old, blocks)
        if arguments.check and new != old:
            raise InvalidInput(f"{path.name}: differs from what scripts/measure/report.py writes")
        if new != old:
            with whole_file(path) as part:
                part.write_text(new)
    return emit({"texts": [README.name, BOOK.name]}, arguments.json, f"-> {README}, {BOOK}")


def filled(text: str, block: Callable[[str, Path], str], folder: Path = RESULTS) -> str:
    """Return the text with its blocks between ``<!-- name -->`` and ``<!-- /name -->`` replaced.

    Args:
      text: of a file.
      block: returns the contents of a block by its name and the folder of records; nothing where
        there is no record.
      folder: that holds the records.
    """

    def put(match):
        body = block(match[1], folder)
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


def study_block(name: str, folder: Path = RESULTS) -> str:
    """Return the tables and picture of a study, then its command, date, duration and machine."""
    path = folder / f"{name}.json"
    if not path.is_file():
        return ""
    record = json.loads(path.read_text())
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
    form += "{processor}" + (" with AVX-512" if record["machine"].get("avx512") else "")
    return "\n\n".join([text, *shown, words(form + ", jax {jax}", **details)])


if __name__ == "__main__":
    sys.exit(run(main))
