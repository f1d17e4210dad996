"""Device memory: addresses that host code cannot touch, and the memory behind them.

What nobody wrote and what was freed holds floats that are not numbers. A block that was freed is not used
again before ``KEPT_BACK`` others of its size, so that whoever still uses it reads those.
"""

from __future__ import annotations

import bisect
import ctypes
import mmap
from collections import defaultdict, deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.fake_cuda import options

NEW, FREED = 0x7FC0BEEF, 0x7FDEAD00
"""Words of memory that was never written and of freed memory, neither of them a number."""

KEPT_BACK = 8

NO_ACCESS, MAP_NORESERVE = 0, 0x4000
"""Constants of Linux that ``mmap`` lacks."""

libc = ctypes.CDLL(None, use_errno=True)
libc.mmap.restype = ctypes.c_void_p
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]


def reserve(size: int, access: int) -> int:
    """Return the address of ``size`` bytes that take memory once they are written."""
    flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | MAP_NORESERVE
    address = libc.mmap(None, size, access, flags, -1, 0)
    if address == ctypes.c_void_p(-1).value:
        raise OSError(ctypes.get_errno(), "device memory cannot be reserved")
    return int(address)


@dataclass
class Block:
    """An allocation."""

    address: int
    size: int
    """Bytes that were asked for."""
    room: int
    """Bytes that it takes; 0: it is memory of PyTorch's."""
    device: int
    capture: object = None
    """The capture of which it became part."""
    freed: bool = field(default=False)
    """Whether it was freed; its memory is given back once the work before is done."""

    @property
    def rounded(self) -> int:
        """Its size in whole words."""
        return (self.size + 3) // 4 * 4


class Region:
    """All device memory of a process."""

    def __init__(self) -> None:
        self.size = 2 * options.memory * options.devices + (64 << 20)
        memory = reserve(self.size, mmap.PROT_READ | mmap.PROT_WRITE)
        self.base = reserve(self.size, NO_ACCESS) if options.protect else memory
        self.shift = memory - self.base
        """Offset from the address that host code knows to the memory itself."""
        self.top = self.base
        self.blocks: dict[int, Block] = {}
        self.addresses: list[int] = []
        self.spare: defaultdict[int, deque[int]] = defaultdict(deque)
        self.used = [0] * options.devices

    def words(self, address: int, count: int) -> NDArray[np.uint32]:
        """Return ``count`` words at an address."""
        return np.ctypeslib.as_array((ctypes.c_uint32 * count).from_address(address + self.shift))

    def typed(self, address: int, count: int, dtype: Any) -> NDArray[Any]:
        """Return ``count`` numbers at an address."""
        return self.words(address, count * np.dtype(dtype).itemsize // 4).view(dtype)

    def show(self, value: ctypes.Structure) -> None:
        """Turn the addresses in a C structure into those of the memory."""
        for name, kind, *_ in value._fields_:
            field = getattr(value, name)
            if isinstance(field, ctypes.Structure):
                self.show(field)
            elif kind in (ctypes.c_uint64, ctypes.c_void_p) and field and self.holds(field):
                setattr(value, name, field + self.shift)

    def allocate(self, size: int, device: int) -> Block | None:
        """Return a new block, or None where memory is short."""
        if self.used[device] + size > options.memory:
            return None
        room = -(-max(size, 1) // 512) * 512
        if len(self.spare[room]) > KEPT_BACK or self.top + room > self.base + self.size:
            if not self.spare[room]:
                return None
            start = self.spare[room].popleft()
        else:
            start, self.top = self.top, self.top + room
        block = Block(start, size, room, device)
        self.fill(block, NEW)
        self.add(block)
        self.used[device] += size
        return block

    def add(self, block: Block) -> None:
        """Note a block, which may lie in memory of other programs' own."""
        self.blocks[block.address] = block
        bisect.insort(self.addresses, block.address)

    def fill(self, block: Block, word: int) -> None:
        """Fill a block with a word."""
        self.words(block.address, block.rounded // 4)[:] = word

    def release(self, block: Block) -> None:
        """Give the memory of a block back."""
        self.fill(block, FREED)
        del self.blocks[block.address]
        del self.addresses[bisect.bisect_left(self.addresses, block.address)]
        self.used[block.device] -= block.size
        self.spare[block.room].append(block.address)

    def find(self, address: int) -> Block | None:
        """Return the block that holds an address, unless it was given back."""
        at = bisect.bisect(self.addresses, address) - 1
        block = self.blocks[self.addresses[at]] if at >= 0 else None
        return block if block and address < block.address + max(block.size, 1) else None

    def holds(self, address: int) -> bool:
        """Return whether an address is one of device memory."""
        return self.base <= address < self.base + self.size

    def fault(self, address: int, size: int, device: int) -> str:
        """Return what is wrong with a device's access to memory; empty: nothing."""
        if not size:
            return ""
        block = self.find(address)
        if block is None:
            return "memory that was freed" if self.holds(address) else "memory of the host"
        if address + size > block.address + block.size:
            return f"{size} bytes at {address - block.address} of a block of {block.size}"
        return "" if block.device == device else f"memory of device {block.device} on device {device}"
