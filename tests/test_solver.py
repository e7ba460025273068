"""GMRES and Newton's method on problems whose solution is known."""

import jax
import jax.numpy as jnp
import numpy as np

from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.newton import Identity, NewtonSettings, System, root


def test_exact_gmres_stops_at_the_first_vector_that_reaches_the_tolerance():
    matrix = jnp.diag(jnp.array([1.0, 1.0, 2.0, 2.0, 3.0, 3.0]))  # three eigenvalues: three vectors
    result = gmres(lambda x: matrix @ x, jnp.ones(6), 1e-12, 6)
    assert int(result.steps) == 3
    assert np.allclose(matrix @ result.x, 1.0)
    assert bool(gmres(lambda x: matrix @ x, jnp.zeros(6), 1e-12, 6).converged)
    assert not bool(gmres(lambda x: matrix @ x, jnp.full(6, jnp.nan), 1e-12, 6).converged)


def circle_and_line(radius, x):
    """Residual of the point where the circle about the origin meets the diagonal."""
    return jnp.array([x[0] ** 2 + x[1] ** 2 - radius**2, x[0] - x[1]])


def newton(residual, guess, radius=1.0, **settings):
    system = System(residual, jnp.array(radius), Identity())
    return root(system, jnp.asarray(guess), jnp.linalg.norm, NewtonSettings(**settings))


def test_exact_newton_finds_the_root_and_counts_its_work():
    """The residual at the guess is one product and no step."""
    x, info = newton(circle_and_line, [2.0, 1.0])
    np.testing.assert_allclose(x, np.sqrt([0.5, 0.5]), rtol=1e-6)
    assert bool(info.converged)
    assert 3 <= int(info.steps) <= 8
    assert int(info.products) > 2 * int(info.steps)
    at_the_root, info = newton(circle_and_line, np.sqrt([0.5, 0.5]))
    assert bool(info.converged)
    assert (int(info.steps), int(info.products)) == (0, 1)
    np.testing.assert_array_equal(at_the_root, np.sqrt([0.5, 0.5]))


def test_newton_ends_at_its_limit_and_at_no_number():
    _, info = newton(circle_and_line, [2.0, 1.0], max_steps=1)
    assert int(info.steps) == 1
    assert not bool(info.converged)
    _, info = newton(circle_and_line, [2.0, 1.0], radius=jnp.nan)
    assert (int(info.steps), int(info.products)) == (0, 1)
    assert not bool(info.converged)


def test_newton_compiles_its_residual_once_in_each_precision():
    """Every further copy of a flow's residual costs about a second of compilation."""
    seen = []

    def residual(radius, x):
        seen.append(str(x.dtype))
        return circle_and_line(radius, x)

    jax.make_jaxpr(lambda guess: newton(residual, guess)[0])(jnp.ones(2))
    assert sorted(seen) == ["float32", "float64"]
