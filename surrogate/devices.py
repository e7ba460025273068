"""Devices over which bodies are spread: each owns its bodies, all share the small answers.

The mesh has one axis, ``bodies``. Solvers loop inside ``jax.shard_map``, so that a device stops
when its own bodies are done; on each of them ``lanes`` bodies are solved at once.
"""

import dataclasses
import functools
from collections.abc import Callable, Iterator
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P
from jaxtyping import Array, Bool, Float, Int, PyTree

from surrogate.arrays import AnyArray, Number
from surrogate.checks import whole_number
from surrogate.errors import InvalidInput
from surrogate.processes import together

AXIS = "bodies"
LANES = {"cpu": 1}  # elsewhere as below
ELSEWHERE = 32
CHUNK = 64  # bodies of a device whose fields are fetched at once, at least


class Sharded(eqx.Module):
    """Arrays with a row for every body, each on the device that owns the body."""

    rows: PyTree


@dataclasses.dataclass(frozen=True)
class Devices:
    """A mesh of devices, and how many bodies each of them solves at once."""

    mesh: Mesh
    lanes: int = 1

    @property
    def count(self) -> int:
        return self.mesh.size

    @property
    def options(self) -> dict[str, str]:
        """Of the compiler, so that bodies get the same answers on any number of devices.

        XLA simplifies once more what it partitions, and so rounds differently; without that pass
        flows are as they are everywhere, and take a twentieth longer on a CPU.
        """
        on_cpu = self.mesh.devices.flat[0].platform == "cpu"
        return {"xla_disable_hlo_passes": "algsimp"} if on_cpu else {}

    def share(self, tree: PyTree) -> PyTree:
        """The same on every device, but of what is ``Sharded`` to each its rows."""
        places = jax.tree.map(lambda spec: NamedSharding(self.mesh, spec), specs(tree))
        return jax.device_put(tree, places)

    def local(self, tree: PyTree) -> PyTree:
        """Of what is the same on every device, the copy of this process's first one."""
        return jax.tree.map(
            lambda leaf: leaf.addressable_data(0) if isinstance(leaf, jax.Array) else leaf, tree
        )

    def spread(self, function: Callable, like: tuple, answers: PyTree) -> Callable:
        """``function`` run by every device on arguments like these, with answers like those."""
        return jax.shard_map(
            function,
            mesh=self.mesh,
            in_specs=specs(like),
            out_specs=specs(answers),
            check_vma=False,
        )


def map_over_devices(devices: Devices, function: Callable, model: PyTree, rows: PyTree) -> PyTree:
    """``function(model, *rows)`` by every device on its share of the rows; answers on the host."""
    count = len(jax.tree.leaves(rows)[0])
    taken = np.arange(-(-count // devices.count) * devices.count) % count
    rows = Sharded(jax.tree.map(lambda leaf: np.asarray(leaf)[taken], rows))
    answers = _by_all(devices, function)(*devices.share((model, rows)))
    return jax.tree.map(lambda leaf: together(leaf)[:count], answers.rows)


@functools.cache
def _by_all(devices, function):
    @jax.jit
    def by_all(model, rows):
        def local(model, mine):
            return Sharded(function(model, *mine.rows))

        return devices.spread(local, (model, rows), Sharded(()))(model, rows)

    return by_all


def choose_devices(count: Number | None = None, lanes: Number | None = None) -> Devices:
    """So many devices, the first of all; one where nothing is said, all of many processes.

    Raises:
      InvalidInput: there are not so many.
    """
    every = jax.devices()
    if count is None:
        count = len(every) if jax.process_count() > 1 else 1
    count = whole_number("devices", count, 1, 10**6)
    if count > len(every):
        raise InvalidInput(
            f"devices {count}: JAX has {len(every)} here; CPU cores become devices by "
            "jax.config.update('jax_num_cpu_devices', N) before the first computation"
        )
    lanes = LANES.get(every[0].platform, ELSEWHERE) if lanes is None else lanes
    return Devices(Mesh(np.array(every[:count]), (AXIS,)), whole_number("lanes", lanes, 1, 4096))


def specs(tree: PyTree) -> PyTree:
    """Partition of a tree over the mesh."""

    def owned(node):
        return isinstance(node, Sharded)

    return jax.tree.map(lambda node: P(AXIS) if owned(node) else P(), tree, is_leaf=owned)


class Evaluated(NamedTuple):
    """Of a visit to some bodies: everybody's answers, what owners keep, G spent by idle_work."""

    answers: PyTree
    owned: Sharded
    idle_work: Int[Array, ""]


class Partition(eqx.Module):
    """Which row is whose: ``places`` of the bodies, the first device's rows first."""

    places: Int[AnyArray, " bodies"]
    devices: Devices = eqx.field(static=True)

    @property
    def rows(self) -> int:
        """Of every device; the last of one may be nobody's."""
        return -(-self.places.size // self.devices.count)

    def scatter(self, bodies: PyTree) -> Sharded:
        """Rows of arrays of the bodies; those that are nobody's repeat the first body."""
        sources = np.zeros(self.rows * self.devices.count, int)
        sources = jnp.asarray(sources).at[self.places].set(jnp.arange(self.places.size))
        return Sharded(jax.tree.map(lambda leaf: leaf[sources], bodies))

    def gather(self, owned: Sharded) -> PyTree:
        """Arrays in the order of the bodies, the same on every device."""
        whole = NamedSharding(self.devices.mesh, P())
        return jax.tree.map(
            lambda leaf: jax.lax.with_sharding_constraint(leaf[self.places], whole), owned.rows
        )

    def chunks(self, batch: Int[np.ndarray, " batch"]) -> Iterator[Int[np.ndarray, " chunk"]]:
        """A batch in chunks of one size, the last filled up with nobody.

        Every device has as many bodies of each, and alike hard ones.
        """
        size = min(batch.size, max(CHUNK, 8 * self.devices.lanes) * self.devices.count)
        batch = batch[np.argsort(np.asarray(self.places)[batch] % self.rows, kind="stable")]
        nobody = np.full(-batch.size % size, self.places.size)
        yield from np.append(batch, nobody).reshape(-1, size)

    def each(self, function: Callable, owned: Sharded) -> Sharded:
        """What ``function`` answers of every row, by its owner; to be traced."""
        lanes = self.devices.lanes

        def local(mine):
            return Sharded(
                jax.lax.map(function, mine.rows, batch_size=lanes if lanes > 1 else None)
            )

        return self.devices.spread(local, (owned,), Sharded(()))(owned)

    def take_local(self, batch: Int[Array, " batch"], owned: Sharded) -> Sharded:
        """The rows of a batch that this device owns, in the order of its visits; in ``spread``."""
        rows, _ = self._mine(batch)
        return Sharded(jax.tree.map(lambda leaf: leaf[rows.at], owned.rows))

    def put_local(self, batch: Int[Array, " batch"], owned: Sharded, fetched: Sharded) -> Sharded:
        """``owned`` with the rows of a batch as they are after its visits; in ``spread``."""
        rows, _ = self._mine(batch)
        at = jnp.where(jnp.arange(rows.at.size) < rows.count, rows.at, self.rows)
        return Sharded(
            jax.tree.map(
                lambda leaf, new: leaf.at[at].set(new, mode="drop"), owned.rows, fetched.rows
            )
        )

    def evaluate(
        self, batch: Int[Array, " batch"], fetched: Sharded, function: Callable, *arguments: PyTree
    ) -> Evaluated:
        """``function(row, own, *sample) -> (answer, own)`` of a batch by its owners; in ``spread``.

        Numbers beyond the bodies' are nobody's, and are answered by noughts. ``own`` is the body's
        row of ``fetched``, ``sample`` its part of ``arguments``; answers have a field ``products``.
        One after another, or ``lanes`` at once.
        """
        lanes, size = self.devices.lanes, batch.size
        rows, order = self._mine(batch)

        def take(tree, k):
            return jax.tree.map(lambda leaf: leaf[k], tree)

        def put(tree, k, new):
            return jax.tree.map(lambda leaf, new: leaf.at[k].set(new, mode="drop"), tree, new)

        def turn(i, carry):
            answers, kept, busy = carry
            row = i if lanes == 1 else i * lanes + jnp.arange(lanes)
            k = jnp.where(row < rows.count, order[row], size)  # out of range where there is nobody
            step = function if lanes == 1 else jax.vmap(function)
            answer, own = step(row, take(kept, row), *take(arguments, k))
            busy += lanes * jnp.max(answer.products)
            return put(answers, k, answer), put(kept, row, own), busy

        one = take(fetched.rows, 0), take(arguments, 0)
        blank = jax.eval_shape(lambda row, one: function(row, one[0], *one[1])[0], 0, one)
        blank = jax.tree.map(lambda leaf: jnp.zeros((size, *leaf.shape), leaf.dtype), blank)
        turns, start = -(-rows.count // lanes), (blank, fetched.rows, jnp.array(0))
        answers, kept, busy = jax.lax.fori_loop(0, turns, turn, start)
        answers = jax.tree.map(_everybodys, answers)
        idle_work = self.devices.count * jax.lax.pmax(busy, AXIS) - jnp.sum(answers.products)
        return Evaluated(answers, Sharded(kept), idle_work)

    def _mine(self, batch):
        """Rows of this device in a batch, then others; the places in the batch in that order."""
        places = self.places[batch]
        mine = places // self.rows == jax.lax.axis_index(AXIS)
        mine &= batch < self.places.size
        order = jnp.argsort(jnp.where(mine, places % self.rows, self.rows), stable=True)
        at = places[order[: self.rows]] % self.rows
        return _Rows(at, jnp.sum(mine)), jnp.append(order, jnp.full(self.devices.lanes, batch.size))


class _Rows(NamedTuple):
    """Rows of one device, of which the first ``count`` are meant."""

    at: Int[Array, " rows"]
    count: Int[Array, ""]


def compute_where(wanted: Bool[Array, ""], compute: Callable, otherwise: PyTree) -> PyTree:
    """``compute()`` or else ``otherwise``; of many lanes not at all unless one of them wants it.

    A loop of one turn or none: what ``lax.cond`` chooses lane by lane, it computes for all.
    """

    def turn(_):
        return jnp.zeros_like(wanted), compute()

    return jax.lax.while_loop(lambda carry: carry[0], turn, (wanted, otherwise))[1]


def _everybodys(leaf):
    """A sum to which one device alone contributes each row: nothing is rounded."""
    total = jax.lax.psum(leaf.astype(int) if leaf.dtype == bool else leaf, AXIS)
    return total.astype(leaf.dtype)


def partition_bodies(devices: Devices, estimated_cost: Float[AnyArray, " bodies"]) -> Partition:
    """Bodies to devices, hard and easy ones to each alike, and in order of estimated_cost."""
    bodies = len(estimated_cost)
    rank = np.empty(bodies, int)
    rank[np.argsort(-np.asarray(estimated_cost), kind="stable")] = np.arange(bodies)
    turn, seat = np.divmod(rank, devices.count)
    owner = np.where(turn % 2, devices.count - 1 - seat, seat)
    return Partition(owner * -(-bodies // devices.count) + turn, devices)
