"""Training: every method learns, is deterministic, resumes bit for bit, and refuses bad files."""

import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from surrogate.errors import InvalidInput
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.solver.tangent import Effort
from surrogate.model.store import Surrogate, load_surrogate, save_surrogate
from surrogate.training import loop
from surrogate.training.methods.compliance import kept_compliance, oseen_compliances
from surrogate.training.methods.dp import differentiable_physics
from surrogate.training.methods.hig import half_inverse_gradients
from surrogate.training.presets import METHODS, Plan, preset


@pytest.fixture(scope="module")
def plan(tiny_scene):
    return Plan("sip", tiny_scene, samples=24, held_out=8, iterations=6, report_every=2)


@pytest.fixture(scope="module")
def bench(plan):
    return loop.make_bench(plan)


def initial_error(bench):
    drags = -2 * bench.labels.amplitude[:, 0]
    return float(loop.drag_errors(bench.network, bench.held_out, drags).mean())


@pytest.mark.parametrize(
    ("method", "iterations", "factor"),
    [("sip", 9, 0.4), ("supervised", 9, 0.4), ("hig", 4, 0.4), ("dp", 60, 0.9)],
)
def test_every_method_learns(plan, bench, method, iterations, factor):
    trained = loop.train(
        dataclasses.replace(plan, method=method, iterations=iterations, report_every=1), bench
    )
    before, after = initial_error(bench), trained.history[-1].error_mean
    assert trained.stopped is None
    assert after < factor * before, f"{method}: mean error {before:.3f} -> {after:.3f}"
    work = [point.green_applications for point in trained.history]
    assert work == sorted(work)
    assert work[0] >= bench.physics.count * 12


@pytest.mark.parametrize(
    ("make", "fidelity"),
    [
        (half_inverse_gradients, "exact"),  # lagged and exact are the others' presets
        (half_inverse_gradients, "frozen"),
        (differentiable_physics, "lagged"),
        (differentiable_physics, "frozen"),
    ],
)
def test_every_fidelity_of_the_physics_learns(plan, bench, make, fidelity):
    """Frozen physics costs one body flow a sample and then nothing."""
    steps = {half_inverse_gradients: 4, differentiable_physics: 40}[make]
    plan = dataclasses.replace(plan, iterations=steps, report_every=1)
    method = make(fidelity=fidelity, batch=24)
    trained = loop.train(plan, bench, method=method)
    assert trained.history[-1].error_mean < 0.9 * initial_error(bench)
    work = [point.green_applications for point in trained.history]
    if fidelity == "frozen":
        assert work[-1] == work[0]
    else:
        assert work[-1] > work[0]


def test_a_compliance_is_solved_again_only_where_the_traction_has_moved(bench):
    kept = jax.tree.map(lambda leaf: leaf[0], oseen_compliances(bench.physics))
    domain, case = bench.physics.domain, bench.physics.case(jnp.array(0))
    velocity, seat = (leaf[0] for leaf in bench.physics.oseen)
    near, far = (
        kept_compliance(domain, case, FlowState(velocity, factor * seat), kept, 0.1, Effort())
        for factor in (1.05, 1.2)
    )
    assert int(near[1].products) == 0
    assert np.array_equal(near[0].matrix, kept.matrix)
    assert int(far[1].products) > len(seat)
    assert np.array_equal(far[0].seat, 1.2 * seat)
    always, _ = kept_compliance(domain, case, FlowState(velocity, seat), kept, 0.0, Effort())
    assert not np.array_equal(always.matrix, kept.matrix)


def test_same_seed_same_weights_and_another_seed_others(plan, bench):
    a, b = loop.train(plan, bench), loop.train(plan, bench)
    assert np.array_equal(a.network.weights, b.network.weights)
    other = loop.make_bench(dataclasses.replace(plan, seed=1))
    assert not np.array_equal(other.network.weights, bench.network.weights)


class Killed(BaseException):
    """Stands for a power cut."""


@pytest.mark.parametrize("method", METHODS)
def test_interrupted_and_resumed_is_bit_identical(plan, bench, method, tmp_path):
    plan = dataclasses.replace(plan, method=method)
    whole = loop.train(plan, bench)
    checkpoint = tmp_path / "checkpoint.npz"

    def interrupt(point, done):
        if point.iteration == 4:
            raise Killed

    with pytest.raises(Killed):
        loop.train(plan, bench, checkpoint, interrupt, checkpoint_every_s=0.0)
    assert checkpoint.exists()
    resumed = loop.train(plan, bench, checkpoint)
    assert np.array_equal(whole.network.weights, resumed.network.weights)
    assert [p.iteration for p in resumed.history] == [p.iteration for p in whole.history]
    assert resumed.history[-1].green_applications == whole.history[-1].green_applications
    assert not checkpoint.exists()


def test_damaged_and_foreign_checkpoints_are_refused(plan, bench, tmp_path):
    checkpoint = tmp_path / "checkpoint.npz"
    checkpoint.write_bytes(b"not a checkpoint")
    with pytest.raises(InvalidInput, match="damaged"):
        loop.train(plan, bench, checkpoint)
    checkpoint.unlink()

    def interrupt(point, done):
        if point.iteration == 4:
            raise Killed

    with pytest.raises(Killed):
        loop.train(plan, bench, checkpoint, interrupt, checkpoint_every_s=0.0)
    with pytest.raises(InvalidInput, match="another training"):
        loop.train(dataclasses.replace(plan, iterations=7), bench, checkpoint)


def test_a_training_that_blows_up_keeps_the_last_good_weights(plan, bench, monkeypatch):
    method = plan.make_method()

    def poisoned(network, state, physics, batch, done):
        network, state, spent = method.update(network, state, physics, batch, done)
        factor = jnp.where(done > 0.6, jnp.nan, 1.0)
        return network.with_weights(network.weights * factor), state, spent

    monkeypatch.setattr(Plan, "make_method", lambda self: method._replace(update=poisoned))
    trained = loop.train(plan, bench)
    assert "blew up" in trained.stopped
    assert np.all(np.isfinite(trained.network.weights))
    assert trained.history[-1].iteration == 4


def test_a_training_that_explodes_without_nan_is_stopped_too(plan, bench, monkeypatch):
    method = plan.make_method()

    def exploding(network, state, physics, batch, done):
        network, state, spent = method.update(network, state, physics, batch, done)
        return network.with_weights(network.weights * jnp.where(done > 0.6, 1e6, 1.0)), state, spent

    monkeypatch.setattr(Plan, "make_method", lambda self: method._replace(update=exploding))
    trained = loop.train(plan, bench)
    assert "blew up" in trained.stopped
    assert trained.history[-1].iteration == 4
    assert trained.history[-1].error_mean < 1


def test_matrix_free_hig_trains_as_the_dense_one(plan, bench):
    plan = dataclasses.replace(plan, iterations=4)
    dense, free = (
        loop.train(plan, bench, method=half_inverse_gradients(batch=8, tau=1e-2, lanczos=vectors))
        for vectors in (None, 128)
    )
    assert np.allclose(dense.network.weights, free.network.weights, atol=1e-4)


def test_surrogate_round_trip_and_damage(plan, bench, tmp_path):
    record = {"method": "sip", "drag_error_mean": 0.5}
    surrogate = Surrogate(bench.network, plan.scene, record)
    folder = tmp_path / "surrogate"
    save_surrogate(folder, surrogate)
    save_surrogate(folder, surrogate)  # replaces its own kind
    loaded = load_surrogate(folder)
    halved = loaded.network.with_weights(loaded.network.weights / 2)
    save_surrogate(tmp_path / "halved", dataclasses.replace(loaded, network=halved))
    weights = load_surrogate(tmp_path / "halved").network.weights
    assert np.array_equal(weights, halved.weights)
    body = jnp.array([2.0, 0.1, 0, 0])
    assert float(loaded.drag(body, 10.0)) == float(surrogate.drag(body, 10.0))
    assert loaded.scene == plan.scene
    assert loaded.record["method"] == "sip"

    weights = folder / "weights.npz"
    intact = weights.read_bytes()
    weights.write_bytes(intact[:-7] + b"damaged")
    with pytest.raises(InvalidInput, match="damaged"):
        load_surrogate(folder)
    weights.unlink()
    with pytest.raises(InvalidInput, match="damaged"):
        load_surrogate(folder)
    weights.write_bytes(intact)
    record = json.loads((folder / "surrogate.json").read_text())
    (folder / "surrogate.json").write_text(json.dumps({**record, "format": 99}))
    with pytest.raises(InvalidInput, match="format 99"):
        load_surrogate(folder)
    with pytest.raises(InvalidInput, match="no such folder"):
        load_surrogate(tmp_path / "nowhere")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("do not delete")
    with pytest.raises(InvalidInput, match="not empty"):
        save_surrogate(tmp_path / "mine", surrogate)


def test_distance_beyond_the_trained_range(plan, bench):
    surrogate = Surrogate(bench.network, plan.scene, {})
    assert surrogate.beyond(np.array([2.0, 0.3, 0.0, 0.0]), 40.0) == {}
    outside = surrogate.beyond(np.array([7.0, -0.6, 0.0, 0.0]), 1 / 40)
    assert outside == pytest.approx({"aspect": 0.5, "beta2": 0.5, "log Re": 1.0})


def test_presets_name_what_is_wrong():
    with pytest.raises(InvalidInput, match="one of dp, sip, hig, supervised"):
        preset("magic", "quick")
    with pytest.raises(InvalidInput, match="budget"):
        preset("dp", "quick", budget_s=-1)
