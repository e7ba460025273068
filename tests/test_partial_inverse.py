"""The partial inverse of HIG against the singular value decomposition that defines it."""

import jax.numpy as jnp
import numpy as np
import pytest

from surrogate.training.methods.partial_inverse import partial_inverse, partial_inverse_lanczos


def test_exact_half_inverse_is_the_svd_formula(generator):
    jacobian = generator.normal(size=(6, 20)) * np.logspace(0, -3, 6)[:, None]
    y = generator.normal(size=6)
    U, S, Vt = np.linalg.svd(jacobian, full_matrices=False)
    kept = 0.01 * S[0] < S
    expected = Vt.T @ (np.where(kept, S**-0.5, 0.0) * (U.T @ y))
    assert 0 < kept.sum() < 6
    assert np.allclose(partial_inverse(jnp.asarray(jacobian), jnp.asarray(y), 0.01), expected)


@pytest.mark.parametrize("shape", [(6, 20), (20, 6)])
def test_exact_limited_inverse_steps_little_further_than_gauss_newton(generator, shape):
    jacobian = generator.normal(size=shape) * np.logspace(1, -2, shape[1])
    y = generator.normal(size=shape[0])
    U, S, Vt = np.linalg.svd(jacobian, full_matrices=False)
    assert S[0] > 4
    found = partial_inverse(jnp.asarray(jacobian), jnp.asarray(y), 0.0, limited=True)
    assert np.allclose(found, Vt.T @ (np.minimum(S**-0.5, 1.5 / S) * (U.T @ y)))


@pytest.mark.parametrize("tau", [0.0, 1e-2, 0.3])
def test_exact_lanczos_inverts_as_the_dense_svd_does(generator, tau):
    """Singular values over four decades, a few vanishing, in random directions."""
    rows, weights = 40, 90
    U = np.linalg.qr(generator.normal(size=(rows, rows)))[0]
    V = np.linalg.qr(generator.normal(size=(weights, rows)))[0]
    S = np.where(np.arange(rows) < 36, np.logspace(0, -4, rows), 0.0 if tau else 1e-4)
    J, y = jnp.asarray(U * S @ V.T), jnp.asarray(generator.normal(size=rows))
    power = np.where(tau * S[0] < S, np.maximum(S, 1e-12) ** -0.5, 0.0)
    expected = V @ (power * (U.T @ y))
    free = partial_inverse_lanczos(lambda v: J @ v, lambda z: z @ J, y, tau, 0.5, rows)
    assert np.allclose(free, expected, atol=1e-5 * np.linalg.norm(expected))
