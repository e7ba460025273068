"""Answers a second of surrogates in every form, on one core and on all; the machine's peak."""

import contextlib
import ctypes
import functools
import importlib.util
import itertools
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import jax.export
import numpy as np
from study import Row, Run, Study, Table, Unavailable, columns
from tools import medians

from surrogate import Surrogate, export, load
from surrogate.arrays import AnyArray
from surrogate.exports.plain import PlainNetwork, plain_network
from surrogate.model.inputs import quadratic
from surrogate.model.kriging import Observation, kriging
from surrogate.model.outputs import OutputModel
from surrogate.scene.samples import held_out_samples, training_samples

SURROGATES = ("pretrained", "pretrained:particle")
LANGUAGES = ("C, double", "C, single", "NumPy", "ONNX", "JAX", "kriging", "polynomial")
FLOWS = 64  # observed by kriging, with gradients
FEW, MANY = 1000, 1_000_000
FEWER = 50  # times fewer cases for kriging
FLAGS = ("-std=c99", "-O3", "-march=native", "-ffp-contract=fast", "-shared", "-fPIC")
PEAK = Path(__file__).parents[1] / "peak.c"
Evaluate = Callable[[np.ndarray], object]


def cases(run: Run) -> Iterator[Row]:
    """Yield every language of every surrogate."""
    for name in SURROGATES:
        yield from ({"surrogate": name, "language": language} for language in LANGUAGES)


def measure(run: Run, surrogate: str, language: str) -> Row:
    """Return the answers per second for 1,000 and 1,000,000 cases, and the size of the file."""
    net = load(surrogate)
    samples = held_out_samples(net.scene, 3, FEW)
    few = np.column_stack([samples.parameters, samples.reynolds])
    many = np.tile(few, (run.pick(2, MANY // FEW), 1))
    with tempfile.TemporaryDirectory() as folder:
        evaluate, path, dtype = _language(net, language, Path(folder))
        few, many = few.astype(dtype), many.astype(dtype)
        row: Row = {"bytes": path and path.stat().st_size, "lines": path and _lines(path)}
        if language == "kriging":
            many = many[: len(many) // FEWER]  # it is that much slower
        with _cores(1):
            one = medians([lambda: evaluate(few)], run.pick(1, 7))[0]
            one_many = medians([lambda: evaluate(many)], run.pick(1, 3))[0]
        halves = np.array_split(many, os.cpu_count())
        with ThreadPoolExecutor(len(halves)) as pool:
            by_threads = language.startswith("C") or language == "NumPy"
            calls = (lambda: evaluate(many)), (lambda: list(pool.map(evaluate, halves)))
            all_cores = medians([calls[by_threads]], run.pick(1, 3))[0]
        row |= {"few": len(few) / one, "many": len(many) / one_many}
        row |= {"all_cores": len(many) / all_cores, "peak": None}
        if language.startswith("C"):
            row["peak"] = _least(net, language, Path(folder)) * row["many"]
    return row


def _language(net: Surrogate, language: str, folder: Path) -> tuple[Evaluate, Path | None, type]:
    """A function from inputs (n, inputs) to loads, the file that it is in, and its numbers."""
    if language.startswith("C"):
        precision = language.removeprefix("C, ")
        path = export(net, folder / "net.c", "c", precision=precision)
        dtype = np.float64 if precision == "double" else np.float32
        return in_c(compile_c(path, folder), dtype, len(plain_network(net).loads)), path, dtype
    if language == "NumPy":
        path = export(net, folder / "net.py", "numpy")
        spec = importlib.util.spec_from_file_location("net", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.loads, path, np.float64
    if language == "ONNX":
        path = export(net, folder / "net.onnx", "onnx")
        return _in_onnx(path), path, np.float64
    if language in ("JAX", "kriging"):
        model = net.network if language == "JAX" else _kriging(net)
        path = _in_stablehlo(model, folder / "net.stablehlo", len(plain_network(net).inputs))
        return _jitted(jax.export.deserialize(bytearray(path.read_bytes())).call), path, np.float64
    return _polynomial(net), None, np.float64


def _jitted(function: Callable[[AnyArray], jax.Array]) -> Evaluate:
    compiled = jax.jit(function)
    return lambda x: jax.block_until_ready(compiled(x))


def compile_c(path: Path, folder: Path, *more: str) -> ctypes.CDLL:
    """Compile a C file to a shared library in a folder, with more flags if given, and load it.

    Raises:
      Unavailable: There is no C compiler.
    """
    library = folder / f"{path.stem}.so"
    try:
        subprocess.run(["cc", *FLAGS, *more, "-I", folder, "-o", library, path, "-lm"], check=True)
    except FileNotFoundError:
        raise Unavailable("exports: a C compiler is needed") from None
    return ctypes.CDLL(str(library))


def in_c(library: ctypes.CDLL, dtype: type, outputs: int) -> Evaluate:
    """Return a function from inputs (n, inputs) to loads, by the compiled file of a surrogate."""

    def evaluate(x):
        x, loads = np.ascontiguousarray(x), np.empty((len(x), outputs), dtype)
        pointers = (a.ctypes.data_as(ctypes.c_void_p) for a in (x, loads))
        library.surrogate_loads_batch(ctypes.c_size_t(len(x)), *pointers, None, None)
        return loads

    return evaluate


def _in_onnx(path: Path) -> Evaluate:
    try:
        import onnxruntime
    except ImportError:
        raise Unavailable("exports: onnxruntime is not installed") from None
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return lambda x: session.run(["loads"], {"inputs": x})


def _in_stablehlo(model: OutputModel, path: Path, inputs: int) -> Path:
    """The file that ``jax.export`` writes of a model's loads, for any number of inputs."""
    answers = jax.jit(jax.vmap(lambda x: model.loads(x[:-1], x[-1])))
    (cases,) = jax.export.symbolic_shape("cases")
    shape = jax.ShapeDtypeStruct((cases, inputs), np.float64)
    path.write_bytes(jax.export.export(answers)(shape).serialize())
    return path


def _kriging(net: Surrogate) -> OutputModel:
    """Kriging of as many flows as a design study has, here with the network's own answers."""
    samples = training_samples(net.scene, 0, FLOWS)

    def outputs(parameters, log_re):
        return net.network.outputs(net.network.inputs(parameters, np.e**log_re))

    rows = []
    for body, re in zip(*samples, strict=True):
        by_body, by_re = jax.jacobian(outputs, (0, 1))(body, np.log(re))
        slopes = np.column_stack([by_body, by_re])
        rows.append(Observation(body, float(re), np.asarray(net.network.loads(body, re)), slopes))
    return kriging(rows, net.network.inputs)


def _polynomial(net: Surrogate) -> Evaluate:
    """The trend alone: polynomials of degree 2, by NumPy."""
    inputs = net.network.inputs
    features = _jitted(jax.vmap(lambda x: quadratic(inputs.features(inputs(x[:-1], x[-1])))))
    heads = np.stack(net.network.trends)  # of the moment in space the part by inertia alone
    trends = heads[: len(plain_network(net).loads)]
    return lambda x: np.asarray(features(x)) @ trends.T


def _least(net: Surrogate, language: str, folder: Path) -> float:
    """Seconds an answer needs at the machine's peak: its multiply-adds and its tanh."""
    precision = language.removeprefix("C, ")
    source = export(net, folder / "source.c", "c", precision=precision, prefix="peak")
    source.rename(folder / "peak.h")
    library = compile_c(PEAK, folder)
    kind = ctypes.c_double if precision == "double" else ctypes.c_float
    rounds, chains = 200_000, 96
    seconds = []
    for name in ("peak_multiply_adds", "peak_tanhs"):
        function = getattr(library, name)
        function.restype = kind
        call = functools.partial(function, ctypes.c_long(rounds), kind(0.5))
        seconds.append(medians([call], 5)[0] / (rounds * chains))
    multiply_adds, tanhs = operations(plain_network(net))
    return multiply_adds * seconds[0] + tanhs * seconds[1]


def operations(plain: PlainNetwork) -> tuple[int, int]:
    """Return the numbers of multiply-adds and of tanh of one answer.

    With lift the mirror image is evaluated too.
    """
    sizes, heads = plain.sizes, len(plain.constant)
    products = sum(a * b for a, b in itertools.pairwise(sizes))
    products += heads * sizes[0] * (sizes[0] + 1)
    times = 2 if len(plain.loads) > 1 else 1
    return times * products, times * sum(sizes[1:-1])


@contextlib.contextmanager
def _cores(count: int) -> Iterator[None]:
    """Let all threads of this process run on so many cores."""
    every = os.sched_getaffinity(0)
    _pin(set(sorted(every)[:count]))
    yield
    _pin(every)


def _pin(cores: set[int]) -> None:
    for task in os.listdir("/proc/self/task"):
        with contextlib.suppress(ProcessLookupError):
            os.sched_setaffinity(int(task), cores)


def _lines(path: Path) -> int | None:
    return len(path.read_text().splitlines()) if path.suffix in (".c", ".py") else None


TEXT = (
    f"Kriging has {FLOWS} observations with gradients, the network's own answers; in the last two "
    f"columns of answers it is timed on {MANY // FEWER:,} cases in place of {MANY:,}. The "
    "polynomial is of degree 2, the trend of the network. Share of the peak: seconds for the "
    "multiply-adds and the tanh that an answer needs, each measured alone in a loop without "
    "memory, over the seconds that it takes on one core."
)
COLUMNS = columns(
    "surrogate {surrogate} | language {language} | bytes {bytes:,} | lines {lines}"
    " | answers/s, 1,000 at a time, one core {few:,.0f} | 1,000,000 {many:,.0f}"
    " | all cores {all_cores:,.0f} | share of the peak {peak:.0%}"
)
STUDIES = {"exports": Study([Table(cases, measure, COLUMNS, tiny="first")], TEXT)}
