"""Bodies: exact areas, centroids and symmetries; contours from files; what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from surrogate import Family, InvalidInput, contour_shape, family_shape, naca4, read_contour
from surrogate.body.contour import crosses_itself
from surrogate.body.incidence import rotate
from surrogate.body.measures import AREA, mean_thickness, moments
from surrogate.body.parameters import PARAMETERS

FAMILY = Family()
WIDE = Family(  # all of the modes
    aspect=(0.5, 6),
    **{f"beta{k}": (-0.3 / (k - 1), 0.3 / (k - 1)) for k in range(2, 13)},
)
NAMES = ("aspect", "beta2", "beta3", "beta4")


def area_and_sides(markers):
    """Area by a spectral rule, exact for the trigonometric contours of a family."""
    nodes = len(markers)
    x, y = np.asarray(markers).T
    spectral = np.fft.ifft(1j * np.fft.fftfreq(nodes, 1 / nodes) * np.fft.fft(x)).real
    return np.mean(y * spectral) * 2 * np.pi


@pytest.mark.parametrize("parameters", [(1, 0, 0, 0), (2.5, 0.2, -0.1, 0.05), (4, -0.2, 0.1, 0.1)])
def test_exact_area_and_centroid(parameters):
    markers = np.asarray(FAMILY.markers(jnp.array(parameters, float), 256))
    assert area_and_sides(markers) == pytest.approx(AREA, rel=1e-12)
    assert moments(markers)[0] == pytest.approx(AREA, rel=1e-3)
    assert float(moments(jnp.asarray(markers))[1][0]) == pytest.approx(0, abs=1e-12)
    assert np.allclose(markers[1:][::-1] * [1, -1], markers[1:], atol=1e-14)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.tuples(*(st.floats(*ends) for ends in WIDE.bounds.tolist())))
def test_exact_area_of_any_member_of_the_widest_family(parameters):
    assume(float(WIDE.body_class.min_thickness_ratio(jnp.array(parameters))) > 0.02)
    markers = np.asarray(WIDE.markers(jnp.array(parameters), 256))
    assert area_and_sides(markers) == pytest.approx(AREA, rel=1e-12)
    assert float(moments(jnp.asarray(markers))[1][0]) == pytest.approx(0, abs=1e-12)
    assert np.allclose(markers[1:][::-1] * [1, -1], markers[1:], atol=1e-14)
    assert not crosses_itself(markers)


def test_exact_markers_of_names_with_gaps():
    few = Family(aspect=(1, 3), beta5=(-0.1, 0.1))
    assert few.names == ("aspect", "beta5")
    assert few.body_class.modes == (5,)
    every = Family(
        **{
            name: (0.5, 1) if name == "aspect" else (-1, 1)
            for name in PARAMETERS
            if name == "aspect" or name.startswith("beta")
        }
    )
    full = jnp.zeros(12).at[0].set(2.0).at[4].set(0.07)  # beta5 is the fifth
    expected = every.markers(full, 128)
    assert np.allclose(few.markers(jnp.array([2.0, 0.07]), 128), expected, atol=1e-15)
    named = {"aspect": 2.0, "beta5": 0.07}
    assert np.allclose(family_shape(named).draw(128), expected, atol=1e-15)
    assert np.array_equal(few.parameters(named), [2.0, 0.07])
    assert few.named(few.parameters(named)) == named


@pytest.mark.parametrize("family", [FAMILY, WIDE, Family(aspect=(1, 3))], ids=["4", "12", "1"])
def test_samples_are_valid_and_inside(family):
    samples = family.sample(jax.random.key(3), 200)
    assert samples.shape == (200, len(family.names))
    assert all(family.contains(np.asarray(sample)) for sample in samples)
    assert float(jax.vmap(family.body_class.min_thickness_ratio)(samples).min()) > 0
    again = family.sample(jax.random.key(3), 200)
    assert np.array_equal(samples, again)


def test_ratios_over_a_decade_are_uniform_in_their_logarithm():
    wide, narrow = Family(aspect=(0.3, 4.8), beta2=(-0.3, 0.3)), Family(aspect=(1, 5))
    assert np.allclose(
        wide.within(np.array([[0, 0], [0.5, 0.5], [1, 1]])), [[0.3, -0.3], [1.2, 0], [4.8, 0.3]]
    )
    assert np.allclose(narrow.within(np.array([[0], [0.5], [1]])), [[1], [3], [5]])
    aspects = np.asarray(wide.sample(jax.random.key(0), 2000))[:, 0]
    assert np.mean(aspects < 1.2) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("family", [FAMILY, WIDE, Family(aspect=(1, 3))], ids=["4", "12", "1"])
def test_extent_holds_every_member(family):
    length, height = family.extent
    draw = jax.jit(lambda sample: family.markers(sample, 128))
    for sample in family.sample(jax.random.key(4), 50):
        reach = np.abs(np.asarray(draw(sample))).max(axis=0)
        assert reach[0] <= length / 2 + 1e-12
        assert reach[1] <= height / 2 + 1e-12


def test_every_parameter_is_described():
    words = [parameter.label for parameter in PARAMETERS.values()]
    assert len(set(words)) == len(words)


def test_a_family_is_the_same_whatever_the_order_of_its_names():
    assert Family(beta3=(0, 0.1), aspect=(1, 3)) == Family(aspect=(1, 3), beta3=(0, 0.1))


@pytest.mark.parametrize(
    ("ranges", "words"),
    [
        ({"beta2": (0, 0.1)}, "aspect needs a range"),
        ({"aspect": (1, 2), "beta13": (0, 0.1)}, "no parameter 'beta13'"),
        ({"aspect": (3, 1)}, "low must not be above high"),
        ({"aspect": (2, 2)}, "low must be below high"),
        ({"aspect": (0.01, 2)}, "from 0.1 to 20"),
        ({"aspect": (1, np.nan)}, "finite number"),
        ({"aspect": "1 to 5"}, "two numbers"),
        ({"aspect": (1, "5")}, "must be one number"),
        ({"aspect": (1, 5), "beta2": (-2, 2)}, "from -1 to 1"),
    ],
)
def test_families_that_are_none_are_refused(ranges, words, unchecked):
    with pytest.raises(InvalidInput, match=words):
        Family(**ranges)


def test_a_family_of_bodies_that_all_cross_themselves_cannot_be_sampled():
    with pytest.raises(InvalidInput, match="cross themselves"):
        Family(aspect=(1, 2), beta2=(0.8, 0.9)).sample(jax.random.key(0), 4)


@pytest.mark.parametrize(
    "bad", [(np.nan, 0, 0, 0), (0.01, 0, 0, 0), (2, 0.6, 0, 0), (2, 0, -0.9, 0), (2, 0, np.inf, 0)]
)
def test_bodies_that_are_none_are_refused(bad):
    with pytest.raises(InvalidInput):
        FAMILY.check(np.array(bad, float))
    with pytest.raises(InvalidInput):
        family_shape(dict(zip(NAMES, bad, strict=True)))


def test_a_name_that_is_not_the_familys_is_refused():
    with pytest.raises(InvalidInput, match="beta7 is none of the family's aspect, beta2"):
        FAMILY.parameters({"aspect": 2.0, "beta7": 0.1})


def test_exact_contour_of_an_ellipse():
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    markers = contour_shape(np.stack([3 * np.cos(angle), 1.5 * np.sin(angle)], axis=1)).draw(128)
    a, b = np.sqrt(0.5), np.sqrt(0.125)
    level = (markers[:, 0] / a) ** 2 + (markers[:, 1] / b) ** 2
    assert np.abs(level - 1).max() < 0.01
    assert moments(markers)[0] == pytest.approx(AREA, rel=1e-12)


def test_contour_orientation_and_start_do_not_matter():
    points = naca4("2412")
    a = contour_shape(points).draw(200)
    b = contour_shape(np.roll(points[::-1], 31, axis=0)).draw(200)
    assert np.abs(a - b).max() < 1e-9


def test_exact_incidence_is_nose_up():
    nose = rotate(jnp.array([[-1.0, 0.0]]), 30.0)[0]
    assert float(nose[1]) == pytest.approx(0.5)
    assert float(nose[0]) < 0


@pytest.mark.parametrize("incidence", [181, np.nan, "10"])
def test_an_incidence_that_is_none_is_refused(incidence, unchecked):
    with pytest.raises(InvalidInput, match="incidence"):
        family_shape({"aspect": 2.0}, incidence)
    with pytest.raises(InvalidInput, match="incidence"):
        contour_shape(naca4("0012"), incidence)


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
        contour_shape(eight + 0.01)
    with pytest.raises(InvalidInput, match="at least 8"):
        contour_shape(eight[:5])
    with pytest.raises(InvalidInput, match="no area"):
        contour_shape(np.stack([np.linspace(0, 1, 20), np.zeros(20)], axis=1))
    with pytest.raises(InvalidInput, match="its size is"):
        contour_shape(1e-200 * naca4("0012"))


@pytest.mark.parametrize("points", [200, 4000])
def test_a_spike_that_crosses_is_seen_in_contours_of_any_length(points):
    t = np.linspace(0, 2 * np.pi, points, endpoint=False)
    circle = np.stack([np.cos(t), np.sin(t)], axis=1)
    assert not crosses_itself(circle)
    circle[points // 3] = (1.5, -0.2)  # through the other side
    assert crosses_itself(circle)
    with pytest.raises(InvalidInput, match="crosses"):
        contour_shape(circle)


def test_exact_mean_thickness_of_a_circle():
    markers = np.asarray(Family(aspect=(1, 2)).outline(jnp.array([1.0]), 400))
    assert mean_thickness(markers) == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("code", ["12", "00AB", "0000", "4012", "0412", "00120", "²²12"])
def test_naca_codes_that_are_none_are_refused(code):
    with pytest.raises(InvalidInput):
        naca4(code)
