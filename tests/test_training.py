"""Training: every method reduces the error, is deterministic, resumes exactly, checks its files."""

import dataclasses
import functools
import shutil

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import Family, Flow, InvalidInput, NotConverged, devices, load, partition, train
from surrogate.flow.solver.newton import NewtonSettings
from surrogate.scene.samples import held_out_samples, training_samples
from surrogate.training import train as training
from surrogate.training.checkpoint import save_checkpoint
from surrogate.training.held_out import solve_held_out
from surrogate.training.loop import load_errors, run_training
from surrogate.training.methods.hig import HalfInverseGradients
from surrogate.training.methods.sip import ScaleInvariantPhysics
from surrogate.training.plan import MAKERS, METHODS, Plan, make_plan
from surrogate.training.record import surrogate_of
from surrogate.training.setup import make_setup
from surrogate.training.step import compile_step, first_state
from surrogate.training.train import checkpoint_path, train_all, train_plan


@pytest.fixture(scope="module")
def plan(tiny_scene):
    return Plan("sip", tiny_scene, samples=16, held_out=8, iterations=16, report_every=2)


@pytest.fixture(scope="module")
def setup(plan):
    return make_setup(plan)


@pytest.fixture(scope="module")
def trained(plan, setup):
    """The plan carried out by any of the methods, once."""

    @functools.cache
    def by(method):
        return run_training(dataclasses.replace(plan, method=method), setup)

    return by


def initial_error(setup):
    return float(load_errors(setup.network, setup.held_out, setup.labels.loads)[:, 0].mean())


@pytest.mark.parametrize(
    ("method", "iterations", "factor"),
    [
        ("sip", 9, 0.4),
        pytest.param("hig", 4, 0.4, marks=pytest.mark.slow),
        pytest.param("supervised", 9, 0.4, marks=pytest.mark.slow),
        pytest.param("dp", 60, 0.4, marks=pytest.mark.slow),
    ],
)
def test_every_method_learns(plan, setup, method, iterations, factor):
    plan = dataclasses.replace(plan, method=method, iterations=iterations, report_every=1)
    history = run_training(plan, setup).history
    before, after = initial_error(setup), history[-1].error_mean
    assert after < factor * before, f"{method}: mean error {before:.3f} -> {after:.3f}"
    work = [point.green_applications for point in history]
    assert work == sorted(work)
    assert work[0] >= setup.physics.count * 12


@pytest.mark.parametrize(
    ("method", "steps"),
    [
        pytest.param("dp", 60, marks=pytest.mark.slow),
        ("sip", 9),
        ("hig", 4),
        pytest.param("supervised", 9, marks=pytest.mark.slow),
    ],
)
def test_every_method_learns_as_it_was_published(plan, setup, method, steps):
    changes = {"iterations": steps, "report_every": 1, "published": True}
    history = run_training(dataclasses.replace(plan, method=method, **changes), setup).history
    assert history[-1].error_mean < 0.9 * initial_error(setup)
    assert history[-1].green_applications > history[0].green_applications


def one_step(step, state, batch):
    """The state after a step, its evaluations' costs, and its loss."""
    parts = list(step.evaluations(state, batch, np.zeros(len(batch), bool)))
    if parts:
        state = parts[-1][0]
    return *step.updated(state, batch, 0.0), [cost for *_, cost in parts]


def test_converged_labels_are_not_evaluated_again(plan, setup):
    batch, physics = np.arange(plan.samples), setup.physics
    method = HalfInverseGradients(plan.samples)
    start = first_state(method, setup.network, physics)
    step = compile_step(method, start, physics, batch)
    assert np.all(start.labels.pending(batch))
    state, first, costs = one_step(step, start, batch)
    assert sum(cost.convolutions for cost in costs) > 0
    assert not np.any(state.labels.pending(batch))
    state, second, costs = one_step(step, state, batch)
    assert not costs
    assert second < 0.5 * first


@pytest.mark.slow
def test_a_flow_that_is_not_found_is_not_solved_again(plan, setup):
    """The network is trained on the other samples, here on none."""
    batch, hopeless = np.arange(plan.samples), NewtonSettings(1e-12, 1, 1)
    method = HalfInverseGradients(plan.samples, newton=hopeless)
    start = first_state(method, setup.network, setup.physics)
    step = compile_step(method, start, setup.physics, batch)
    state, _, costs = one_step(step, start, batch)
    assert sum(cost.failed for cost in costs) == plan.samples
    assert not np.any(state.labels.valid)
    assert not np.any(state.labels.pending(batch))
    again, loss, costs = one_step(step, state, batch)
    assert not costs
    assert loss == 0
    assert np.array_equal(again.network.weights, setup.network.weights)


def test_methods_that_ask_for_the_same_flows_share_a_program():
    """Methods at their best; programs are kept by evaluator."""
    evaluators = {method: MAKERS[method]().evaluator for method in METHODS}
    assert evaluators["hig"] == evaluators["supervised"]
    assert evaluators["sip"] == evaluators["dp"]
    assert len(set(evaluators.values())) == 2


def test_same_seed_same_weights_and_another_seed_others(plan, setup, trained):
    again = run_training(plan, setup)
    assert trained("sip").stopped is None
    assert np.array_equal(trained("sip").network.weights, again.network.weights)
    other = make_setup(dataclasses.replace(plan, seed=1))
    assert not np.array_equal(other.network.weights, setup.network.weights)


@pytest.mark.parametrize("seed", [0, 1, 987])
def test_held_out_bodies_are_unseen(tiny_scene, seed):
    """No training sample of a seed is among its held-out samples."""
    seen, unseen = (
        {tuple(row) for row in np.column_stack(draw(tiny_scene, seed, 64)).tolist()}
        for draw in (training_samples, held_out_samples)
    )
    assert len(seen) == len(unseen) == 64
    assert not seen & unseen
    first = training_samples(tiny_scene, seed, 64).head(16)
    assert first.count == 16
    assert {tuple(row) for row in np.column_stack(first).tolist()} <= seen


def failing(monkeypatch, count):
    """Let the first ``count`` held-out flows fail."""
    solve_all = Flow.solve_all

    def patched(*arguments, **options):
        found = solve_all(*arguments, **options)
        fails = np.arange(len(found.converged)) < count
        amplitude = np.where(fails[:, None], np.nan, found.amplitude)
        return found._replace(converged=found.converged & ~fails, amplitude=amplitude)

    monkeypatch.setattr(Flow, "solve_all", patched)


def test_held_out_flows_that_fail_are_left_out_and_counted(plan, setup, trained, monkeypatch):
    failing(monkeypatch, 1)
    fewer = make_setup(plan)
    assert fewer.held_out_failed == 1
    assert np.array_equal(fewer.held_out.parameters, setup.held_out.parameters[1:])
    assert np.array_equal(fewer.labels.drag, setup.labels.drag[1:])
    result = run_training(plan, fewer)
    assert np.array_equal(result.network.weights, trained("sip").network.weights)
    record = surrogate_of(plan, result, fewer).record
    assert (record["held_out"], record["held_out_failed"]) == (8, 1)
    assert 0 < record["drag_error_mean"] < 1


@pytest.mark.parametrize("count", [2, 8])
def test_a_training_with_too_few_held_out_flows_is_refused(plan, monkeypatch, count):
    failing(monkeypatch, count)
    with pytest.raises(NotConverged, match=f"{count} of 8 held-out flows did not converge"):
        make_setup(plan)


@pytest.mark.slow
def test_methods_say_what_the_network_is_trained_for(plan, setup, trained):
    """At their best SIP, HIG and regression train the drag alone: other modes keep their heads."""

    def heads(network):
        return network.layers[-1].weight[1:]

    for method in METHODS:
        network = trained(method).network
        kept = np.array_equal(heads(network), heads(setup.network))
        made = dataclasses.replace(plan, method=method)
        trained_for = surrogate_of(made, trained(method), setup).record["trained_for"]
        assert trained_for == ("drag" if kept else "traction")
        assert kept == (method != "dp")
        assert make_plan(None, method, published=True).make_method().trains_traction


class Killed(BaseException):
    """Stands for a power cut."""


def interrupt(point, done):
    if point.iteration == 4:
        raise Killed


@pytest.mark.parametrize(
    "method",
    [m if m == "sip" else pytest.param(m, marks=pytest.mark.slow) for m in METHODS],
)
def test_interrupted_and_resumed_is_bit_identical(plan, setup, trained, method, tmp_path):
    plan = dataclasses.replace(plan, method=method)
    whole = trained(method)
    checkpoint = tmp_path / "checkpoint"
    with pytest.raises(Killed):
        run_training(plan, setup, checkpoint, interrupt, checkpoint_every_s=0.0)
    assert checkpoint.exists()
    resumed = run_training(plan, setup, checkpoint)
    assert np.array_equal(whole.network.weights, resumed.network.weights)
    assert [p.iteration for p in resumed.history] == [p.iteration for p in whole.history]
    assert resumed.history[-1].green_applications == whole.history[-1].green_applications


def die_after_saving(iteration):
    """A function that writes checkpoints, and is killed after that of a step of this number."""

    def save_and_die(path, plan, state, partition):
        save_checkpoint(path, plan, state, partition)
        if state.iteration == iteration:
            raise Killed

    return save_and_die


@pytest.mark.parametrize("method", ["hig", "sip"])
def test_a_training_by_time_makes_the_step_that_was_interrupted(
    plan, setup, method, tmp_path, monkeypatch
):
    """As one that ran through, even if its flows took all of the time before the first report."""
    plan = dataclasses.replace(plan, method=method, budget_s=1e-9)
    run = functools.partial(run_training, plan, setup, checkpoint_every_s=0.0)
    with monkeypatch.context() as patch:
        patch.setattr("surrogate.training.checkpoint.save_checkpoint", die_after_saving(0))
        with pytest.raises(Killed):
            run(tmp_path / "checkpoint")
    resumed = run(tmp_path / "checkpoint")
    assert [point.iteration for point in resumed.history] == [1]
    assert np.array_equal(resumed.network.weights, run(None).network.weights)


def test_the_result_counts_labels_that_have_not_converged(plan, setup, trained):
    """The first step evaluates half of the samples, eight epochs solve all of their flows."""
    assert plan.make_method().batch == plan.samples / 2
    cut_short = run_training(dataclasses.replace(plan, budget_s=1e-9), setup)
    assert len(cut_short.history) == 1
    assert plan.samples / 2 <= cut_short.unsolved <= plan.samples
    assert trained("sip").unsolved == 0


@pytest.mark.slow
def test_interrupted_between_the_flows_of_a_step(plan, setup, tmp_path, monkeypatch):
    """Flows that a checkpoint has are not solved again."""
    monkeypatch.setattr(partition, "CHUNK", 8)
    plan = dataclasses.replace(plan, method="hig")
    counts = []

    def interrupt_at_the_end(done, labels):
        counts.append((int(np.sum(labels.converged)), labels.converged.size))
        if counts == [(8, 16), (16, 16)]:
            raise Killed

    def run(path):
        return run_training(
            plan, setup, path, checkpoint_every_s=0.0, evaluating=interrupt_at_the_end
        )

    with pytest.raises(Killed):
        run(tmp_path / "checkpoint")
    resumed = run(tmp_path / "checkpoint")
    assert counts[2:] == [(16, 16)]
    counts.append("whole")
    whole = run(None)
    assert np.array_equal(whole.network.weights, resumed.network.weights)
    assert whole.history[-1].green_applications == resumed.history[-1].green_applications


def test_an_interrupted_training_to_a_folder_goes_on(plan, trained, tmp_path, monkeypatch):
    """The checkpoint lies beside the folder until the surrogate is saved in it."""
    out = tmp_path / "out" / "surrogate"

    def killed(plan, setup, checkpoint, report, **how):
        return run_training(plan, setup, checkpoint, interrupt, checkpoint_every_s=0.0)

    with monkeypatch.context() as patch:
        patch.setattr(training, "run_training", killed)
        with pytest.raises(Killed):
            train_plan(plan, out, progress=False)
    assert checkpoint_path(out).is_file()
    assert checkpoint_path(out).parent == out.parent
    assert not list(out.glob("*"))
    steps = []
    monkeypatch.setattr(
        training,
        "run_training",
        lambda plan, setup, checkpoint, report, **how: run_training(
            plan, setup, checkpoint, lambda point, done: steps.append(point.iteration)
        ),
    )
    surrogate = train_plan(plan, out, progress=False)
    assert steps == [*range(4, 17, 2)], "it started again instead of going on"
    assert np.array_equal(surrogate.network.weights, trained("sip").network.weights)
    assert not checkpoint_path(out).exists()
    assert np.array_equal(load(out).network.weights, surrogate.network.weights)


def refuse_to_work(*arguments, **options):
    raise AssertionError("this is done already")


@pytest.fixture(scope="module")
def finished(plan, setup, tmp_path_factory):
    out = tmp_path_factory.mktemp("finished") / "sip"
    return train_plan(plan, out, progress=False, setup=setup), out


@pytest.fixture
def stored(finished, tmp_path):
    """A finished training, and a copy of its folder."""
    surrogate, out = finished
    return surrogate, shutil.copytree(out, tmp_path / "stored")


def test_the_same_training_is_not_repeated(plan, stored, monkeypatch, capfd):
    surrogate, out = stored
    (out / "notes.txt").write_text("mine")
    files = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in out.iterdir()}
    for name in ("make_setup", "run_training", "save"):
        monkeypatch.setattr(training, name, refuse_to_work)
    again = train_plan(plan, out)
    assert np.array_equal(again.network.weights, surrogate.network.weights)
    assert surrogate.record.items() <= again.record.items()
    assert f"already done in {out}" in capfd.readouterr().err
    assert files == {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in out.iterdir()}


def test_another_training_into_the_folder_of_one_must_be_asked_for(
    plan, stored, setup, monkeypatch
):
    surrogate, out = stored
    other = dataclasses.replace(plan, seed=plan.seed + 1)
    with monkeypatch.context() as patch:
        patch.setattr(training, "make_setup", refuse_to_work)
        words = rf"holds another training \(seed {plan.seed}, not {other.seed}\); .*--overwrite"
        with pytest.raises(InvalidInput, match=words):
            train_plan(other, out, progress=False)
    assert np.array_equal(load(out).network.weights, surrogate.network.weights)
    (out / "notes.txt").write_text("mine")
    replaced = train_plan(other, out, progress=False, setup=setup, overwrite=True)
    assert load(out).recorded("seed") == other.seed
    assert not np.array_equal(replaced.network.weights, surrogate.network.weights)
    assert (out / "notes.txt").read_text() == "mine"
    assert train_plan(other, out, progress=False).recorded("seed") == other.seed


def test_more_held_out_bodies_measure_a_finished_training_anew(plan, stored, monkeypatch):
    surrogate, out = stored
    monkeypatch.setattr("surrogate.training.held_out.AT_ONCE", plan.held_out)  # in two parts
    more = dataclasses.replace(plan, held_out=2 * plan.held_out)
    monkeypatch.setattr(training, "run_training", refuse_to_work)
    again = train_plan(more, out, progress=False)
    assert np.array_equal(again.network.weights, surrogate.network.weights)
    assert again.recorded("held_out") == more.held_out
    held_out, labels = solve_held_out(Flow(more.scene), more, devices.choose_devices())
    errors = load_errors(again.network, held_out, labels.loads)[:, 0]
    for found in (again, load(out)):
        assert found.recorded("drag_error_max") == pytest.approx(float(errors.max()), rel=1e-9)
        assert found.recorded("drag_error_mean") == pytest.approx(float(errors.mean()), rel=1e-9)
    assert again.recorded("drag_error_mean") != surrogate.recorded("drag_error_mean")
    assert train_plan(more, out, progress=False).record.items() >= again.record.items()
    assert train_plan(plan, out, progress=False).recorded("drag_error_mean") == pytest.approx(
        surrogate.recorded("drag_error_mean"), rel=1e-9
    )


def test_to_overwrite_repeats_the_same_training_too(plan, stored, setup, monkeypatch):
    surrogate, out = stored
    steps = []

    def counted(*arguments, **options):
        steps.append(1)
        return run_training(*arguments, **options)

    monkeypatch.setattr(training, "run_training", counted)
    again = train_plan(plan, out, progress=False, setup=setup, overwrite=True)
    assert steps == [1]
    assert np.array_equal(again.network.weights, surrogate.network.weights)


def test_a_folder_left_half_written_is_trained_again(plan, stored, setup):
    """The process was killed between the record, which is written first, and the weights."""
    surrogate, out = stored
    (out / "weights.eqx").unlink()
    again = train_plan(plan, out, progress=False, setup=setup)
    assert np.array_equal(again.network.weights, surrogate.network.weights)
    assert np.array_equal(load(out).network.weights, surrogate.network.weights)


def test_checkpoints_of_interrupted_trainings(plan, setup, tmp_path, monkeypatch):
    """One of another training is kept before any work, and removed where that is asked for."""
    out = tmp_path / "surrogate"
    place = checkpoint_path(out)
    with pytest.raises(Killed):
        run_training(plan, setup, place, interrupt, checkpoint_every_s=0.0)
    other, intact = dataclasses.replace(plan, seed=plan.seed + 1), place.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(training, "make_setup", refuse_to_work)
        with pytest.raises(InvalidInput, match=r"interrupted \(seed .*--overwrite"):
            train_plan(other, out, progress=False)
        place.write_bytes(b"a file of the user")
        for overwrite in (False, True):
            with pytest.raises(InvalidInput, match=r"damaged.*remove it"):
                train_plan(other, out, progress=False, overwrite=overwrite)
        assert place.read_bytes() == b"a file of the user"
    place.write_bytes(intact)
    train_plan(other, out, progress=False, setup=setup, overwrite=True)
    assert not place.exists()
    place.write_bytes(intact)  # of another training that was interrupted later: stays
    assert train_plan(other, out, progress=False).recorded("seed") == other.seed
    assert place.read_bytes() == intact


def test_all_trainings_of_a_payoff_are_checked_before_any_work(
    plan, setup, finished, tmp_path, monkeypatch
):
    plans = {"first": plan, "second": dataclasses.replace(plan, seed=5)}
    shutil.copytree(finished[1], tmp_path / "second")
    monkeypatch.setattr(training, "make_setup", refuse_to_work)
    with pytest.raises(InvalidInput, match="second: holds another training"):
        train_all(plans, tmp_path)
    monkeypatch.setattr(training, "make_setup", lambda *_: setup)
    assert list(train_all(plans, tmp_path, overwrite=True)) == list(plans)
    monkeypatch.setattr(training, "run_training", refuse_to_work)
    assert train_all(plans, tmp_path, overwrite=True)["second"].recorded("seed") == 5


def test_training_warns_of_a_large_error(plan, setup, monkeypatch):
    rough = dataclasses.replace(plan.scene.fidelity, tolerance=1e-6)
    scene = dataclasses.replace(plan.scene, fidelity=rough)
    monkeypatch.setattr(training, "make_setup", lambda *_: setup)
    monkeypatch.setattr(training, "make_plan", lambda *_: dataclasses.replace(plan, scene=scene))
    with pytest.warns(UserWarning, match="training by sip: its loads are inaccurate"):
        train(scene, "sip", progress=False)


def test_damaged_and_foreign_checkpoints_are_refused(plan, setup, tmp_path):
    checkpoint = tmp_path / "checkpoint"
    for words in (b"not a checkpoint", b"[" * 100_000, b""):
        checkpoint.write_bytes(words)
        with pytest.raises(InvalidInput, match=r"damaged.*remove it"):
            run_training(plan, setup, checkpoint)
    checkpoint.unlink()
    with pytest.raises(Killed):
        run_training(plan, setup, checkpoint, interrupt, checkpoint_every_s=0.0)
    with pytest.raises(InvalidInput, match="another training"):
        run_training(dataclasses.replace(plan, iterations=7), setup, checkpoint)
    intact = checkpoint.read_bytes()
    arrays = intact.index(b"\n")
    ends = [intact.index(one, arrays) for one in (b"}", b"<f8")]
    changed = [intact[:at] + b"(" + intact[at + 1 :] for at in (*ends, len(intact) - 90)]
    for damage in (intact[:-100], intact + b"more", intact[:200], *changed):
        checkpoint.write_bytes(damage)
        with pytest.raises(InvalidInput, match=r"damaged.*remove it"):
            run_training(plan, setup, checkpoint)


@pytest.mark.parametrize("factor", [jnp.nan, 1e6], ids=["nan", "exploded"])
def test_a_training_that_blows_up_keeps_the_last_good_weights(plan, setup, factor):
    class Poisoned(ScaleInvariantPhysics):
        def update(self, *arguments):
            network, optimiser, loss = super().update(*arguments)
            factors = jnp.where(arguments[-1] > 0.6, factor, 1.0)
            return network.with_weights(network.weights * factors), optimiser, loss

    trained = run_training(plan, setup, method=Poisoned())
    assert "blew up" in trained.stopped
    assert np.all(np.isfinite(trained.network.weights))
    assert trained.history[-1].iteration == 10
    assert trained.history[-1].error_mean < 1


def test_a_training_that_blows_up_after_it_was_resumed_keeps_the_same_weights(
    plan, setup, tmp_path, monkeypatch
):
    """Its checkpoint is of a step after the last report, whose weights are useless."""

    class Exploding(ScaleInvariantPhysics):
        def update(self, *arguments):
            network, optimiser, loss = super().update(*arguments)
            factors = jnp.where(arguments[-1] > 0.1, 1e6, 1.0)
            return network.with_weights(network.weights * factors), optimiser, loss

    run = functools.partial(run_training, plan, setup, method=Exploding())
    whole, path = run(), tmp_path / "checkpoint"
    with monkeypatch.context() as patch:
        patch.setattr("surrogate.training.checkpoint.save_checkpoint", die_after_saving(3))
        with pytest.raises(Killed):
            run(checkpoint=path, checkpoint_every_s=0.0)
    resumed = run(checkpoint=path)
    assert resumed.stopped == whole.stopped
    assert [p.iteration for p in resumed.history] == [p.iteration for p in whole.history]
    assert np.array_equal(resumed.network.weights, whole.network.weights)


@pytest.mark.slow
def test_matrix_free_hig_trains_as_the_dense_one(plan, setup):
    plan = dataclasses.replace(plan, iterations=4)
    dense, free = (
        run_training(plan, setup, method=HalfInverseGradients(8, tau=1e-2, vectors=vectors))
        for vectors in (None, 128)
    )
    assert np.allclose(dense.network.weights, free.network.weights, atol=1e-4)


def test_train_saves_what_it_returns(tiny_scene, tmp_path, capfd):
    out = tmp_path / "deep" / "folder"
    options = {"samples": 16, "held_out": 8, "preset": "quick", "budget_seconds": 1, "seed": 3}
    surrogate = train(tiny_scene, "hig", out=out, **options)
    assert "preparing flows: 0% 16 bodies, 8 held out" in capfd.readouterr().err
    loaded = load(out)
    body = np.array([2.0, 0.1, 0.0, 0.0])
    assert float(loaded.drag(body, 10.0)) == float(surrogate.drag(body, 10.0))
    assert loaded.scene == tiny_scene
    for key, value in {"method": "hig", "samples": 16, "seed": 3, "held_out": 8}.items():
        assert loaded.recorded(key) == value
    assert 0 < loaded.recorded("drag_error_mean") < loaded.recorded("drag_error_max")
    assert loaded.recorded("unsolved_samples") == 0
    names = ["card.txt", "surrogate.json", "weights.eqx"]
    assert sorted(path.name for path in out.iterdir()) == names


@pytest.mark.slow
def test_a_family_of_eight_parameters_trains(tmp_path, tiny_scene):
    betas = {f"beta{k}": (-0.1 / k, 0.1 / k) for k in range(2, 9)}
    scene = dataclasses.replace(tiny_scene, family=Family(aspect=(1, 3), **betas))
    plan = Plan("sip", scene, samples=32, held_out=8, iterations=12, report_every=1)
    surrogate = train_plan(plan, tmp_path / "eight", progress=False)
    first = surrogate.recorded("history")[0][3]  # mean error against the flow
    assert surrogate.recorded("drag_error_mean") < 0.5 * first
    assert surrogate.recorded("drag_error_mean") < 0.05
    body = np.array([2.0, 0.03, -0.02, 0.01, 0.01, -0.01, 0.005, -0.005])
    drag = float(load(tmp_path / "eight").drag(body, 10.0))
    assert drag == float(surrogate.drag(body, 10.0))
    assert drag == pytest.approx(float(load("pretrained").drag([2.0, 0, 0, 0], 10.0)), rel=0.2)
    with pytest.raises(InvalidInput, match="8 parameters are needed"):
        surrogate.drag(body[:4], 10.0)
