"""Traction modes in 2-D: Fourier harmonics in the contour parameter."""

import dataclasses

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray


@dataclasses.dataclass(frozen=True)
class Modes2D:
    """Fourier modes of the traction in the contour parameter t.

    A symmetric body has cosines for the x component (harmonics 0 to K) and sines for the y
    component (1 to K); any other body has all of both. The amplitude a_0 of mode 0 is the body's
    total force on the fluid along x, that of mode ``lift_index`` the total force along y, per unit
    span.
    """

    harmonics: int
    symmetric: bool

    @property
    def count(self) -> int:
        """The number of modes."""
        return (2 if self.symmetric else 4) * self.harmonics + (1 if self.symmetric else 2)

    @property
    def lift_index(self) -> int | None:
        """The index of the mode whose amplitude is the force along y; None for symmetric bodies."""
        return None if self.symmetric else 2 * self.harmonics + 1

    @property
    def mirror(self) -> np.ndarray:
        """The factors, 1 or -1, of the amplitudes for the body's mirror image in y = 0."""
        if self.symmetric:
            return np.ones(self.count)
        waves = np.ones(self.harmonics)
        along = np.concatenate([[1.0], waves, -waves])
        return np.concatenate([along, -along])

    def values(self, nodes: int) -> Float[AnyArray, "modes 2 nodes"]:
        """Return the traction of every mode at equidistant t, as force per unit t."""
        t = 2 * np.pi * np.arange(nodes) / nodes
        j = np.arange(1, self.harmonics + 1)[:, None]
        constant, cosine, sine = np.ones((1, nodes)), np.cos(j * t), np.sin(j * t)
        x = [constant, cosine] if self.symmetric else [constant, cosine, sine]
        y = [sine] if self.symmetric else [constant, cosine, sine]
        x, y = np.concatenate(x), np.concatenate(y)
        out = np.zeros((self.count, 2, nodes))
        out[: len(x), 0], out[len(x) :, 1] = x, y
        return out / (2 * np.pi)

    def weights(self, nodes: int) -> Float[AnyArray, " nodes"]:
        """Return the quadrature weights of the nodes for integrals over t."""
        return np.full(nodes, 2 * np.pi / nodes)
