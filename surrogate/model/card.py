"""The model card of a surrogate: what it predicts, how well, and what it must not be used for."""

from surrogate.body.parameters import FORMULAS, PARAMETERS
from surrogate.files import JsonObject
from surrogate.model.outputs import LOAD_NAMES, SYMBOLS
from surrogate.scene.scene import Scene
from surrogate.scene.stream import describe_stream
from surrogate.versions import package_version

KINDS = {"mean": "mean", "p95": "95 % below", "max": "largest"}  # of errors in a record
METHODS = {
    "dp": "differentiable physics",
    "sip": "scale-invariant physics updates",
    "hig": "half-inverse gradients",
    "supervised": "supervised regression",
}

# Errors of single held-out bodies scatter: in trainings whose mean is within the flow's tolerance
# they are up to 15 times the mean (RESULTS.md, training).
LARGEST_ERROR = 10  # over the flow's tolerance, of a held-out body, that is not large


def model_card(scene: Scene, record: JsonObject) -> str:
    """Return the card of a surrogate as lines of text.

    Args:
      scene: on which it was trained.
      record: of its training.
    """
    planar, lifting = scene.dimension == 2, scene.family.has_lift
    fidelity = scene.fidelity
    low, high = scene.reynolds
    ranges = "; ".join(
        f"{name} {a:g} to {b:g} ({PARAMETERS[name].meaning})"
        for name, (a, b) in scene.family.ranges
    )
    force = "2 Fx per unit span" if planar else "8 Fx / pi"
    size = "area pi D^2 / 4" if planar else "volume pi D^3 / 6"
    loads = f"Cd = {force}, x downstream"
    if lifting:
        up = "Cl = 2 Fy, Cm = 2 M" if planar else "Cl = 8 Fz / pi with z up, Cm = 8 M / pi"
        loads += f", {up}, M about the centroid, nose up"
    version = record.get("versions", {}).get("drag-surrogates") or package_version()
    lines = [
        f"Laminar aerodynamic surrogate, {scene.dimension}-D: {'Cd, Cl, Cm' if lifting else 'Cd'}",
        f"Flow: steady, laminar, incompressible, in {describe_stream(scene.stream)}.",
        f"Trained ranges: Re = U D / nu {low:g} to {high:g}; {ranges}.",
        "Bodies: " + FORMULAS[scene.dimension].replace("\n", "\n  "),
        f"Normalisation: {loads}, with U = D = rho = 1, D the diameter of equal {size}.",
        _training(record),
        *_errors(record),
        "Bounds for the errors of each answer: Surrogate.error_bounds in Python, predict_drag.py.",
        f"Flow solver: {fidelity.name}, {scene.fidelity_for_bodies.cells} cells per D, made for "
        f"drags within {100 * fidelity.tolerance:g} % of the exact flow.",
        *_limits(scene, record),
        "Not for: turbulent, unsteady or compressible flow, rough or flexible bodies, bodies near",
        "walls or each other, contours that cross themselves; outside the ranges only where asked.",
        f"Made by drag-surrogates {version}, MIT licence; {_weights(record)}.",
    ]
    return "\n".join(lines) + "\n"


def recorded_errors(record: JsonObject) -> dict[str, dict[str, float]]:
    """Return the errors on held-out bodies, over Cd, that a record has: by load, then by kind."""
    known = {
        load: {k: e for k in KINDS if (e := record.get(f"{load}_error_{k}")) is not None}
        for load in LOAD_NAMES
    }
    return {load: errors for load, errors in known.items() if errors}


def unseen_bodies(record: JsonObject) -> int | None:
    """Return how many held-out bodies the recorded errors are of: those whose flows converged."""
    count = record.get("held_out")
    return count if count is None else count - record.get("held_out_failed", 0)


def inaccuracy_of(scene: Scene, record: JsonObject) -> str | None:
    """Return the text of a warning about a large error; None if its error is not large.

    Args:
      scene: on which the surrogate was trained.
      record: of its training.
    """
    tolerance = scene.fidelity.tolerance
    mean, most = (
        max(record.get(f"{name}_error_{key}", 0.0) for name in LOAD_NAMES)
        for key in ("mean", "max")
    )
    if mean <= tolerance and most <= LARGEST_ERROR * tolerance:
        return None
    samples, budget = record.get("samples"), record.get("budget_s")
    help = [f"a budget above {budget:g} s"] if budget else []
    help.append(f"more samples than {samples}" if samples else "more samples")
    return (
        f"its loads are inaccurate: error on held-out bodies {mean:.2%} on average and "
        f"{most:.2%} at most, the flow's tolerance is {tolerance:.2%}; "
        f"{' or '.join(help)} would help"
    )


def _training(record):
    """Return how and on how many bodies the network was trained, as far as that is recorded."""
    if "method" not in record:
        return "Training: not recorded."
    words = METHODS.get(record["method"], record["method"])
    if "samples" in record:
        once = record["method"] == "supervised" or not record.get("published")  # none fails twice
        failed = once * record.get("failed_samples", 0) + record.get("unsolved_samples", 0)
        words += f" on {record['samples'] - failed} bodies"
    words += f", seed {record['seed']}" if "seed" in record else ""
    return f"Training: {words}."


def _limits(scene, record):
    """Yield lines on flattened bodies at incidence, and on bodies whose steady flow is unstable."""
    if {"flatness", "incidence"} <= set(scene.family.names):
        yield "Bodies of a flatness other than 1: the stream is in the plane of length and height."
    if count := record.get("beyond_onset"):
        yield (
            f"{count} of the training bodies are beyond the estimated onset of instability of "
            "their flow; steady loads are answered there all the same."
        )


def _weights(record):
    """Return which weights they are, by the digest that the record has of them."""
    digest = record.get("weights_sha256")
    return f"weights {digest[:12]} (SHA-256)" if digest else "weights without a digest"


def _errors(record):
    """Yield lines on the errors of each load that are recorded."""
    known = recorded_errors(record)
    if not known:
        yield "Errors: not recorded."
        return
    count = unseen_bodies(record)
    number = "" if count is None else f"{count} "
    yield f"Errors over Cd on {number}unseen bodies, against the flow solver:"
    for load, errors in known.items():
        words = (f"{KINDS[kind]} {100 * error:.3f} %" for kind, error in errors.items())
        yield f"  {SYMBOLS[load]}: {', '.join(words)}"
