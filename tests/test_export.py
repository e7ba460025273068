"""Exported surrogates answer as JAX does: compiled, imported and run on random inputs."""

import ctypes
import importlib.util
import shutil
import subprocess

import jax
import numpy as np
import pytest

from surrogate import InvalidInput, Scene, Surrogate, load
from surrogate.body.parameters import Kind
from surrogate.exports.export import export
from surrogate.flow.grid.discretise import traction_modes
from surrogate.model.network import make_network
from surrogate.scene.samples import network_key, training_samples

CASES = 1000
LIMITS = {"double": 1e-12, "single": 1e-5}  # of loads; of derivatives twice that
DTYPES = {"double": np.float64, "single": np.float32}


EGG = {"beta2": [-0.3, 0.2]}
MANY = {f"beta{k}": [-0.02, 0.02] for k in range(3, 8)}  # for lines longer than Fortran's
LIFTING = {
    "lifting": EGG | MANY | {"gamma2": [-0.2, 0.5], "gamma3": [-0.1, 0.1], "incidence": [-4, 12]},
    # in space: with two even sine modes, and alike fore and aft
    "turning": EGG | {"flatness": [1, 2], "beta4": [-0.1, 0.1], "incidence": [0, 90]},
    "turning alike": {"flatness": [1, 2], "beta3": [-0.2, 0.2], "incidence": [0, 90]},
}


def random_network(name):
    """A network with random weights on a scene with lift: its loads are as good as any."""
    family = {"aspect": [1.5, 4], **LIFTING[name]}
    scene = Scene.of({"dimension": 2 + (name != "lifting"), "reynolds": [2, 40], "family": family})
    samples = training_samples(scene, 0, 40)
    rng = np.random.default_rng(0)
    tractions = -np.ones((40, traction_modes(scene).count))
    outputs = rng.normal(size=(40, 3)) * [1.0, 0.1, 0.01]
    network = make_network(scene, network_key(0), *samples, tractions, outputs)
    return Surrogate(network, scene, {"method": "hig", "samples": 40, "held_out": 8})


SURROGATES = ["pretrained", pytest.param("pretrained:space", marks=pytest.mark.slow), *LIFTING]


@pytest.fixture(scope="module", params=SURROGATES)
def surrogate(request):
    return random_network(request.param) if request.param in LIFTING else load(request.param)


@pytest.fixture(params=["double", "single"])
def precision(request):
    return request.param


def inputs_of(surrogate, precision):
    """Random inputs in a box twice the trained one in size, its corners among them."""
    low, high = surrogate.ranges.bounds.T
    middle, half = (low + high) / 2, (high - low) / 2
    rng = np.random.default_rng(0)
    at = np.clip(middle + half * rng.uniform(-1.5, 1.5, (CASES, low.size)), low - 1, None)
    at[:64] = np.where(rng.random((64, low.size)) < 0.5, low, high)
    ratios = [k for k, name in enumerate(surrogate.scene.family.names) if name in RATIOS]
    at[:, ratios] = np.maximum(at[:, ratios], 0.2)
    at[:, -1] = np.exp(np.minimum(at[:, -1], np.log(290.0)))
    return at.astype(DTYPES[precision])


RATIOS = ("aspect", "flatness")


@pytest.fixture(scope="module")
def by_jax(surrogate):
    """The loads of many bodies and their derivatives, compiled once for all tests."""
    loads = surrogate.network.loads
    return jax.jit(jax.vmap(loads)), jax.jit(jax.vmap(jax.jacrev(loads, argnums=(0, 1))))


@pytest.fixture
def expected(surrogate, by_jax, precision):
    """Inputs, loads, Jacobian and status by JAX in double precision."""
    x = inputs_of(surrogate, precision)
    parameters, reynolds = x[:, :-1].astype(float), x[:, -1].astype(float)
    loads, (shape, by_re) = (function(parameters, reynolds) for function in by_jax)
    jacobian = np.concatenate([shape, by_re[..., None]], axis=-1)
    outside = np.asarray(surrogate.ranges.excess(parameters, reynolds)).any(axis=1)
    inside = np.zeros(CASES, bool)
    inside[:64] = True  # the corners, whatever their rounding in single precision
    return x, np.asarray(loads), jacobian, np.where(inside, 0, outside)


def check(expected, precision, loads, jacobian, status):
    """Errors are measured over Cd, and over the largest derivative of any load in any input."""
    _, right, slopes, flags = expected
    limit = LIMITS[precision]
    assert np.max(np.abs(loads - right) / right[:, :1]) < limit
    largest = np.abs(slopes).max(axis=(1, 2), keepdims=True)
    assert np.max(np.abs(jacobian - slopes) / largest) < 2 * limit
    assert np.array_equal(status, flags)
    assert {0, 1} == set(np.unique(status).tolist())


def build(command, source, tmp_path):
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    library = tmp_path / "library.so"
    subprocess.run([*command, "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    return ctypes.CDLL(str(library))


def pointer(array):
    return array.ctypes.data_as(ctypes.c_void_p)


def blank(expected, precision):
    return [np.zeros(part.shape, DTYPES[precision]) for part in expected[1:3]]


STRICT = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O3"]


def test_c(surrogate, precision, expected, tmp_path):
    source = export(surrogate, tmp_path / "s.c", "c", precision=precision, prefix="my")
    library = build(STRICT, source, tmp_path)
    loads, jacobian = blank(expected, precision)
    x, status = np.ascontiguousarray(expected[0]), np.zeros(CASES, np.uint8)
    batch, one = library.my_loads_batch, library.my_loads
    worst = batch(ctypes.c_size_t(CASES), *map(pointer, (x, loads, jacobian, status)))
    assert worst == 1
    check(expected, precision, loads, jacobian, status)
    alone, slopes = loads[0] * 0, jacobian[0] * 0
    for k in range(0, CASES, 97):
        assert one(*map(pointer, (x[k], alone, slopes))) == status[k]
        assert np.allclose(alone, loads[k], rtol=LIMITS[precision])
    kept, beta = alone.copy(), surrogate.scene.family.body_class.indices(Kind.SINE)[0]
    for place, value in ((-1, np.nan), (-1, np.inf), (-1, -1.0), (beta, -91.0), (beta, 1e30)):
        invalid = x[0].copy()
        invalid[place] = value
        assert one(pointer(invalid), pointer(alone), None) == 2
        assert np.array_equal(alone, kept)


FAST = (["-Ofast"], ["-O2", "-funsafe-math-optimizations"], ["-O2", "-ffp-contract=fast"])
FAST += (["-O2", "-D__AVX512F__"],)  # the larger blocks, on any processor


@pytest.mark.parametrize("flags", FAST, ids=" ".join)
def test_c_whatever_liberties_the_compiler_takes(flags, precision, tmp_path):
    net = random_network("turning")
    low, high = net.ranges.bounds.T
    low, high = (low + high) / 2, 0.3 * low + 0.7 * high  # where no contour crosses itself
    x = np.random.default_rng(1).uniform(low, high, (300, low.size))
    x[:, -1] = np.exp(x[:, -1])
    x = x.astype(DTYPES[precision])
    source = export(net, tmp_path / "s.c", "c", precision=precision)
    compiled = tmp_path / "s.o"  # linked without the flags, which would change this process
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    subprocess.run(
        ["gcc", *flags, "-march=native", "-fPIC", "-c", "-o", compiled, source], check=True
    )
    library = build(["gcc"], compiled, tmp_path)
    loads = np.zeros((len(x), 3), x.dtype)
    count = ctypes.c_size_t(len(x))
    assert library.surrogate_loads_batch(count, pointer(x), pointer(loads), None, None) == 0
    right = net.loads(x[:, :-1].astype(float), x[:, -1].astype(float))
    assert np.max(np.abs(loads - right) / right[:, :1]) < LIMITS[precision]


FORTRAN_HOST = """
subroutine host(count, x, y, by, status) bind(c)
    use iso_c_binding
    use surrogate
    integer(c_int), value :: count
    real(surrogate_kind) :: x(surrogate_inputs, count), y(surrogate_outputs, count)
    real(surrogate_kind) :: by(surrogate_outputs, surrogate_inputs, count)
    integer(c_int) :: status(count)
    call surrogate_loads_batch(x, y, status, by)
end subroutine host
"""


def test_fortran(surrogate, precision, expected, tmp_path):
    source = export(surrogate, tmp_path / "s.f90", "fortran", precision=precision)
    host = tmp_path / "host.f90"
    host.write_text(source.read_text() + FORTRAN_HOST)
    strict = [
        "-std=f2003",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wno-c-binding-type",
        "-O2",
        "-J",
        str(tmp_path),
    ]
    library = build(["gfortran", *strict], host, tmp_path)
    loads, jacobian = blank(expected, precision)
    jacobian = np.ascontiguousarray(jacobian.swapaxes(1, 2))
    x, status = np.ascontiguousarray(expected[0]), np.zeros(CASES, np.int32)
    library.host(CASES, *map(pointer, (x, loads, jacobian, status)))
    check(expected, precision, loads, jacobian.swapaxes(1, 2), status)
    x[0, -1] = np.nan
    library.host(CASES, *map(pointer, (x, loads, jacobian, status)))
    assert status[0] == 2
    assert np.isnan(loads[0]).all()
    assert np.isnan(jacobian[0]).all()


def test_numpy(surrogate, precision, expected, tmp_path):
    source = export(surrogate, tmp_path / "s.py", "numpy", precision=precision)
    lines = source.read_text().splitlines()
    assert len(lines) < 150
    assert [line for line in lines if line.startswith(("import", "from"))] == ["import numpy as np"]
    spec = importlib.util.spec_from_file_location("exported", source)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    x = expected[0]
    found = module.loads(x), module.jacobian(x), module.status(x)
    assert found[0].dtype == found[1].dtype == DTYPES[precision]
    check(expected, precision, *found)
    invalid = x[:2].copy()
    invalid[0, 0] = np.nan
    assert module.status(invalid).tolist() == [2, expected[3][1]]
    assert np.isnan(module.loads(invalid)).any(axis=1).tolist() == [True, False]
    for wrong in (x[0, :1], x[:, :1], x[:, :-1], x[None]):
        for function in (module.loads, module.jacobian, module.status):
            with pytest.raises(ValueError, match=r"rows of .*reynolds.* are needed"):
                function(wrong)


def test_onnx(surrogate, precision, expected, tmp_path):
    onnx = pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    path = export(surrogate, tmp_path / "s.onnx", "onnx", precision=precision)
    onnx.checker.check_model(onnx.load(path), full_check=True)
    session = runtime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    found = session.run(["loads", "jacobian", "status"], {"inputs": expected[0]})
    check(expected, precision, *found)
    invalid = expected[0][:2].copy()
    invalid[0, 0] = np.nan
    loads, jacobian, status = session.run(None, {"inputs": invalid})
    assert status.tolist() == [2, expected[3][1]]
    assert np.isnan(loads).all(axis=1).tolist() == [True, False]
    assert np.isnan(jacobian).all(axis=(1, 2)).tolist() == [True, False]


def test_every_export_says_what_it_is(tmp_path):
    surrogate = load("pretrained")
    for target, suffix in (("c", ".c"), ("fortran", ".f90"), ("numpy", ".py")):
        text = export(surrogate, tmp_path / f"s{suffix}", target).read_text()
        for line in surrogate.card.splitlines():
            assert line in text


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"to": "julia"}, "one of c, fortran, numpy, onnx"),
        ({"precision": "half"}, "one of double, single"),
        ({"prefix": "2d"}, "a letter, then"),
        ({"path": "s.txt"}, r"ends in \.c"),
        ({"to": "fortran", "path": "s.f90", "prefix": "Low"}, "the Fortran code itself uses"),
        ({"to": "fortran", "path": "s.f90", "prefix": "log"}, "the Fortran code itself uses"),
    ],
)
def test_bad_exports_are_refused(changes, message, tmp_path):
    arguments = {"path": "s.c", "to": "c", **changes}
    arguments["path"] = tmp_path / arguments["path"]
    with pytest.raises(InvalidInput, match=message):
        export(load("pretrained"), **arguments)
    assert not list(tmp_path.iterdir())
