"""Renderers kept for the next call: recorded programs and buffers, by what they were recorded for."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import threading
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

import torch
import warp as wp

from warpsplat.errors import UsageError
from warpsplat.kernels import constants, pixels
from warpsplat.rendering.backend import Backend, Viewport, view
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.rendering.memory import check_memory
from warpsplat.rendering.models import Model
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program, capture
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import TRAITS, Scene
from warpsplat.torch.tensors import attributes_of

KEPT = 32
"""Engines that are kept at the most."""

KEPT_BYTES = 512 * 2**20
"""Memory beyond which only the engine used last is kept."""

SENSIBLE = {"opacities": (0.0, 1.0), "stop_opacities": (0.0, 1.0), "widths": (0.0, None)}
"""Values that mean something; what lies beyond is drawn as the nearest, and has its gradient."""


@dataclass(frozen=True)
class Picture:
    """What an engine is recorded for."""

    layout: Scene
    viewport: Viewport
    model: Model
    device: torch.device
    threads: int
    opaque: bool
    """Whether an opacity is so near to 1 that its gradient takes another adjoint."""
    straight: bool = False
    """Whether colours are not premultiplied."""

    @functools.cached_property
    def key(self) -> tuple[object, ...]:
        """Equal where the same engine serves."""
        return layout_key(self.layout), *(getattr(self, each.name) for each in fields(self)[1:])


STRUCTURE = ("kind", "basis", "first", "starts", "closed", "stop_first", *(trait.name for trait in TRAITS))


def layout_key(scene: Scene) -> tuple[object, ...]:
    """Equal for scenes that differ in the values of attributes alone."""
    arrays = [getattr(scene, name) for name in STRUCTURE]
    digest = hashlib.blake2b(b"".join(array.tobytes() for array in arrays), digest_size=16)
    background = scene.canvas.background
    return (
        digest.digest(),
        tuple(map(len, arrays)),
        (scene.canvas.width, scene.canvas.height, None if background is None else background.tobytes()),
        scene.dashes,
        tuple(map(id, scene.pictures)),  # kept alive by the engine's own layout
    )


class Engine:
    """A renderer with arrays of its own, into and out of which calls copy. One call at a time."""

    def __init__(self, picture: Picture) -> None:
        backend = Backend.on(wp.device_from_torch(picture.device), picture.threads)
        self._parameters = Parameters(picture.layout, backend)
        self._renderer = Renderer(
            self._parameters,
            picture.viewport,
            model=picture.model,
            opaque=picture.opaque,
            straight=picture.straight,
        )
        names = {attribute.name for attribute in attributes_of(picture.layout)}
        for name in self._parameters.groups.keys() - names:
            self._parameters.groups[name].value.zero_()  # whatever the layout says
        self._values, self._grads = (
            {name: wp.to_torch(getattr(self._parameters.groups[name], field)) for name in names}
            for field in ("value", "grad")
        )
        self._record_pixels(backend, picture.viewport)
        self.lock = threading.Lock()
        self.ticket: object = None
        """Of the call whose forward pass the buffers hold."""
        self.bytes = self._renderer.bytes()
        self._graphs: dict[Program, wp.Graph] = {}
        self._stream: torch.cuda.Stream | None = None

    def _record_pixels(self, backend: Backend, viewport: Viewport) -> None:
        film = self._renderer.film
        shape = (viewport.tile_count, film.planes, constants.TILE_PIXELS // constants.QUAD)
        anything = backend.array(wp.vec4, 1, 1)

        def record(kernel: wp.Kernel, tiles: wp.array) -> Program:
            program = backend.program()
            program.launch(
                kernel,
                (viewport.tile_count, constants.TILE // constants.QUAD),
                viewport,
                pixels=anything,
                image_quads=view(tiles, wp.vec4, shape),
                split=True,
            )
            return program

        self._show = record(pixels.tiles_to_pixels, film.buffers.image)
        self._take = record(pixels.pixels_to_tiles, film.buffers.image_grad)

    def forward(self, values: Mapping[str, torch.Tensor]) -> None:
        """Render the scene of these attributes, each in the shape of its field."""
        self.ticket = None
        for name, own in self._values.items():
            own.copy_(values[name].reshape(own.shape))
            if name in SENSIBLE:
                own.clamp_(*SENSIBLE[name])
        self._replay(self._renderer.forward_program)
        if self._renderer.grow():
            self._graphs.clear()
            self._renderer.forward_complete()
            self.bytes = self._renderer.bytes()

    def show(self, image: torch.Tensor) -> None:
        """Write what was rendered, shape (height, width, 4)."""
        self._run(self._show, image)

    def backward(self, image_grad: torch.Tensor, names: Iterable[str]) -> dict[str, torch.Tensor]:
        """From the gradient of the image, shape (height, width, 4), to those of the attributes ``names``. The
        state of the forward pass is used up.
        """
        self.ticket = None
        self._run(self._take, image_grad)
        self._replay(self._renderer.backward_program)
        return {name: self._grads[name].clone() for name in names}

    def _replay(self, program: Program) -> None:
        """Without Python in between where one thread of a CPU does all; a GPU does not wait for Python."""
        if program.device.is_cpu and program not in self._graphs:
            graph = capture(program.device, [program])
            if graph is not None:
                self._graphs[program] = graph
        if program in self._graphs:
            wp.capture_launch(self._graphs[program])
        else:
            program.run()

    @staticmethod
    def _run(program: Program, image: torch.Tensor) -> None:
        """With the tensor's own memory as the rows of pixels."""
        array = wp.from_torch(image, dtype=wp.vec4, requires_grad=False)
        assert isinstance(array, wp.array)
        program.rebind("pixels", array)
        program.run()

    def follow(self, device: torch.device) -> None:
        """Work of the last call, on another stream perhaps, comes before that of torch's current one."""
        if device.type == "cuda":
            stream = torch.cuda.current_stream(device)
            if self._stream not in (None, stream):
                stream.wait_stream(self._stream)
            self._stream = stream


class Engines:
    """Engines used last, as many as are allowed."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[object, ...], Engine] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, picture: Picture) -> Engine:
        """The engine of ``picture``, made where there is none."""
        with self._lock:
            engine = self._kept.pop(picture.key, None)
            if engine is None:
                engine = Engine(picture)
            self._kept[picture.key] = engine
            while len(self._kept) > 1 and (
                len(self._kept) > KEPT or sum(each.bytes for each in self._kept.values()) > KEPT_BYTES
            ):
                self._kept.popitem(last=False)
            return engine

    def clear(self) -> None:
        """Give up all of them."""
        with self._lock:
            self._kept.clear()


ENGINES = Engines()


def clear_cache() -> None:
    """Free the renderers that are kept for further calls. They are made anew when they are needed."""
    ENGINES.clear()


def check_pictures(pictures: Sequence[Picture]) -> None:
    """Whether there is memory for pictures of one size and device.

    Raises:
        UsageError: the device is neither a CPU nor CUDA.
        ResourceError: there is not.
    """
    check_memory(pictures[0].viewport, _device_of(pictures[0]), len(pictures))


@contextlib.contextmanager
def engine_of(picture: Picture) -> Iterator[Engine]:
    """The engine of ``picture``, for this thread alone and on torch's current stream."""
    device = _device_of(picture)
    with device_lock(device), _on_stream(picture.device):
        engine = ENGINES.get(picture)
        with engine.lock:
            engine.follow(picture.device)
            yield engine


def _device_of(picture: Picture) -> wp.Device:
    if picture.device.type not in ("cpu", "cuda"):
        raise UsageError(f"tensors are on {picture.device}, neither on the CPU nor on CUDA")
    _start()
    device: wp.Device = wp.device_from_torch(picture.device)
    return device


@functools.cache
def _start() -> None:
    start_warp()


def _on_stream(device: torch.device) -> contextlib.AbstractContextManager[object]:
    """Have Warp work where torch does."""
    if device.type == "cpu":
        return contextlib.nullcontext()
    return wp.ScopedStream(wp.stream_from_torch(torch.cuda.current_stream(device)))
