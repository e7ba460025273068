"""Several devices and processes: results do not depend on them, and a lost process ends all."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import numpy as np
import pytest
from tools import free_port

from shapeopt import Designer, Problem
from surrogate import InvalidInput
from surrogate.arrays import compute_where
from surrogate.devices import choose_devices
from surrogate.partition import partition_bodies
from surrogate.processes import join, scheduled

HERE = Path(__file__).parent
ROOT = HERE.parent
TRAIN = [sys.executable, str(ROOT / "scripts" / "train_surrogate.py")]
SCENE = """
reynolds = [1, 40]
fidelity = "draft"
[family]
aspect = [1, 2]
beta2 = [-0.2, 0.2]
"""


@pytest.mark.parametrize(("bodies", "count"), [(13, 4), (64, 2), (3, 4), (1, 1)])
def test_every_body_has_one_device_and_costs_are_balanced(generator, bodies, count):
    estimated_cost = generator.random(bodies)
    partition = partition_bodies(_stands_for(count), estimated_cost)
    assert len(set(partition.places.tolist())) == bodies
    assert partition.places.max() < partition.shard_size * count
    costs = [estimated_cost[partition.places // partition.shard_size == k] for k in range(count)]
    assert max(map(len, costs)) - min(map(len, costs)) <= 1
    if bodies >= 8 * count:
        sums = [share.mean() for share in costs]
        assert max(sums) < 1.15 * min(sums)
    rows = partition.scatter(np.arange(bodies)).rows
    assert np.array_equal(np.asarray(rows)[partition.places], np.arange(bodies))


def _stands_for(count):
    """Devices of which only the count is used."""

    class Some(type(choose_devices())):
        count = property(lambda self: self.device_batch)

    return Some(choose_devices().mesh, count)


def test_wrong_devices_are_refused(unchecked):
    with pytest.raises(InvalidInput, match="JAX has"):
        choose_devices(len(jax.devices()) + 1)
    for wrong in (0, 1.5, "2"):
        with pytest.raises(InvalidInput, match="devices"):
            choose_devices(wrong)
    with pytest.raises(InvalidInput, match="device_batch"):
        choose_devices(1, 0)
    with pytest.raises(InvalidInput, match="HOST:PORT"):
        join("localhost", 2, 0)
    with pytest.raises(InvalidInput, match="process 2 of 2"):
        join("localhost:1", 2, 2)


def test_schedulers_are_seen():
    assert not scheduled({})
    assert not scheduled({"SLURM_NTASKS": "4"})  # an allocation, in which nothing was started
    assert scheduled({"SLURM_NTASKS": "4", "SLURM_STEP_NODELIST": "node[1-4]"})
    assert scheduled({"OMPI_COMM_WORLD_SIZE": "2"})
    assert not scheduled({"OMPI_COMM_WORLD_SIZE": ""})


@pytest.mark.slow
def test_device_batches_change_nothing_but_rounding(tiny_scene):
    from surrogate import Flow
    from surrogate.scene.samples import training_samples

    samples = training_samples(tiny_scene, 0, 7)
    one, three = (Flow(tiny_scene).solve_all(*samples, choose_devices(1, k)) for k in (1, 3))
    assert np.array_equal(one.green_applications, three.green_applications)
    assert one.amplitude == pytest.approx(three.amplitude, rel=1e-5, abs=1e-6)


@pytest.mark.slow
def test_slopes_of_many_bodies_are_those_of_each(tiny_scene):
    from surrogate import Flow
    from surrogate.scene.samples import training_samples

    flow, (bodies, numbers) = Flow(tiny_scene), training_samples(tiny_scene, 0, 3)
    together = flow.solve_all(bodies, numbers, gradients=True)
    for k, pair in enumerate(zip(bodies, numbers, strict=True)):
        alone = flow.loads_and_gradients(*pair)
        assert int(together.green_applications[k]) == int(alone.green_applications)
        assert together.drag[k] == pytest.approx(float(alone.drag), rel=1e-6)
        assert together.gradient[k] == pytest.approx(np.asarray(alone.gradient), rel=1e-3, abs=1e-4)


@pytest.mark.slow
def test_a_design_of_several_flows_is_the_same_on_two_devices(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    script = str(ROOT / "scripts" / "optimize_shape.py")
    words = ["--surrogate", "none", "--scene", str(tmp_path / "scene.toml"), "--json"]
    found = []
    for count in ("1", "2"):
        out = ["--reynolds", "4,12,36", "--devices", count, "--out", str(tmp_path / count)]
        done = subprocess.run(
            [sys.executable, script, *words, *out],
            env=_environment(),
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        found.append(json.loads(done.stdout.splitlines()[-1]))
    assert found[0]["flows"] == found[1]["flows"]
    assert found[0]["cd_verified"] == pytest.approx(found[1]["cd_verified"], rel=1e-6)


@pytest.mark.slow
def test_many_queries_have_the_same_designs_on_three_devices():
    code = """if True:
        import jax, numpy as np
        from shapeopt import Problem, optimise_all
        from surrogate import load
        jax.config.update("jax_num_cpu_devices", 3)
        net = load("pretrained")
        asked = [Problem(net.scene, re, max_length=1.3 + re / 40) for re in (2.0, 11.0, 20.0, 37.0)]
        one, three = (optimise_all(asked, net, devices=count) for count in (1, 3))
        off = [np.abs(a.parameters - b.parameters).max() for a, b in zip(one, three, strict=True)]
        assert max(off) < 1e-9, off
        assert [d.problem.reynolds for d in three] == [2.0, 11.0, 20.0, 37.0]
    """
    done = subprocess.run(
        [sys.executable, "-c", code], env=_environment(), capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_two_devices_train_without_stored_velocities(tmp_path):
    """Supervised regression solves each flow once, so that no velocities are sharded."""
    weights = _trained_on(tmp_path, 2, "symmetric", ["supervised"])["supervised"]
    assert np.isfinite(weights).all()
    (errors,) = tmp_path.rglob("errors.npy")
    initial, trained = np.load(errors)
    assert trained < 0.7 * initial


@pytest.mark.slow
@pytest.mark.parametrize("bodies", ["symmetric", "sections"])
def test_weights_are_the_same_on_any_number_of_devices(tmp_path, bodies):
    """Train on one and on four, and by the first method on four from a checkpoint of one."""
    methods = ["sip", "dp", "hig", "supervised"]
    found = {count: _trained_on(tmp_path, count, bodies, methods) for count in (1, 4)}
    assert set(found[1]) == set(methods)
    assert set(found[4]) == {*methods, "resumed"}
    resumed = found[4].pop("resumed")
    for method, weights in found[4].items():
        assert np.array_equal(weights, found[1][method]), method
    assert np.array_equal(resumed, found[1][methods[0]])


@pytest.mark.slow
def test_two_processes_of_two_devices_train_as_one(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE)
    alone = _start(tmp_path, "alone")
    port = free_port()
    pair = [_start(tmp_path, "pair", *_of_two(port, k), "--devices", "2") for k in (0, 1)]
    texts = [process.communicate(timeout=500) for process in (alone, *pair)]
    assert [p.returncode for p in (alone, *pair)] == [0, 0, 0], texts
    json.loads(texts[1][0].splitlines()[-1])
    assert texts[2][0] == ""
    weights = [(tmp_path / name / "weights.eqx").read_bytes() for name in ("alone", "pair")]
    assert weights[0] == weights[1]


@pytest.mark.slow
@pytest.mark.parametrize("lost", [0, 1])
def test_a_lost_process_is_told_in_one_line(tmp_path, lost):
    (tmp_path / "scene.toml").write_text(SCENE)
    port = free_port()
    pair = [_start(tmp_path, "pair", *_of_two(port, k), samples=4000) for k in (0, 1)]
    for line in pair[0].stderr:
        if "preparing flows" in line:
            break
    time.sleep(5)
    workers = subprocess.run(
        ["pgrep", "-P", str(pair[lost].pid)], capture_output=True, text=True
    ).stdout.split()
    os.kill(int(workers[0]), signal.SIGKILL)
    begin = time.monotonic()
    for process in pair:
        _, error = process.communicate(timeout=60)
        assert process.returncode == 5
        assert "a process was lost" in error.splitlines()[-1]
        assert "Traceback" not in error
    assert time.monotonic() - begin < 60
    assert not (tmp_path / "pair").exists()


@pytest.mark.slow
def test_processes_go_on_where_one_of_them_was_lost(tmp_path):
    """Killed in the middle and started again, two processes come to the weights of one alone."""

    def start(name, *together):
        (tmp_path / name).mkdir(exist_ok=True)
        return subprocess.Popen(
            [sys.executable, str(HERE / "killed_training.py"), str(tmp_path / name), *together],
            env=_environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def two():
        port = free_port()
        return [start("pair", f"localhost:{port}", "2", str(k)) for k in (0, 1)]

    alone = start("alone")
    assert alone.communicate(timeout=500)[0].split()[-1] == "60"
    pair = two()
    for line in pair[0].stdout:
        if line.strip().isdigit() and int(line) >= 5:  # other lines are the transport's
            break
    for process in reversed(pair):
        process.kill()
        process.communicate()
    assert not (tmp_path / "pair" / "weights.npy").exists()
    texts = [process.communicate(timeout=500)[0] for process in two()]
    steps = [int(line) for line in texts[0].splitlines() if line.isdigit()]
    assert 2 < steps[0] < 60, "it started again instead of going on"
    weights = [np.load(tmp_path / name / "weights.npy") for name in ("alone", "pair")]
    assert np.array_equal(*weights)


def test_compute_where_computes_only_if_a_body_wants_it():
    computed = []

    def compute(x):
        jax.debug.callback(lambda: computed.append(1))
        return 2 * x

    def one(wanted, x):
        return compute_where(wanted, lambda: compute(x), x)

    batch = jax.jit(jax.vmap(one))
    x = np.arange(3.0)
    assert np.array_equal(batch(np.zeros(3, bool), x), x)
    jax.effects_barrier()
    assert not computed
    assert np.array_equal(batch(np.array([True, False, True]), x), [0.0, 1.0, 4.0])
    jax.effects_barrier()
    assert computed


@pytest.mark.slow
def test_designers_share_a_memory_and_lose_nothing(tmp_path, tiny_scene):
    """Two that opened the same file, each with an answer that the other has not seen."""
    from surrogate import Flow

    file, flow = tmp_path / "flows.json", Flow(tiny_scene)
    designers = [Designer(flow, memory=file) for _ in range(2)]
    for designer, reynolds in zip(designers, (10.0, 30.0), strict=True):
        designer.design(Problem(tiny_scene, reynolds, within={"aspect": (1.0, 1.2)}))
    asked = {seen.reynolds for seen in Designer(flow, memory=file).memory.observations}
    assert asked == {10.0, 30.0}
    again = designers[0].design(Problem(tiny_scene, 30.0, within={"aspect": (1.0, 1.2)}))
    assert again.flows <= 1


@pytest.mark.slow
def test_processes_answer_a_stream_together_and_lose_nothing(tmp_path):
    file = tmp_path / "flows.json"
    streams = [["2", "9", "31"], ["4", "17", "38"]]
    processes = [
        subprocess.Popen(
            [sys.executable, str(HERE / "designing.py"), str(file), *stream],
            env=_environment(),
            stdout=subprocess.PIPE,
            text=True,
        )
        for stream in streams
    ]
    said = [json.loads(process.communicate(timeout=500)[0]) for process in processes]
    kept = json.loads(file.read_text())["flows"]
    assert len(kept) == sum(answer["flows"] for answer in said)
    assert len({json.dumps(flow[:2]) for flow in kept}) == len(kept)
    assert max(answer["observations"] for answer in said) == len(kept)


def _trained_on(tmp_path, count, bodies, methods):
    """Return the weights by methods on devices; quick to compile where there is one method.

    By ``NPROC`` XLA takes four threads on any machine, as many as the devices of the tests: sums of
    a large product of matrices may be rounded otherwise by another number.
    """
    folder = tmp_path / f"{count}"
    arguments = [str(count), str(folder), str(tmp_path / "checkpoint"), bodies, *methods]
    done = subprocess.run(
        [sys.executable, str(HERE / "trained_on_devices.py"), *arguments],
        env=_environment(quick=len(methods) == 1) | {"NPROC": "4"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    with np.load(folder / "weights.npz") as arrays:
        return dict(arrays)


def _start(tmp_path, out, *arguments, samples=8):
    words = ["--method", "hig", "--samples", str(samples), "--json"]
    words += ["--scene", str(tmp_path / "scene.toml"), "--out", str(tmp_path / out), *arguments]
    return subprocess.Popen(
        [*TRAIN, *words],
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def _of_two(port, process):
    where = f"localhost:{port}"
    return ["--coordinator", where, "--processes", "2", "--process", str(process)]


def _environment(quick=False):
    """Return the environment of a process, quick to compile with the flags of conftest.

    With these flags XLA rounds differently on other numbers of devices; as users have it, it does
    not.
    """
    return os.environ | {"PYTHONPATH": str(ROOT)} | ({} if quick else {"XLA_FLAGS": ""})
