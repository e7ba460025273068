"""The comparison with published bodies: the reading of a nose, and the table itself."""

import json

import numpy as np
import pytest
from compare_literature import Line, main

from shapeopt.literature import LENS, family_front, front_angles
from surrogate.body.family import ellipse


def symmetric(x, y):
    """Clockwise contour from the nose of an upper side and its mirror image."""
    upper = np.stack([x, y], axis=1)
    return np.concatenate([upper, upper[-2:0:-1] * [1, -1]])


@pytest.mark.parametrize("degrees", [60.0, 90.0, 102.6])
def test_front_of_a_wedge_is_its_angle(degrees):
    x = np.linspace(0, 1, 501)
    markers = symmetric(x, np.tan(np.radians(degrees / 2)) * np.minimum(x, (1 - x) / 4))
    assert front_angles(markers) == pytest.approx((degrees, degrees))


def test_front_of_a_lens_is_continued_to_its_tip():
    """Two circular arcs that meet at a right angle: the tangent behind the tip is flatter."""
    x = np.linspace(-1, 1, 2001)
    front = front_angles(symmetric(x, np.sqrt(2 - x**2) - 1))
    assert front.wedge == pytest.approx(86.8, abs=0.2)
    assert 65 < front.tangent < 75


def test_slender_ellipses_have_sharper_fronts():
    wedges = [family_front(ellipse(aspect)).wedge for aspect in (2.0, 3.0, 4.0)]
    assert wedges == sorted(wedges, reverse=True)


def test_a_line_agrees_within_its_tolerance():
    assert Line("", 1.04, 1.0, 0.05, "").agrees
    assert not Line("", 0.94, 1.0, 0.05, "").agrees


@pytest.mark.slow
def test_comparison(capsys):
    main(["--json"])
    result = json.loads(capsys.readouterr().out.splitlines()[-1])
    lines = {line["quantity"]: line for line in result["lines"]}
    assert len(lines) == len(result["lines"])
    where = f"Re 1, tunnel:{result['tunnel_height']:g}"
    cylinder = sum(
        lines[f"{where}: cylinder, {part} drag"]["ours"] for part in LENS.cylinder._fields
    )
    assert cylinder == pytest.approx(LENS.cylinder.total, rel=1e-3)
    for name in (f"{where}: aspect", "Re 40, body-fitted adjoint: gain, %"):
        assert lines[name]["agrees"]
