"""3-D bodies of the family: volume, centroid and measures of their surface; what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ROUGH_3D
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from surrogate import Family, Flow, InvalidInput, Scene, family_shape
from surrogate.body.skin import SkinNodes

FAMILY = Family(dimension=3)
FLOW = Flow(Scene(dimension=3, fidelity=ROUGH_3D))

betas = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.15, 0.2), st.floats(-0.1, 0.1))


@settings(max_examples=40, deadline=None, derandomize=True)
@given(aspect=st.floats(0.5, 4), flatness=st.floats(1, 2), betas=betas)
def test_every_surface_is_closed_has_volume_pi_over_6_and_its_centroid_at_the_origin(
    aspect, flatness, betas
):
    body = jnp.array([aspect, flatness, *betas])
    assume(float(FAMILY.body_class.min_thickness_ratio(body)) > 0.05)
    skin = FAMILY.markers(body, SkinNodes(64, 16))
    weights = FLOW.domain.modes.weights(skin.nodes)
    points, areas = np.asarray(skin.points), np.asarray(skin.areas)
    volume = 4 * weights @ np.sum(points * areas, axis=1) / 3
    assert volume == pytest.approx(np.pi / 6, rel=1e-3)
    assert abs(weights @ areas[:, 0]) < 1e-10  # closed along the stream
    assert abs(weights @ (points[:, 0] ** 2 * areas[:, 0])) < 1e-3  # the centroid is the origin
    halves = np.abs(np.asarray(FAMILY.outline(body, 400))).max(axis=0)
    assert float(FAMILY.body_class.thickness(body)) == pytest.approx(2 * halves[1], rel=1e-3)
    assert float(FAMILY.body_class.length(body)) == pytest.approx(
        np.ptp(np.asarray(FAMILY.outline(body, 400))[:, 0])
    )
    length, width, height = FAMILY.extent
    if FAMILY.contains(np.asarray(body)):
        assert np.all(np.abs(points).max(axis=0) <= np.array([length, width, height]) / 2 * 1.001)


def test_families_bodies_and_scenes_that_are_not_3d_are_refused():
    with pytest.raises(InvalidInput, match="without walls"):
        Scene(dimension=3, stream="tunnel:12")
    with pytest.raises(InvalidInput, match=r"tested from 0\.001"):
        Scene(dimension=3, reynolds=(0.0001, 1))
    with pytest.raises(InvalidInput, match="flatness"):
        Family(aspect=(1, 2), flatness=(1, 2))
    with pytest.raises(InvalidInput, match="incidence 181"):
        family_shape({"aspect": 1.0}, incidence=181.0, dimension=3)
    with pytest.raises(InvalidInput, match="flatness 9"):
        family_shape({"aspect": 1.0, "flatness": 9.0}, dimension=3)
