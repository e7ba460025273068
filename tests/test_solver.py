"""GMRES on matrices whose solution is known."""

import jax.numpy as jnp
import numpy as np

from surrogate.flow.solver.krylov import gmres


def test_exact_gmres_stops_at_the_first_vector_that_reaches_the_tolerance():
    matrix = jnp.diag(jnp.array([1.0, 1.0, 2.0, 2.0, 3.0, 3.0]))  # three eigenvalues: three vectors
    result = gmres(lambda x: matrix @ x, jnp.ones(6), 1e-12, 6)
    assert int(result.steps) == 3
    assert np.allclose(matrix @ result.x, 1.0)
    assert bool(gmres(lambda x: matrix @ x, jnp.zeros(6), 1e-12, 6).converged)
    assert not bool(gmres(lambda x: matrix @ x, jnp.full(6, jnp.nan), 1e-12, 6).converged)
