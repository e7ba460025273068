"""The time march, which shares no solver with the steady flow, agrees with it."""

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate import Flow, Scene, family_shape
from surrogate.flow.check.march import Box, growth_rate, make_marcher, march, start, strouhal

CYLINDER = family_shape({"aspect": 1.0})


@pytest.mark.slow
def test_march_settles_on_the_steady_drag():
    """Re 20 in a narrow, coarse box; the steady flow between the same walls."""
    box = Box(cells=10, upstream=6, downstream=12, height=8, sponge=4)
    marcher = make_marcher(box, jnp.asarray(CYLINDER.draw(128)), 20.0)
    velocity, record = march(box, marcher, start(box), 2000)
    steady = Flow(Scene(stream="tunnel:8")).solve(CYLINDER, 20.0, estimate=False)
    assert float(record.drag[-1]) == pytest.approx(steady.drag, rel=0.02)
    assert float(jnp.abs(record.lift[-1])) < 1e-9
    u, v = velocity
    dx, dy = box.lattice.step
    divergence = (u - jnp.roll(u, 1, 0)) / dx + (v - jnp.roll(v, 1, 1)) / dy
    assert float(jnp.abs(divergence).max()) < 1e-9
    assert float(u.mean()) == pytest.approx(1.0)


def test_exact_strouhal_number_of_a_known_signal():
    time = np.arange(4000) * 0.01
    assert strouhal(0.3 + np.sin(2 * np.pi * 0.17 * time), 0.01) == pytest.approx(0.17, rel=1e-3)
    assert strouhal(np.ones(100), 0.01) is None


@pytest.mark.parametrize("rate", [-0.03, 0.0, 0.02])
def test_exact_growth_rate_of_a_known_signal(rate):
    time = np.arange(16_000) * 0.01
    lift = 0.3 + np.exp(rate * time) * np.sin(2 * np.pi * 0.17 * time)
    assert growth_rate(lift, 0.01) == pytest.approx(rate, rel=1e-3, abs=1e-6)
    assert growth_rate(lift[:3000], 0.01) is None  # too few periods
    assert growth_rate(1e-9 * lift, 0.01) is None  # rounding


@pytest.mark.slow
def test_golden_cylinder_sheds_vortices_at_re_100():
    """Strouhal number 0.164-0.166 unbounded, a little more at a blockage of 1/16."""
    box = Box()
    marcher = make_marcher(box, jnp.asarray(CYLINDER.draw(200)), 100.0)
    velocity, _ = march(box, marcher, start(box, 0.5), 4000)
    _, record = march(box, marcher, velocity, 4000)
    assert strouhal(record.lift, box.step) == pytest.approx(0.168, rel=0.03)
    assert float(record.drag.mean()) == pytest.approx(1.35, rel=0.03)
