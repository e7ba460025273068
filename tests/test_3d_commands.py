"""The commands for 3-D bodies: drag with its gradient, settling velocity, refusals."""

import json

import pytest
from correlations import ellipsoid, oberbeck

from shapeopt import Settling
from shapeopt.commands import optimize_shape, solve_drag
from shapeopt.commands.problem_arguments import problem_of
from surrogate import InvalidInput, Particle, load

# so few cells per D that there is no coarser grid for an error estimate: quicker
BODY = ["--dimension", "3", "--aspect", "1.5", "--flatness", "1.4", "--cells", "5"]
INCLINED = "--dimension 3 --aspect 2 --incidence"


@pytest.mark.slow
def test_solve_drag_gives_gradients_and_settling_velocities(capsys):
    row = solve_drag.main([*BODY, "--reynolds", "10", "--gradient", "--json"])["results"][0]
    assert set(row["gradient"]) == {"aspect", "flatness", "beta2", "beta3", "beta4", "reynolds"}
    assert json.loads(capsys.readouterr().out.splitlines()[-1])["scene"]["dimension"] == 3
    row = solve_drag.main([*BODY, "--particle", "2.65,1e-6,1e-6", "--json"])["results"][0]
    assert row["settling_reynolds"] < 1e-6 < 1e-3 == row["reynolds"]
    stokes = oberbeck(ellipsoid(1.5, 1.4), row["settling_reynolds"])
    assert row["settling_cd"] == pytest.approx(stokes, rel=0.04)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--dimension 3 --aspect 0.5 --reynolds 1,150", "beyond 121"),
        ("--dimension 3 --naca 0012 --reynolds 10", "goes with --aspect"),
        ("--dimension 3 --aspect 1", "or --particle instead"),
        ("--dimension 3 --aspect 1 --particle 2,3", "density ratio,viscosity,size"),
        ("--aspect 1 --particle 2.65,1e-6,1e-4", "settling"),
        (f"{INCLINED} nan --reynolds 10", "incidence nan: must be a finite number"),
        (f"{INCLINED} 200 --reynolds 10", "incidence 200: from -180 to 180 degrees"),
        (f"{INCLINED} 30 --reynolds 10 --stream tunnel:8", "are modelled without walls"),
        (f"{INCLINED} 30 --reynolds 250", "is unstable beyond 210"),
        (f"{INCLINED} 45 --aspect 12 --reynolds 10", "too large for the standard domain"),
        (f"{INCLINED} 30 --gamma2 0.1 --reynolds 10", "3-D bodies have no camber"),
    ],
)
def test_solve_drag_refuses_what_makes_no_sense_in_3d(words, message):
    with pytest.raises(InvalidInput, match=message):
        solve_drag.main(words.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "--reynolds: give it, or --chord-reynolds; only --objective settling"),
        ("--objective settling", "goes with --objective settling, which needs it"),
        ("--reynolds 20 --archimedes 100", "goes with --objective settling"),
        ("--reynolds 20 --particle 1.2,1e-6,4e-4", "goes with --objective settling"),
        ("--objective settling --archimedes 9 --particle 1.2,1e-6,4e-4", "give one of them, not"),
        ("--objective settling --archimedes 100 --reynolds 20", "finds its Reynolds number"),
        ("--objective settling --archimedes 100 --spread 0.1", "--spread: does not go with --obj"),
        ("--objective settling --archimedes 100 --surrogate pretrained", "3-D bodies"),
    ],
)
def test_optimize_shape_refuses_what_cannot_settle(words, message, tmp_path):
    with pytest.raises(InvalidInput, match=message):
        optimize_shape.main(
            ["--surrogate", "pretrained:particle", *words.split(), "--out", str(tmp_path / "x")]
        )
    assert not list(tmp_path.iterdir())


def test_a_particle_has_the_objective_of_its_archimedes_number():
    words = ["--objective", "settling", "--particle", "1.2,1e-6,4e-4,9.0", "--out", "x"]
    arguments = optimize_shape._parser().parse_args(words)
    problem = problem_of(arguments, load("pretrained:particle"))
    assert problem.objective == Settling(Particle(1.2, 1e-6, 4e-4, 9.0).archimedes)


def test_a_scene_file_with_a_flatness_outside_its_family_is_refused(tmp_path):
    scene = tmp_path / "flat.toml"
    scene.write_text("flatness = 3\n")
    words = ["--surrogate", "none", "--scene", str(scene), "--reynolds", "10", "--out", "x"]
    with pytest.raises(InvalidInput, match="no key 'flatness'"):
        optimize_shape.main(words)
