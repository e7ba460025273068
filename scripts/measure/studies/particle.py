"""The shipped surrogate of particles beside the flow and the correlations of particle codes."""

import functools
from collections.abc import Iterator

import numpy as np
from correlations_at_incidence import AT_INCIDENCE, ZASTAWNY, Loads
from study import Result, Row, Run, Study, Table, columns
from tools import mean_and_most

from surrogate import Flow, Scene, load

SURROGATE, SEED = "pretrained:particle", 7  # the training used another seed
KINDS = {  # what is drawn of each: prolate spheroids, oblate ones, flattened ellipsoids, others
    "prolate": {"aspect": (1.05, 4.0)},
    "oblate": {"aspect": (0.3, 0.95)},
    "flattened": {"aspect": (0.5, 3.0), "flatness": (1.1, 2.0)},
    "fore and aft unlike": {"aspect": (0.5, 3.0), "beta2": (-0.3, 0.3)},
}
LOADS = ("cd", "cl", "cm")


def bodies(run: Run) -> Iterator[Row]:
    """Random bodies of every kind at random incidence and Re, the first prolate ones Zastawny's."""
    scene = load(SURROGATE).scene
    for kind, ranges in KINDS.items():
        family = {"aspect": (1, 1), "flatness": (1, 1), "beta2": (0, 0), "incidence": (0, 90)}
        drawn = np.random.default_rng([SEED, *map(ord, kind)])
        for k in range(10):
            values = {n: drawn.uniform(*r) for n, r in (family | ranges).items()}
            if kind == "prolate" and k < 2 * len(ZASTAWNY):
                values["aspect"] = list(ZASTAWNY)[k % len(ZASTAWNY)]
            reynolds = np.exp(drawn.uniform(*np.log(scene.reynolds)))
            yield {"kind": kind, "parameters": values, "reynolds": float(reynolds)}


def measure(run: Run, kind: str, parameters: dict[str, float], reynolds: float) -> Row:
    """Loads by the flow, and the errors over Cd of the surrogate and of the correlations."""
    net = load(SURROGATE)
    true = np.asarray(_flow(run.tiny).loads(net.scene.family.parameters(parameters), reynolds))
    loads = net.loads(net.scene.family.parameters(parameters), reynolds)
    answers = {"surrogate": Loads(*loads.tolist())} | dict.fromkeys(AT_INCIDENCE)
    if not parameters["beta2"]:  # they are for ellipsoids
        shape = [parameters[name] for name in ("aspect", "flatness", "incidence")]
        answers |= {name: answer(*shape, reynolds) for name, answer in AT_INCIDENCE.items()}
    row: Row = dict(zip(LOADS, true.tolist(), strict=True))
    for name, answer in answers.items():
        given = zip(answer or Loads(None), true.tolist(), strict=True)
        errors = [None if a is None else (a - b) / true[0] for a, b in given]
        row[name] = dict(zip(LOADS, errors, strict=True))
    return row


@functools.cache
def _flow(tiny: bool) -> Flow:
    scene = load(SURROGATE).scene
    return Flow(Scene.of(scene.record | {"fidelity": "draft"}) if tiny else scene)


def text(result: Result) -> str:
    """Mean and largest errors by kind of body, and of each correlation within its range."""
    rows, parts = result["rows"], []
    groups = [("all bodies", rows)]
    groups += [(kind, [row for row in rows if row["kind"] == kind]) for kind in KINDS]
    for name in ("surrogate", *AT_INCIDENCE):
        words = []
        for kind, group in groups:
            said = []
            for load_name, symbol in zip(LOADS, ("Cd", "Cl", "Cm"), strict=True):
                errors = [row[name][load_name] for row in group]
                errors = [error for error in errors if error is not None]
                if errors:
                    mean, most = mean_and_most(errors)
                    said.append(f"{symbol} {mean:.2%} and {most:.2%}")
            if said:
                words.append(f"{kind} {', '.join(said)}")
        parts.append(f"{name}: {'; '.join(words)}")
    return (
        "Errors over Cd by the flow, on average and at most, of bodies that no training has seen, "
        f"each correlation within its range. {'. '.join(parts)}."
    )


def in_short(result: Result) -> str:
    """One sentence: the shipped surrogate and the best correlation."""

    def means(name, rows):
        errors = [[row[name][key] for row in rows] for key in LOADS]
        return "/".join(f"{100 * mean_and_most(each)[0]:.2f}" for each in errors)

    rows = result["rows"]
    theirs = [row for row in rows if row["Froehlich"]["cd"] is not None]
    return (
        f"`pretrained:particle`, for any angle of incidence, differs from its flow by "
        f"{means('surrogate', rows)} % of Cd in Cd, Cl and Cm on average over {len(rows)} unseen "
        f"bodies; the best published correlation, Froehlich's of prolate spheroids, by "
        f"{means('Froehlich', theirs)} % within its range."
    )


COLUMNS = columns(
    "kind {kind} | body {parameters[aspect]:.2f}, {parameters[flatness]:.2f}, "
    "{parameters[beta2]:+.2f} | incidence {parameters[incidence]:.1f} | Re {reynolds:.3g}"
    " | Cd {cd:.4f} | Cl {cl:+.4f} | Cm {cm:+.4f}"
    " | error of the surrogate {surrogate[cd]:+.2%}, {surrogate[cl]:+.2%}, {surrogate[cm]:+.2%}"
)
STUDIES = {"particle": Study([Table(bodies, measure, COLUMNS)], text)}
