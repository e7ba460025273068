"""Data parallelism over bodies: a one-dimensional JAX mesh and arrays that are sharded over it.

The flows of different bodies are independent. Each device solves the bodies of its shard inside
``jax.shard_map``, so that its loops end when its own bodies have converged. Inputs and results
of a few numbers per body are replicated on all devices. ``surrogate/training/README.md`` says why
results do not depend on the number of devices, as long as there are no more than cores.
"""

import dataclasses
import functools
from collections.abc import Callable

import equinox as eqx
import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding
from jax.sharding import PartitionSpec as P
from jaxtyping import PyTree

from surrogate.arrays import Number
from surrogate.checks import whole_number
from surrogate.compilation import compiled, same_options
from surrogate.errors import InvalidInput
from surrogate.processes import gather_to_host

AXIS = "bodies"  # of the mesh
# Default batch size per device. On a CPU 1 is fastest (study ``devices``). On a GPU larger batches
# are faster (study ``accelerator``), as far as the memory allows.
DEVICE_BATCH = {"cpu": 1}
ACCELERATOR_BATCH = 32


class Sharded(eqx.Module):
    """A pytree of arrays with one row per body, split over the devices along the first axis."""

    rows: PyTree


@dataclasses.dataclass(frozen=True)
class Devices:
    """A mesh of devices, and ``device_batch``: the batch size per device.

    ``device_batch`` bodies are solved simultaneously on one device by ``jax.vmap``.
    """

    mesh: Mesh
    device_batch: int = 1

    @property
    def count(self) -> int:
        """Number of devices."""
        return self.mesh.size

    def place(self, tree: PyTree) -> PyTree:
        """Put a pytree on the mesh: ``Sharded`` arrays split by body, all else replicated."""
        shardings = jax.tree.map(lambda spec: NamedSharding(self.mesh, spec), specs(tree))
        return jax.device_put(tree, shardings)

    def local(self, tree: PyTree) -> PyTree:
        """Return the copy of a replicated pytree on the first device of this process."""
        return jax.tree.map(
            lambda leaf: leaf.addressable_data(0) if isinstance(leaf, jax.Array) else leaf, tree
        )

    def shard_map(self, function: Callable, like: tuple, results: PyTree) -> Callable:
        """Return ``jax.shard_map`` of ``function`` over the mesh.

        Args:
          function: called on every device, with this device's shards.
          like: tuple of its arguments, or of the same structure: ``Sharded`` parts are split over
            the devices, all others replicated.
          results: the same for its results.
        """
        return jax.shard_map(
            function,
            mesh=self.mesh,
            in_specs=specs(like),
            out_specs=specs(results),
            check_vma=False,
        )


def specs(tree: PyTree) -> PyTree:
    """Return the partition specs of a pytree.

    ``Sharded`` nodes are split along the mesh axis, all else is replicated.
    """
    return jax.tree.map(lambda node: P(AXIS) if is_sharded(node) else P(), tree, is_leaf=is_sharded)


def is_sharded(node: PyTree) -> bool:
    """Return whether a node of a pytree is ``Sharded``."""
    return isinstance(node, Sharded)


def choose_devices(count: Number | None = None, device_batch: Number | None = None) -> Devices:
    """Select the first ``count`` devices; by default one, or all of a multi-process run.

    Args:
      count: number of devices.
      device_batch: batch size per device; by default 1 on a CPU, 32 elsewhere.

    Raises:
      InvalidInput: JAX has fewer devices, or a number is out of range.
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
    if device_batch is None:
        device_batch = DEVICE_BATCH.get(every[0].platform, ACCELERATOR_BATCH)
    device_batch = whole_number("device_batch", device_batch, 1, 4096)
    return Devices(Mesh(np.array(every[:count]), (AXIS,)), device_batch)


def map_over_devices(devices: Devices, function: Callable, model: PyTree, rows: PyTree) -> PyTree:
    """Evaluate ``function(model, *row)`` for every row, with the rows split over the devices.

    On one device this is a call for each row, so that any number of rows is one program.

    Args:
      devices: the mesh; the rows are padded to a multiple of their number.
      function: of a model and the arrays of one row; returns arrays.
      model: pytree that is replicated.
      rows: tuple of arrays with the same number of rows.

    Returns:
      The results of all rows, in their order, on the host.
    """
    count = len(jax.tree.leaves(rows)[0])
    if devices.count == jax.process_count() == 1:
        single = (jax.tree.map(lambda leaf, k=k: leaf[k], rows) for k in range(count))
        results = [_on_one_device(function, model, row) for row in single]
        return jax.tree.map(lambda *leaves: np.stack(leaves), *results)
    padded = np.arange(-(-count // devices.count) * devices.count) % count
    rows = Sharded(jax.tree.map(lambda leaf: np.asarray(leaf)[padded], rows))
    results = _mapped(devices, function)(*devices.place((model, rows)))
    return jax.tree.map(lambda leaf: gather_to_host(leaf)[:count], results.rows)


@compiled("function", options=lambda *_: same_options())
def _on_one_device(function, model, row):
    return function(model, *row)


@functools.cache
def _mapped(devices, function):
    def mapped(model, rows):
        def local(model, shard):
            return Sharded(jax.lax.map(lambda row: function(model, *row), shard.rows))

        return devices.shard_map(local, (model, rows), Sharded(()))(model, rows)

    return jax.jit(mapped, compiler_options=same_options())
