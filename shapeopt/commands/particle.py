"""The option --particle: a body's density ratio, its fluid and its size in SI units."""

from shapeopt.commands.cli import Parser
from shapeopt.commands.ranges import few_numbers
from surrogate.flow.settling import Particle

FORM = "density ratio,viscosity,size[,gravity], as 2.65,1e-6,2e-4"


def add_particle_argument(parser: Parser, purpose: str = "", required: bool = False) -> None:
    """Add the option --particle.

    Args:
      parser: of the command.
      purpose: what the command does with it, which begins the help.
      required: refuse the command without it.
    """
    numbers = (
        "RATIO,NU,D[,G]: density over the fluid's, kinematic viscosity in m^2/s, diameter of the "
        "sphere of equal volume in m, gravity in m/s^2 (9.81)"
    )
    parser.add_argument("--particle", required=required, help=purpose + numbers)


def particle_of(text: str) -> Particle:
    """Return the particle that --particle gives.

    Raises:
      InvalidInput: it is neither three nor four positive numbers, or the density ratio is 1.
    """
    return Particle(*few_numbers(text, "--particle", FORM, 3, 4))


def particle_line(particle: Particle) -> str:
    """Return the numbers of a particle with their units as a line of text."""
    return (
        f"density ratio {particle.density_ratio:g}, nu {particle.viscosity:g} m^2/s, "
        f"D {particle.size:g} m, gravity {particle.gravity:g} m/s^2"
    )
