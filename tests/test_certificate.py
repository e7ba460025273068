"""Certificates: an order of magnitude nearer to the flow at a quarter of its cost, or solved."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from surrogate.body import family_markers, family_shape
from surrogate.certificate import box_compliance, certify
from surrogate.errors import InvalidInput
from surrogate.flow import steady
from surrogate.flow.far import refinement
from surrogate.flow.trust import solve_shape
from surrogate.reduced import ReducedFlow, load_reduced, reduce_flow, save_reduced, stored_lattice
from surrogate.scene import FIDELITIES, Scene, Tunnel, Unbounded
from surrogate.store import load_surrogate
from surrogate.training.physics import draw_samples, scene_domain, solve_labels

FEW = 6


@pytest.fixture(scope="module")
def shipped():
    return load_reduced()


@pytest.fixture(scope="module")
def tiny_flows(tiny_scene) -> ReducedFlow:
    samples = draw_samples(tiny_scene, jax.random.key(1), 40)
    reduced, work = reduce_flow(tiny_scene, samples, rank=12)
    assert work > 40 * steady.preparation_cost(scene_domain(tiny_scene))
    return reduced


def test_certificate_is_an_order_of_magnitude_nearer_at_a_quarter_of_the_cost(shipped):
    surrogate = load_surrogate("pretrained:dp")
    bodies = draw_samples(surrogate.scene, jax.random.key(5), FEW)
    labels = solve_labels(scene_domain(surrogate.scene), bodies)
    solved = -2 * np.asarray(labels.amplitude[:, 0])
    checks = [
        certify(surrogate, body, float(re), shipped) for body, re in zip(*bodies, strict=True)
    ]
    assert {check.by for check in checks} == {"reduced flow"}
    predicted = np.asarray(jax.vmap(surrogate.drag)(*bodies))
    before = np.mean(np.abs(predicted / solved - 1))
    after = np.mean(
        [abs(check.cd_corrected / cd - 1) for check, cd in zip(checks, solved, strict=True)]
    )
    assert after < before / 10, f"mean error {before:.1e} -> {after:.1e}"
    spent = np.mean([check.certificate_green_applications for check in checks])
    assert spent < float(np.mean(labels.products)) / 4
    for check, cd in zip(checks, predicted, strict=True):
        assert check.estimated_error == pytest.approx(abs(cd / check.cd_corrected - 1))


@pytest.mark.parametrize(("aspect", "reynolds"), [(2.0, 0.5), (0.4, 10.0)])
def test_outside_the_trained_range_the_flow_is_solved(shipped, aspect, reynolds):
    """On a grid that fits the body, however long or tall."""
    surrogate = load_surrogate("pretrained:sip")
    body = np.array([aspect, 0.0, 0.0, 0.0])
    check = certify(surrogate, body, reynolds, shipped)
    assert check.by == "body flow"
    fine = solve_shape(family_shape(body), Unbounded(), FIDELITIES["draft"], reynolds)
    assert check.cd_corrected == pytest.approx(fine.cd, rel=0.02)


def test_what_no_flow_can_check_is_refused(shipped):
    surrogate = load_surrogate("pretrained:sip")
    with pytest.raises(InvalidInput, match="aspect 25"):
        certify(surrogate, np.array([25.0, 0.0, 0.0, 0.0]), 10.0, shipped)
    with pytest.raises(InvalidInput, match="Reynolds number"):
        certify(surrogate, np.array([2.0, 0.0, 0.0, 0.0]), float("nan"), shipped)


def test_a_correction_that_has_not_settled_is_solved(shipped):
    """Flows of other bodies than those asked for: the sweeps do not agree."""
    surrogate = load_surrogate("pretrained:sip")
    wrong = dataclasses.replace(shipped.bases.velocity, mean=-2 * shipped.bases.velocity.mean)
    bases = shipped.bases._replace(velocity=wrong)
    misled = dataclasses.replace(shipped, bases=bases)
    check = certify(surrogate, np.array([2.0, 0.0, 0.0, 0.0]), 30.0, misled)
    assert check.by == "body flow"
    assert check.certificate_green_applications > 30


@pytest.mark.parametrize("stream", [None, Tunnel(8.0)])
def test_compliance_on_the_box_is_that_of_the_window(tiny_scene, stream):
    scene = tiny_scene if stream is None else dataclasses.replace(tiny_scene, stream=stream)
    domain, re = scene_domain(scene), jnp.asarray(12.0)
    case = steady.prepare(domain, family_markers(jnp.array([2.0, 0.1, 0, 0]), domain.nodes), re)
    expected = jax.vmap(case.body.slip)(case.response).T
    found = box_compliance(domain, case.body, re)
    assert np.allclose(found, expected, atol=2e-6 * np.abs(expected).max())


def test_reduced_flows_repeat_what_they_were_made_of(tiny_scene, tiny_flows, tmp_path):
    samples = draw_samples(tiny_scene, jax.random.key(1), 40)
    domain = scene_domain(tiny_scene)
    state, _ = steady.body_flow(
        domain,
        steady.prepare(
            domain, family_markers(samples.parameters[0], domain.nodes), samples.reynolds[0]
        ),
    )
    guess = tiny_flows.guess(jax.tree.map(lambda leaf: leaf[:1], samples))
    sampled = refinement(stored_lattice(domain.lattice), domain.lattice)(state.velocity)
    miss = np.linalg.norm(guess.velocity[0] - sampled) / np.linalg.norm(sampled)
    assert miss < 0.05, f"the first of 40 samples is off by {miss:.1e} with 12 modes"

    save_reduced(tmp_path / "flows.npz", tiny_flows)
    again = load_reduced(tmp_path / "flows.npz")
    assert again.scene == tiny_scene
    for new, old in zip(again.guess(samples), tiny_flows.guess(samples), strict=True):
        assert np.allclose(new, old, atol=1e-6)


def test_damaged_and_foreign_flows_are_named(tiny_flows, tmp_path):
    path = tmp_path / "flows.npz"
    with pytest.raises(InvalidInput, match="no such file"):
        load_reduced(path)
    save_reduced(path, tiny_flows)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(InvalidInput, match=r"flows\.npz: damaged"):
        load_reduced(path)
    np.savez(path, weights=np.zeros(3))
    with pytest.raises(InvalidInput, match="damaged, or not reduced flows"):
        load_reduced(path)


def test_shipped_flows_are_of_the_shipped_scene(shipped):
    assert shipped.scene == load_surrogate("pretrained").scene == Scene()
