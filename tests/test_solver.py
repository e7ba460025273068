"""GMRES and Newton's method on problems whose solution is known."""

import re

import jax
import jax.numpy as jnp
import numpy as np

from surrogate.arrays import by_lapack
from surrogate.flow.solver.krylov import gmres
from surrogate.flow.solver.newton import Identity, NewtonSettings, System, root


def test_exact_gmres_stops_at_the_first_vector_that_reaches_the_tolerance():
    matrix = jnp.diag(jnp.array([1.0, 1.0, 2.0, 2.0, 3.0, 3.0]))  # three eigenvalues: three vectors
    solve = jax.jit(lambda right: gmres(lambda x: matrix @ x, right, 1e-12, 6))
    result = solve(jnp.ones(6))
    assert int(result.steps) == 3
    assert np.allclose(matrix @ result.x, 1.0)
    assert bool(solve(jnp.zeros(6)).converged)
    assert not bool(solve(jnp.full(6, jnp.nan)).converged)


def test_gmres_in_single_precision_reaches_its_tolerance():
    """By projecting new vectors twice: once leaves them so far from orthogonal that it stalls."""
    rng, size = np.random.default_rng(0), 20_000
    scale = jnp.asarray(np.exp(rng.uniform(-1.5, 1.5, size)), jnp.float32)
    right = jnp.asarray(rng.normal(size=size) + 3.0, jnp.float32)

    def product(x):
        return scale * x + 0.3 * jnp.roll(x, 1)

    found = gmres(product, right, 1e-6, 60)
    assert bool(found.converged)
    assert found.x.dtype == jnp.float32
    exact = product(found.x.astype(float)) - right
    assert float(jnp.linalg.norm(exact) / jnp.linalg.norm(right)) < 3e-6


def test_gmres_in_single_precision_needs_no_more_vectors_than_in_double():
    """With outlying eigenvalues Krylov vectors lose their orthogonality early."""
    outliers = np.geomspace(0.1, 1e4, 60)
    scale = jnp.asarray(np.concatenate([1.0 + outliers, np.ones(540)]))
    right = jnp.asarray(np.random.default_rng(0).normal(size=600))

    def steps(kind):
        own = scale.astype(kind)
        return int(gmres(lambda x: own * x, right.astype(kind), 1e-5, 60).steps)

    double = steps(jnp.float64)
    assert 20 < double < 60
    assert steps(jnp.float32) <= double + 1


def test_exact_a_batch_of_systems_is_solved_as_one_by_one():
    """Each stops at the vector that suffices for it; no Krylov vectors of a batch are copied."""
    rng = np.random.default_rng(0)
    spread = np.linspace(0.1, 3.0, 5)[:, None, None]
    matrices = jnp.asarray(np.eye(30) + 0.1 * spread * rng.normal(size=(5, 30, 30)))
    rights = jnp.asarray(rng.normal(size=(5, 30))).at[3].set(0.0)

    def solve(matrix, right):
        return gmres(lambda x: matrix @ x, right, 1e-8, 25)

    found, one_by_one = jax.jit(jax.vmap(solve))(matrices, rights), jax.jit(solve)
    assert len(set(found.steps.tolist())) > 2
    for k, (matrix, right) in enumerate(zip(matrices, rights, strict=True)):
        alone = one_by_one(matrix, right)
        assert alone.steps == found.steps[k]
        assert alone.converged == found.converged[k]
        np.testing.assert_allclose(found.x[k], alone.x, rtol=1e-12, atol=1e-12)
    shared = jax.jit(jax.vmap(solve, (None, 0)))(matrices[0], rights)
    np.testing.assert_allclose(shared.x[0], found.x[0], rtol=1e-12, atol=1e-12)
    nested = jax.jit(jax.vmap(jax.vmap(solve, (None, 0)), (0, None)))(matrices[:2], rights)
    np.testing.assert_allclose(nested.x[0], shared.x, rtol=1e-12, atol=1e-12)

    def along(right):
        return jax.jvp(lambda b: solve(matrices[0], b).x, (right,), (jnp.ones(30),))

    values, _ = jax.jit(jax.vmap(along))(rights)
    np.testing.assert_allclose(values[0], found.x[0], rtol=1e-12, atol=1e-12)
    program = str(jax.make_jaxpr(jax.vmap(solve))(matrices, rights))
    assert set(re.findall(r":f64\[5,28,30\] = (\w+)", program)) == {"broadcast_in_dim", "scatter"}


def test_exact_matrices_of_a_batch_are_factored_one_after_the_other():
    """On a CPU: batches of LAPACK's wait for threads that may wait for them."""
    matrices = jnp.asarray(np.random.default_rng(0).normal(size=(6, 4, 4)))
    inverse = jax.vmap(by_lapack(jnp.linalg.inv))
    np.testing.assert_allclose(inverse(matrices), jnp.linalg.inv(matrices), rtol=1e-12)
    program = str(jax.make_jaxpr(inverse)(matrices))
    assert ("scan" in program) == (jax.default_backend() == "cpu")
    nested = str(jax.make_jaxpr(jax.vmap(inverse))(matrices[:, None]))
    if jax.default_backend() == "cpu":
        assert set(re.findall(r":f64(\[[\d,]*\])[^=]*= lu ", nested)) == {"[4,4]"}
    mixed = jax.vmap(by_lapack(jnp.linalg.solve), (0, None))(matrices, jnp.ones(4))
    np.testing.assert_allclose(mixed[2], jnp.linalg.solve(matrices[2], jnp.ones(4)), rtol=1e-12)


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
    assert int(info.convolutions) > 2 * int(info.steps)
    at_the_root, info = newton(circle_and_line, np.sqrt([0.5, 0.5]))
    assert bool(info.converged)
    assert (int(info.steps), int(info.convolutions)) == (0, 1)
    np.testing.assert_array_equal(at_the_root, np.sqrt([0.5, 0.5]))


def test_newton_ends_at_its_limit_and_at_no_number():
    _, info = newton(circle_and_line, [2.0, 1.0], max_steps=1)
    assert int(info.steps) == 1
    assert not bool(info.converged)
    _, info = newton(circle_and_line, [2.0, 1.0], radius=jnp.nan)
    assert (int(info.steps), int(info.convolutions)) == (0, 1)
    assert not bool(info.converged)


def test_newton_compiles_its_residual_once_in_each_precision():
    """Every further copy of a flow's residual costs about a second of compilation."""
    seen = []

    def residual(radius, x):
        seen.append(str(x.dtype))
        return circle_and_line(radius, x)

    jax.make_jaxpr(lambda guess: newton(residual, guess)[0])(jnp.ones(2))
    assert sorted(seen) == ["float32", "float64"]
