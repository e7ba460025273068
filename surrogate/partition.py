"""Assigns bodies to devices, and evaluates functions of them there, in chunks of a batch."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import NamedSharding
from jax.sharding import PartitionSpec as P
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import AnyArray
from surrogate.devices import AXIS, Devices, Sharded

CHUNK = 16  # bodies per device that are copied at once, at least: bounds the memory


class Evaluated(NamedTuple):
    """Results of a batch of bodies (replicated), their new states (sharded), and idle work.

    ``idle_work`` counts the convolutions that devices could have done while they waited for the
    slowest body of a batch.
    """

    results: PyTree
    states: Sharded
    idle_work: Int[Array, ""]


class Partition(eqx.Module):
    """Assignment of bodies to devices: ``places`` are their positions in sharded arrays.

    Device k holds the positions from ``k * shard_size`` to ``(k + 1) * shard_size``.
    """

    places: Int[AnyArray, " bodies"]
    devices: Devices = eqx.field(static=True)

    @property
    def shard_size(self) -> int:
        """Number of rows per device; the last row of a device may be padding."""
        return -(-self.places.size // self.devices.count)

    def scatter(self, bodies: PyTree) -> Sharded:
        """Return sharded arrays from arrays in the order of the bodies.

        Padding repeats the first body.
        """
        sources = np.zeros(self.shard_size * self.devices.count, int)
        sources = jnp.asarray(sources).at[self.places].set(jnp.arange(self.places.size))
        return Sharded(jax.tree.map(lambda leaf: leaf[sources], bodies))

    def gather(self, sharded: Sharded) -> PyTree:
        """Return replicated arrays, in the order of the bodies, from sharded ones."""
        whole = NamedSharding(self.devices.mesh, P())
        return jax.tree.map(
            lambda leaf: jax.lax.with_sharding_constraint(leaf[self.places], whole), sharded.rows
        )

    def zeros(self, shape: tuple[int, ...]) -> Sharded:
        """Return a sharded array of zeros, with this shape for every body."""
        shape = self.shard_size * self.devices.count, *shape
        sharding = NamedSharding(self.devices.mesh, P(AXIS))
        return Sharded(jnp.zeros(shape, device=sharding))

    def map(self, function: Callable, sharded: Sharded) -> Sharded:
        """Return ``function`` of every row, ``device_batch`` rows at a time on each device.

        To be traced, inside ``jax.jit``.
        """
        device_batch = self.devices.device_batch

        def local(shard):
            return Sharded(
                jax.lax.map(
                    function, shard.rows, batch_size=device_batch if device_batch > 1 else None
                )
            )

        return self.devices.shard_map(local, (sharded,), Sharded(()))(sharded)

    def chunks(
        self, batch: Int[np.ndarray, " batch"], done: Bool[AnyArray, " bodies"]
    ) -> Iterator[Int[np.ndarray, " chunk"]]:
        """Yield those bodies of a batch that are not done yet, in chunks of the same length always.

        The last is filled with the index ``places.size``, which is not evaluated. Bodies are
        ordered by their row, so that every device has as many bodies of each chunk, of similar
        cost.

        Args:
          batch: indices of bodies.
          done: whether a body has been evaluated already, for all bodies.
        """
        size = max(CHUNK, 8 * self.devices.device_batch) * self.devices.count
        batch = batch[~np.asarray(done)[batch]]
        batch = batch[np.argsort(np.asarray(self.places)[batch] % self.shard_size, kind="stable")]
        padding = np.full(-batch.size % size, self.places.size)
        yield from np.append(batch, padding).reshape(-1, size)

    def take_local(self, batch: Int[Array, " batch"], sharded: Sharded) -> Sharded:
        """Return this device's rows of a batch, in the order of ``evaluate``.

        To be called inside ``shard_map``.
        """
        rows, _, _ = self._local_rows(batch)
        return Sharded(jax.tree.map(lambda leaf: leaf[rows], sharded.rows))

    def put_local(self, batch: Int[Array, " batch"], sharded: Sharded, new: Sharded) -> Sharded:
        """Return ``sharded`` with the rows that ``take_local`` took replaced by ``new``.

        To be called inside ``shard_map``.
        """
        rows, count, _ = self._local_rows(batch)
        at = jnp.where(jnp.arange(rows.size) < count, rows, self.shard_size)
        return Sharded(
            jax.tree.map(
                lambda leaf, row: leaf.at[at].set(row, mode="drop"), sharded.rows, new.rows
            )
        )

    def evaluate(
        self,
        batch: Int[Array, " batch"],
        states: Sharded,
        function: Callable,
        arguments: PyTree,
    ) -> Evaluated:
        """Evaluate ``function`` for each body of a batch on the device that holds its row.

        To be called inside ``shard_map``.

        Args:
          batch: indices of bodies; indices of padding are not evaluated, their results are zero.
          states: this device's rows, as ``take_local`` returns them.
          function: ``(row, state, argument) -> (result, new state)``, ``row`` the index of the
            state; a result has a field ``convolutions``, the number of convolutions that it took.
          arguments: pytree with one row per entry of the batch, replicated.

        Returns:
          Results with one row per entry of the batch, this device's new states, and the idle work.
        """
        device_batch, size = self.devices.device_batch, batch.size
        _, count, order = self._local_rows(batch)

        def take(tree, k):
            return jax.tree.map(lambda leaf: leaf[k], tree)

        def put(tree, k, new):
            return jax.tree.map(lambda leaf, row: leaf.at[k].set(row, mode="drop"), tree, new)

        def step(i, carry):
            results, states, busy = carry
            row = i if device_batch == 1 else i * device_batch + jnp.arange(device_batch)
            k = jnp.where(row < count, order[row], size)  # padding is out of range
            run = function if device_batch == 1 else jax.vmap(function)
            result, state = run(row, take(states, row), take(arguments, k))
            busy += device_batch * jnp.max(result.convolutions)
            return put(results, k, result), put(states, row, state), busy

        one = 0, take(states.rows, 0), take(arguments, 0)
        blank = jax.eval_shape(lambda *one: function(*one)[0], *one)
        blank = jax.tree.map(lambda leaf: jnp.zeros((size, *leaf.shape), leaf.dtype), blank)
        steps, start = -(-count // device_batch), (blank, states.rows, jnp.array(0))
        results, new, busy = jax.lax.fori_loop(0, steps, step, start)
        results = jax.tree.map(_sum_over_devices, results)
        idle_work = self.devices.count * jax.lax.pmax(busy, AXIS) - jnp.sum(results.convolutions)
        return Evaluated(results, Sharded(new), idle_work)

    def _local_rows(self, batch):
        """Return this device's rows, how many are of the batch, and their indices in the batch.

        The rows of the batch come first.
        """
        places = self.places[batch]
        mine = places // self.shard_size == jax.lax.axis_index(AXIS)
        mine &= batch < self.places.size
        order = jnp.argsort(jnp.where(mine, places % self.shard_size, self.shard_size), stable=True)
        at = places[order[: self.shard_size]] % self.shard_size
        padding = jnp.full(self.devices.device_batch, batch.size)
        return at, jnp.sum(mine), jnp.append(order, padding)


def _sum_over_devices(leaf):
    """Sum over devices; each row is nonzero on one of them only, so that nothing is rounded."""
    total = jax.lax.psum(leaf.astype(int) if leaf.dtype == bool else leaf, AXIS)
    return total.astype(leaf.dtype)


def partition_bodies(devices: Devices, estimated_cost: Float[AnyArray, " bodies"]) -> Partition:
    """Assign bodies to devices in descending order of estimated cost, in alternating direction.

    Each device holds its bodies in the order of descending cost.
    """
    bodies = len(estimated_cost)
    rank = np.empty(bodies, int)
    rank[np.argsort(-np.asarray(estimated_cost), kind="stable")] = np.arange(bodies)
    row, column = np.divmod(rank, devices.count)
    device = np.where(row % 2, devices.count - 1 - column, column)
    return Partition(device * -(-bodies // devices.count) + row, devices)
