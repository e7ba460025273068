"""Exact: areas, centroids, symmetries and refusals of bodies and contours."""

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate.body.family import AREA, Family, check_family, family_markers, moments, opening, rotate
from surrogate.body.contour import crosses_itself, mean_thickness, naca4, read_contour, smooth_contour
from surrogate.errors import InvalidInput


@pytest.mark.parametrize("parameters", [(1, 0, 0, 0), (2.5, 0.2, -0.1, 0.05), (4, -0.2, 0.1, 0.1)])
def test_family_area_and_centroid_are_exact(parameters):
    t = 2 * np.pi * np.arange(256) / 256
    markers = np.asarray(family_markers(jnp.array(parameters, float), 256))
    x, y = markers.T
    spectral = np.fft.ifft(1j * np.fft.fftfreq(256, 1 / 256) * np.fft.fft(x)).real
    assert np.mean(y * spectral) * 2 * np.pi == pytest.approx(AREA, rel=1e-12)
    assert moments(markers)[0] == pytest.approx(AREA, rel=1e-3)
    assert float(moments(jnp.asarray(markers))[1][0]) == pytest.approx(0, abs=1e-12)
    assert np.allclose(markers[1:][::-1] * [1, -1], markers[1:], atol=1e-14), t


def test_family_samples_are_valid_and_inside(tiny_scene):
    import jax

    family = Family()
    samples = family.sample(jax.random.key(3), 200)
    assert all(family.contains(np.asarray(sample)) for sample in samples)
    assert float(jax.vmap(opening)(samples).min()) > 0


def test_family_extent_holds_every_member():
    import jax

    family = Family()
    length, height = family.extent
    for sample in family.sample(jax.random.key(4), 50):
        reach = np.abs(np.asarray(family_markers(sample, 128))).max(axis=0)
        assert reach[0] <= length / 2 + 1e-12
        assert reach[1] <= height / 2 + 1e-12


@pytest.mark.parametrize(
    "bad", [(np.nan, 0, 0, 0), (0.01, 0, 0, 0), (2, 0.6, 0, 0), (2, 0, -0.9, 0), (2, 0, np.inf, 0)]
)
def test_bodies_that_are_none_are_refused(bad):
    with pytest.raises(InvalidInput):
        check_family(np.array(bad, float))


def test_smooth_contour_of_an_ellipse_is_that_ellipse():
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    markers = smooth_contour(np.stack([3 * np.cos(angle), 1.5 * np.sin(angle)], axis=1), 128)
    a, b = np.sqrt(0.5), np.sqrt(0.125)
    level = (markers[:, 0] / a) ** 2 + (markers[:, 1] / b) ** 2
    assert np.abs(level - 1).max() < 0.01
    assert moments(markers)[0] == pytest.approx(AREA, rel=1e-12)


def test_contour_orientation_and_start_do_not_matter():
    points = naca4("2412")
    a = smooth_contour(points, 200)
    b = smooth_contour(np.roll(points[::-1], 31, axis=0), 200)
    assert np.abs(a - b).max() < 1e-9


def test_incidence_is_nose_up():
    nose = rotate(jnp.array([[-1.0, 0.0]]), 30.0)[0]
    assert float(nose[1]) == pytest.approx(0.5)
    assert float(nose[0]) < 0


def test_contour_files(tmp_path):
    points = naca4("0012")
    table = "\n".join(f"{x:.6f} {y:.6f}" for x, y in points)
    (tmp_path / "s.dat").write_text("NACA 0012\n" + table)
    (tmp_path / "s.csv").write_text("x,y\n" + table.replace(" ", ","))
    assert np.allclose(read_contour(tmp_path / "s.dat"), points, atol=1e-6)
    assert np.allclose(read_contour(tmp_path / "s.csv"), points, atol=1e-6)
    for name, text in (("words", "a b\nc d\n"), ("nan", "nan,0\n1,1\n"), ("three", "1,2,3\n1,2,3")):
        (tmp_path / name).write_text(text)
        with pytest.raises(InvalidInput, match="two finite numbers"):
            read_contour(tmp_path / name)
    with pytest.raises(InvalidInput, match="cannot be read"):
        read_contour(tmp_path / "missing")


def test_crossing_flat_and_short_contours_are_refused():
    t = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    eight = np.stack([np.sin(t), np.sin(2 * t)], axis=1)
    assert crosses_itself(eight + 0.01)
    bow = [(0, 0), (1, 1), (2, 1), (2, -1), (1, -1), (0, 0), (-0.5, 0.5), (-1, 0), (-0.5, -0.5)]
    assert crosses_itself(np.array(bow, float))  # in a corner that is listed twice
    castle = [(0, 0), (0, 2), (1, 2), (1, 1), (2, 1), (2, 2), (3, 2), (3, 0)]
    assert not crosses_itself(np.array(castle, float))
    with pytest.raises(InvalidInput, match="crosses"):
        smooth_contour(eight + 0.01, 100)
    with pytest.raises(InvalidInput, match="at least 8"):
        smooth_contour(eight[:5], 100)
    with pytest.raises(InvalidInput, match="no area"):
        smooth_contour(np.stack([np.linspace(0, 1, 20), np.zeros(20)], axis=1), 100)
    with pytest.raises(InvalidInput, match="its size is"):
        smooth_contour(1e-200 * naca4("0012"), 100)


def test_mean_thickness_of_a_circle():
    markers = np.asarray(family_markers(jnp.array([1.0, 0, 0, 0]), 400))
    assert mean_thickness(markers) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("code", ["12", "00AB", "0000", "4012", "0412", "00120", "²²12"])
def test_naca_codes_that_are_none_are_refused(code):
    with pytest.raises(InvalidInput):
        naca4(code)
