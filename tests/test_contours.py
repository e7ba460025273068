"""Contours from files: large ones, odd ones, every usual format."""

import numpy as np
import pytest

from surrogate import InvalidInput, contour_shape, naca4, read_contour

T = np.linspace(0, 2 * np.pi, 80, endpoint=False)
ROUND = np.stack([np.cos(T), 0.5 * np.sin(T)], axis=1)


@pytest.mark.parametrize("count", [20_000, 1_000_000])
def test_contours_of_many_points(count):
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)
    points = np.stack([2 * np.cos(t), np.sin(t)], axis=1)
    few = contour_shape(ROUND).draw(200)
    assert np.abs(contour_shape(points).draw(200) - few).max() < 0.01


def test_a_contour_that_smoothing_would_remove_is_refused():
    radius = np.where(np.arange(400) % 2, 1.0, 0.1)
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    with pytest.raises(InvalidInput, match="lost to smoothing"):
        contour_shape(np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1))
    with pytest.raises(InvalidInput, match="far from the origin"):
        contour_shape(ROUND + 1e12)


def lines(points, gap=" "):
    return "\n".join(f"{x:.6f}{gap}{y:.6f}" for x, y in points) + "\n"


SECTION = naca4("2412", 60)
UPPER, LOWER = SECTION[:31], np.concatenate([SECTION[:1], SECTION[:29:-1]])
FORMATS = {
    "selig": lines(SECTION),
    "selig, a title of one number": "2412\n" + lines(SECTION),
    "selig, a title of two numbers": "63 412\n" + lines(SECTION),
    "lednicer": f"NACA\n{len(UPPER)}. {len(LOWER)}.\n\n" + lines(UPPER) + "\n" + lines(LOWER),
    "semicolons": lines(SECTION, ";"),
    "decimal commas": lines(SECTION, ";").replace(".", ","),
    "decimal commas in columns": lines(SECTION, "  ").replace(".", ","),
    "Fortran": "\n".join(f"{x:.5f}D+00 {y:.5f}d0" for x, y in SECTION),
    "tabs": lines(SECTION, "\t"),
    "bars": lines(SECTION, " | "),
    "trailing commas": lines(SECTION, ",").replace("\n", ",\n"),
    "quotes": lines(SECTION, '","').replace("\n", '"\n').replace("-", "-"),
    "comments behind rows": lines(SECTION).replace("\n", " % a point\n"),
    "minus signs": lines(SECTION).replace("-", "\N{MINUS SIGN}"),
    "a solved flow's": "x,y,Cp,Cf\n" + lines(SECTION, ",").replace("\n", ",0.5,0.01\n"),
    "comments": "# one\n# two\nx,y\n" + lines(SECTION, ","),
    "units": "x [mm]; y [mm]; Cp\n" + lines(SECTION, ";").replace("\n", ";0.5\n"),
    "shares of the chord": "x/c,y/c\n" + lines(SECTION, ","),
}


@pytest.mark.parametrize("form", FORMATS)
def test_contours_of_every_usual_format_are_read(tmp_path, form):
    (tmp_path / "c.dat").write_text(FORMATS[form])
    found = contour_shape(read_contour(tmp_path / "c.dat")).draw(200)
    assert np.abs(found - contour_shape(SECTION).draw(200)).max() < 2e-3


@pytest.mark.parametrize(
    "spoil",
    [
        lambda row, k: row + " 0" if k < 25 else row,
        lambda row, k: f"P{k} {row}" if k < 15 else row,
        lambda row, k: row.replace(".", ",").replace(" ", ",") if k < 12 else row,
        lambda row, k: f"y x\n{row}" if k == 0 else row,
        lambda row, k: f"Y [mm]; X [mm]\n{row}" if k == 0 else row,
        lambda row, k: f"y/c,x/c\n{row}" if k == 0 else row,
    ],
    ids=["third column", "names", "commas", "y first", "y first, in mm", "y first, over c"],
)
def test_no_row_of_a_contour_is_dropped_silently(tmp_path, spoil):
    rows = lines(SECTION).splitlines()
    (tmp_path / "c.dat").write_text("\n".join(spoil(row, k) for k, row in enumerate(rows)))
    with pytest.raises(InvalidInput, match=r"c\.dat: row \d"):
        read_contour(tmp_path / "c.dat")


def test_an_endless_contour_file_is_refused():
    with pytest.raises(InvalidInput, match="is larger than"):
        read_contour("/dev/zero")


def test_wrong_counts_of_points_are_reported(tmp_path):
    text = f"NACA\n{len(UPPER)} {len(LOWER) - 2}\n" + lines(UPPER) + "\n" + lines(LOWER)
    (tmp_path / "c.dat").write_text(text)
    with pytest.raises(InvalidInput, match=r"row 2 counts 31 \+ 29 points, where 62 follow"):
        read_contour(tmp_path / "c.dat")


@pytest.mark.parametrize("text", ["", "x,y\n", "0,5;0,2;1\n", "\n\n"])
def test_files_without_a_contour_are_refused(tmp_path, text):
    (tmp_path / "c.csv").write_text(text)
    with pytest.raises(InvalidInput, match=r"c\.csv: (none of its|row)"):
        read_contour(tmp_path / "c.csv")


def test_a_first_point_is_not_taken_for_counts_of_points(tmp_path):
    """As Lednicer's would be, if 100 + 20 points in two sides followed."""
    t = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    rest = np.stack([99.9 * np.cos(t), 20 + 49 * np.sin(t)], axis=1)
    (tmp_path / "c.dat").write_text("100 20\n" + lines(rest))
    np.testing.assert_allclose(read_contour(tmp_path / "c.dat")[1:], rest, atol=1e-5)


@pytest.mark.parametrize("nodes", [100, 101, 5000, 8192])
def test_smoothing_keeps_the_size_and_gives_as_many_points_as_asked_for(nodes):
    t = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    found = contour_shape(np.stack([np.cos(t), np.sin(t)], axis=1) / 2, keep_size=True).draw(nodes)
    assert found.shape == (nodes, 2)
    np.testing.assert_allclose(np.hypot(*found.T), 0.5, atol=1e-4)
