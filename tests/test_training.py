"""Training: every method learns, is deterministic, resumes bit for bit, and refuses bad files."""

import dataclasses
import functools

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import Family, InvalidInput, load, train
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.training import train as training
from surrogate.training.loop import drag_errors, make_setup, run_training
from surrogate.training.methods.hig import half_inverse_gradients
from surrogate.training.methods.targets import evaluate_by_inversion, full_inversion
from surrogate.training.plan import METHODS, Plan
from surrogate.training.samples import held_out_samples, training_samples
from surrogate.training.step import compile_step, first_state
from surrogate.training.train import carry_out, checkpoint_of


@pytest.fixture(scope="module")
def plan(tiny_scene):
    return Plan("sip", tiny_scene, samples=24, held_out=8, iterations=6, report_every=2)


@pytest.fixture(scope="module")
def bench(plan):
    return make_setup(plan)


@pytest.fixture(scope="module")
def trained(plan, bench):
    """The plan carried out by any of the methods, once."""

    @functools.cache
    def by(method):
        return run_training(dataclasses.replace(plan, method=method), bench)

    return by


def initial_error(bench):
    return float(drag_errors(bench.network, bench.held_out, bench.labels.drag).mean())


@pytest.mark.parametrize(
    ("method", "iterations", "factor"),
    [("sip", 9, 0.4), ("supervised", 9, 0.4), ("hig", 4, 0.4), ("dp", 60, 0.4)],
)
def test_every_method_learns(plan, bench, method, iterations, factor):
    plan = dataclasses.replace(plan, method=method, iterations=iterations, report_every=1)
    history = run_training(plan, bench).history
    before, after = initial_error(bench), history[-1].error_mean
    assert after < factor * before, f"{method}: mean error {before:.3f} -> {after:.3f}"
    work = [point.green_applications for point in history]
    assert work == sorted(work)
    assert work[0] >= bench.physics.count * 12


@pytest.mark.parametrize(
    ("method", "steps"), [("dp", 60), ("sip", 9), ("hig", 4), ("supervised", 9)]
)
def test_every_method_learns_as_it_was_published(plan, bench, method, steps):
    changes = {"iterations": steps, "report_every": 1, "published": True}
    history = run_training(dataclasses.replace(plan, method=method, **changes), bench).history
    assert history[-1].error_mean < 0.9 * initial_error(bench)
    assert history[-1].green_applications > history[0].green_applications


def test_samples_that_have_told_all_are_left_in_peace(plan, bench):
    batch, physics = np.arange(24), bench.physics
    method = half_inverse_gradients(24)
    start = first_state(method, bench.network, physics, bench.oseen)
    step = compile_step(method, start, physics, batch)
    assert start.lessons.asks(batch)
    now, spent, first = step(start, batch, 0.0)
    assert spent.products > 0
    assert not now.lessons.asks(batch)
    now, spent, second = step._replace(fetch=None, visit=None, give_back=None)(now, batch, 0.0)
    assert spent.products == 0
    assert second < 0.5 * first


def test_a_flow_that_is_not_found_is_not_sought_again(plan, bench):
    """Nothing else would come of it; the network learns from the others, here from none."""
    batch, hopeless = np.arange(24), NewtonSettings(1e-12, 1, 1)
    visit = evaluate_by_inversion(full_inversion(hopeless, slopes=True))
    method = half_inverse_gradients(24)._replace(visit=visit)
    start = first_state(method, bench.network, bench.physics, bench.oseen)
    step = compile_step(method, start, bench.physics, batch)
    now, spent, _ = step(start, batch, 0.0)
    assert spent.failed == 24
    assert not np.any(now.lessons.known)
    assert not now.lessons.asks(batch)
    again, spent, loss = step(now, batch, 0.0)
    assert spent.products == loss == 0
    assert np.array_equal(again.network.weights, bench.network.weights)


def test_same_seed_same_weights_and_another_seed_others(plan, bench, trained):
    again = run_training(plan, bench)
    assert trained("sip").stopped is None
    assert np.array_equal(trained("sip").network.weights, again.network.weights)
    other = make_setup(dataclasses.replace(plan, seed=1))
    assert not np.array_equal(other.network.weights, bench.network.weights)


@pytest.mark.parametrize("seed", [0, 1, 987])
def test_held_out_bodies_are_unseen(tiny_scene, seed):
    """No body that a training of the seed learns from is among those it is judged by."""
    seen, unseen = (
        {tuple(row) for row in np.column_stack(draw(tiny_scene, seed, 64)).tolist()}
        for draw in (training_samples, held_out_samples)
    )
    assert len(seen) == len(unseen) == 64
    assert not seen & unseen
    first = training_samples(tiny_scene, seed, 64).head(16)
    assert first.count == 16
    assert {tuple(row) for row in np.column_stack(first).tolist()} <= seen


class Killed(BaseException):
    """Stands for a power cut."""


def interrupt(point, done):
    if point.iteration == 4:
        raise Killed


@pytest.mark.parametrize("method", METHODS)
def test_interrupted_and_resumed_is_bit_identical(plan, bench, trained, method, tmp_path):
    plan = dataclasses.replace(plan, method=method)
    whole = trained(method)
    checkpoint = tmp_path / "checkpoint"
    with pytest.raises(Killed):
        run_training(plan, bench, checkpoint, interrupt, checkpoint_every_s=0.0)
    assert checkpoint.exists()
    resumed = run_training(plan, bench, checkpoint)
    assert np.array_equal(whole.network.weights, resumed.network.weights)
    assert [p.iteration for p in resumed.history] == [p.iteration for p in whole.history]
    assert resumed.history[-1].green_applications == whole.history[-1].green_applications


def test_an_interrupted_training_to_a_folder_goes_on(plan, trained, tmp_path, monkeypatch):
    """The checkpoint lies beside the folder until the surrogate is saved in it."""
    out = tmp_path / "out" / "surrogate"

    def killed(plan, bench, checkpoint, report, method):
        return run_training(plan, bench, checkpoint, interrupt, checkpoint_every_s=0.0)

    with monkeypatch.context() as patch:
        patch.setattr(training, "run_training", killed)
        with pytest.raises(Killed):
            carry_out(plan, out, progress=False)
    assert checkpoint_of(out).is_file()
    assert checkpoint_of(out).parent == out.parent
    assert not list(out.glob("*"))
    steps = []
    monkeypatch.setattr(
        training,
        "run_training",
        lambda plan, bench, checkpoint, report, method: run_training(
            plan, bench, checkpoint, lambda point, done: steps.append(point.iteration)
        ),
    )
    surrogate = carry_out(plan, out, progress=False)
    assert steps == [4, 6], "it started again instead of going on"
    assert np.array_equal(surrogate.network.weights, trained("sip").network.weights)
    assert not checkpoint_of(out).exists()
    assert np.array_equal(load(out).network.weights, surrogate.network.weights)


def test_damaged_and_foreign_checkpoints_are_refused(plan, bench, tmp_path):
    checkpoint = tmp_path / "checkpoint"
    for words in (b"not a checkpoint", b"[" * 100_000, b""):
        checkpoint.write_bytes(words)
        with pytest.raises(InvalidInput, match="damaged"):
            run_training(plan, bench, checkpoint)
    checkpoint.unlink()
    with pytest.raises(Killed):
        run_training(plan, bench, checkpoint, interrupt, checkpoint_every_s=0.0)
    with pytest.raises(InvalidInput, match="another training"):
        run_training(dataclasses.replace(plan, iterations=7), bench, checkpoint)
    intact = checkpoint.read_bytes()
    for damage in (intact[:-100], intact + b"more", intact[:200]):
        checkpoint.write_bytes(damage)
        with pytest.raises(InvalidInput, match="damaged"):
            run_training(plan, bench, checkpoint)


@pytest.mark.parametrize("factor", [jnp.nan, 1e6], ids=["nan", "exploded"])
def test_a_training_that_blows_up_keeps_the_last_good_weights(plan, bench, factor):
    method = plan.make_method()

    def poisoned(*arguments):
        network, memory, loss = method.learn(*arguments)
        factors = jnp.where(arguments[-1] > 0.6, factor, 1.0)
        return network.with_weights(network.weights * factors), memory, loss

    trained = run_training(plan, bench, method=method._replace(learn=poisoned))
    assert "blew up" in trained.stopped
    assert np.all(np.isfinite(trained.network.weights))
    assert trained.history[-1].iteration == 4
    assert trained.history[-1].error_mean < 1


def test_matrix_free_hig_trains_as_the_dense_one(plan, bench):
    plan = dataclasses.replace(plan, iterations=4)
    dense, free = (
        run_training(plan, bench, method=half_inverse_gradients(8, tau=1e-2, vectors=vectors))
        for vectors in (None, 128)
    )
    assert np.allclose(dense.network.weights, free.network.weights, atol=1e-4)


def test_train_saves_what_it_returns(tiny_scene, tmp_path, capfd):
    out = tmp_path / "deep" / "folder"
    options = {"samples": 24, "preset": "quick", "budget_seconds": 1, "seed": 3}
    surrogate = train(tiny_scene, "hig", out=out, **options)
    assert "preparing flows: 0% 24 bodies, 48 held out" in capfd.readouterr().err
    loaded = load(out)
    body = np.array([2.0, 0.1, 0.0, 0.0])
    assert float(loaded.drag(body, 10.0)) == float(surrogate.drag(body, 10.0))
    assert loaded.scene == tiny_scene
    for key, value in {"method": "hig", "samples": 24, "seed": 3, "held_out": 48}.items():
        assert loaded.recorded(key) == value
    assert 0 < loaded.recorded("drag_error_mean") < loaded.recorded("drag_error_max")
    assert sorted(path.name for path in out.iterdir()) == ["surrogate.json", "weights.eqx"]


def test_a_family_of_eight_parameters_trains(tmp_path, tiny_scene):
    betas = {f"beta{k}": (-0.1 / k, 0.1 / k) for k in range(2, 9)}
    scene = dataclasses.replace(tiny_scene, family=Family(aspect=(1, 3), **betas))
    plan = Plan("sip", scene, samples=16, held_out=4, iterations=12, report_every=1)
    surrogate = carry_out(plan, tmp_path / "eight", progress=False)
    first = surrogate.recorded("history")[0][3]  # mean error against the flow
    assert surrogate.recorded("drag_error_mean") < 0.5 * first
    assert surrogate.recorded("drag_error_mean") < 0.05
    body = np.array([2.0, 0.03, -0.02, 0.01, 0.01, -0.01, 0.005, -0.005])
    drag = float(load(tmp_path / "eight").drag(body, 10.0))
    assert drag == float(surrogate.drag(body, 10.0))
    assert drag == pytest.approx(float(load("pretrained").drag([2.0, 0, 0, 0], 10.0)), rel=0.2)
    with pytest.raises(InvalidInput, match="8 parameters are needed"):
        surrogate.drag(body[:4], 10.0)
