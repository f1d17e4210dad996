"""The device that kernels run on, CPU threads, division of tiles; and the arrays of a stage."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeVar

import numpy as np
import warp as wp

from warpsplat.kernels import constants, lanes
from warpsplat.kernels.tile import quad, tile_column
from warpsplat.native import available_cores
from warpsplat.rendering.program import Program
from warpsplat.rendering.tiles import tile_counts
from warpsplat.scene import FloatArray

Buffers = TypeVar("Buffers")

LINE = 64
"""Bytes of a line of a CPU's cache. Arrays begin at multiples of it, so that a column of pixels takes one
line and not parts of two: the coverages of 512 shapes took half as long again."""

GPU_LANES = constants.TILE_PIXELS // constants.QUAD
"""Threads a tile on a GPU."""

THREADS_PER_CORE = 8
"""Most threads that a split launch is cut for: more only wait, and cost memory for pieces and stacks."""


USUAL_THREADS = 8
"""Most threads unless more are asked for: those that share a launch wait for each other and for Python's
lock. With 512 shapes at 768x512 px, 200 steps took 7.0 s on one thread of 16 cores, 3.5 s on four and on
eight, and 5.1 s on all 16."""


@dataclass(frozen=True)
class Viewport:
    """Size of the image that is rendered."""

    width: int
    """[px]"""
    height: int
    """[px]"""
    scale: float = 1.0
    """[px a canvas unit]"""

    @property
    def tiles_x(self) -> int:
        """Tiles in a row."""
        return tile_counts(self.width, self.height)[0]

    @property
    def tiles_y(self) -> int:
        """Tiles in a column."""
        return tile_counts(self.width, self.height)[1]

    @property
    def tile_count(self) -> int:
        """Tiles in all."""
        return self.tiles_x * self.tiles_y

    @property
    def pixel_count(self) -> int:
        """Pixels in all."""
        return self.width * self.height


@dataclass(frozen=True)
class Backend:
    """A device and how work is divided on it. The result does not depend on ``threads``."""

    device: wp.Device
    threads: int
    """CPU threads that share a launch; 1 on a GPU."""
    lanes: int
    """Threads a tile, 1 or GPU_LANES: a CPU keeps a tile in one thread's cache; a GPU's threads have a vector
    of QUAD pixels each, so that they need few registers and neighbours read neighbouring memory. Divisors of
    GPU_LANES, from 4 on, work as well."""

    @staticmethod
    def on(device: wp.Device | str | None = None, threads: int | None = None) -> Backend:
        """Return the usual division on ``device`` (default: Warp's).

        ``threads``: of a CPU, THREADS_PER_CORE a core at most; default: one a core, up to
        USUAL_THREADS.
        """
        chosen = wp.get_device(device)
        if chosen.is_cpu:
            cores = available_cores()
            return Backend(
                chosen, max(1, min(threads or min(cores, USUAL_THREADS), THREADS_PER_CORE * cores)), 1
            )
        return Backend(chosen, 1, GPU_LANES)

    @property
    def column(self) -> Any:
        """Type of the vectors of pixels that kernels are made for; see ``kernels.tile``."""
        return tile_column if self.lanes == 1 else quad

    @property
    def columns(self) -> int:
        """Vectors of pixels in a tile."""
        return int(constants.TILE_PIXELS // self.column._length_)

    @property
    def lane_columns(self) -> int:
        """Vectors of a tile that a lane handles."""
        return self.columns // self.lanes

    @property
    def row_lanes(self) -> int:
        """Threads a tile in kernels that go by rows of pixels: one, or one a row."""
        return min(self.lanes, constants.TILE)

    def program(self, stage: str = "") -> Program:
        """An empty program for this backend."""
        return Program(self.device, self.threads, stage)

    def array(self, dtype: Any, *shape: int) -> wp.array:
        """Return a zeroed array.

        On a CPU it begins at a line of the cache, and a large one takes zeroed pages from the system, each
        when it is first used: many are larger than a scene needs, and clearing them took a third of the time
        of a drawing's renders.
        """
        if not self.device.is_cpu:
            return wp.zeros(shape, dtype=dtype, device=self.device)
        size = math.prod(shape) * wp.types.type_size_in_bytes(dtype)
        memory = np.zeros(size + LINE, np.uint8)
        return wp.array(
            ptr=memory.ctypes.data + -memory.ctypes.data % LINE,
            dtype=dtype,
            shape=shape,
            device=self.device,
            deleter=functools.partial(_release, memory),
        )

    def columns_of(self, tiles: FloatArray) -> wp.array:
        """Return a copy of tiles, shape (..., TILE, TILE), on the device as vectors, shape (..., columns)."""
        values = tiles.reshape(*tiles.shape[:-2], self.columns, -1)
        return wp.array(values, dtype=self.column, device=self.device)

    def lane_sums(self, by_lane: wp.array) -> FloatArray:
        """Return sums over the lanes, the last dimension, on the host. They are summed up where they are: a
        GPU has so many that copying them would take longer.
        """
        *shape, lane_count = by_lane.shape
        sums = by_lane
        if lane_count > 1:
            count = math.prod(shape)
            sums = self.array(wp.float32, count)
            program = self.program()
            program.launch(
                lanes.lane_sums, count, by_lane=view(by_lane, wp.float32, (count, lane_count)), sums=sums
            )
            program.run()
        return np.asarray(sums.numpy()).reshape(shape)

    def allocate(self, buffers: type[Buffers], sizes: Mapping[str, int]) -> Buffers:
        """Allocate zeroed arrays for all fields of a dataclass made of ``buffer`` fields.

        Args:
            buffers: the dataclass.
            sizes: what the names of dimensions stand for, besides "columns".
        """
        sizes = {"columns": self.columns, **sizes}
        arrays: dict[str, wp.array] = {}
        for item in fields(buffers):  # type: ignore[arg-type]
            dtype, dimensions, memory = (item.metadata[key] for key in ("dtype", "dimensions", "memory_of"))
            dtype = dtype or self.column
            shape = tuple(sizes[d] if isinstance(d, str) else d for d in dimensions)
            arrays[item.name] = view(arrays[memory], dtype, shape) if memory else self.array(dtype, *shape)
        return buffers(**arrays)


def _release(memory: np.ndarray, pointer: int, size: int) -> None:
    """Keep the memory of an array alive until Warp drops the array and calls this."""


def buffer(dtype: Any, *dimensions: str | int, memory_of: str = "") -> Any:
    """Declare a field of a dataclass of device arrays.

    Args:
        dtype: of the elements; None: the backend's vectors of pixels, ``Backend.column``.
        dimensions: numbers, or names that ``Backend.allocate`` is given the sizes of, or "columns".
        memory_of: an earlier field whose memory this one reads as another type.
    """
    return field(metadata={"dtype": dtype, "dimensions": dimensions, "memory_of": memory_of})


def view(array: wp.array, dtype: Any, shape: tuple[int, ...]) -> wp.array:
    """Return the same memory as ``array``, read as ``shape`` elements of ``dtype``."""
    same: Any = wp.array(ptr=array.ptr, dtype=dtype, shape=shape, device=array.device, copy=False)
    same._ref = array  # as Warp's own views do: a program must keep the memory that its launches address
    return same
