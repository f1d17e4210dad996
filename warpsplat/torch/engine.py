"""Renderers that are kept for the next call: recorded programs and their buffers."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import threading
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace

import torch
import warp as wp

from warpsplat.errors import UsageError
from warpsplat.kernels import constants, pixels
from warpsplat.rendering import memory
from warpsplat.rendering.backend import Backend, Viewport, view
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.rendering.models import Model
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program, Replay
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import OPACITY_RANGE, TRAITS, Scene
from warpsplat.torch.cuda import is_capturing, shared_stream
from warpsplat.torch.tensors import attributes_of

KEPT = 32
"""Most engines that are kept."""

KEPT_BYTES = 512 * 2**20
"""Most memory of the engines that are kept; the one used last is kept in any case."""

VALID = {"opacities": (0.0, 1.0), "stop_opacities": (0.0, 1.0), "widths": (0.0, None)}
"""Ranges that values are clamped to; the gradient is that at the clamped value."""


@dataclass(frozen=True)
class RenderSpec:
    """Everything that an engine is recorded for."""

    layout: Scene
    viewport: Viewport
    model: Model
    device: torch.device
    threads: int
    opaque: bool | None
    """Whether an opacity is so near to 1 that its gradient takes another adjoint; None until the values are
    known."""
    straight: bool = False
    """Whether the image's colours are not premultiplied."""

    @functools.cached_property
    def key(self) -> tuple[object, ...]:
        """Equal for specifications that the same engine serves."""
        return layout_key(self.layout), *(getattr(self, each.name) for each in fields(self)[1:])


STRUCTURE = ("kind", "basis", "first", "starts", "closed", "stop_first", *(trait.name for trait in TRAITS))


def layout_key(scene: Scene) -> tuple[object, ...]:
    """Return a key that is equal for scenes that differ only in the values of their attributes."""
    arrays = [getattr(scene, name) for name in STRUCTURE]
    digest = hashlib.blake2b(b"".join(array.tobytes() for array in arrays), digest_size=16)
    background = scene.canvas.background
    return (
        digest.digest(),
        tuple(map(len, arrays)),
        (scene.canvas.width, scene.canvas.height, None if background is None else background.tobytes()),
        scene.dashes,
        tuple(map(id, scene.pictures)),  # the engine's own layout keeps them alive
    )


class Engine:
    """A renderer with buffers of its own that calls copy into and out of. It serves one call at a time."""

    def __init__(self, spec: RenderSpec) -> None:
        assert spec.opaque is not None
        backend = Backend.on(wp.device_from_torch(spec.device), spec.threads)
        parameters = Parameters(spec.layout, backend)
        self._renderer = Renderer(
            parameters, spec.viewport, model=spec.model, opaque=spec.opaque, straight=spec.straight
        )
        names = {attribute.name for attribute in attributes_of(spec.layout)}
        for name in parameters.groups.keys() - names:
            parameters.groups[name].value.zero_()  # whatever the layout holds
        self._values = {name: wp.to_torch(parameters.groups[name].value) for name in names}
        self._grads = {name: wp.to_torch(parameters.groups[name].grad) for name in names}
        buffers = self._renderer.film.buffers
        self._show = self._record(pixels.tiles_to_pixels, buffers.image, backend, spec.viewport)
        self._take = self._record(pixels.pixels_to_tiles, buffers.image_grad, backend, spec.viewport)
        self.lock = threading.Lock()
        self.ticket: object = None
        """Identifies the call whose forward pass is in the buffers."""
        self.is_captured = False
        """Whether a CUDA graph of torch holds its programs, which then must stay as they are."""
        self._valid = dict(VALID)
        self._opaque = spec.opaque
        self.device = backend.device
        self.bytes = self._renderer.bytes()
        self._graphs: dict[Program, Replay] = {}

    def _record(self, kernel: wp.Kernel, tiles: wp.array, backend: Backend, viewport: Viewport) -> Program:
        """Record a copy between tiles and an image, which ``_run`` binds as ``pixels``."""
        shape = (viewport.tile_count, self._renderer.film.planes, constants.TILE_PIXELS // constants.QUAD)
        program = backend.program()
        program.launch(
            kernel,
            (viewport.tile_count, constants.TILE // constants.QUAD),
            viewport,
            pixels=backend.array(wp.vec4, 1, 1),
            image_quads=view(tiles, wp.vec4, shape),
            split=True,
        )
        return program

    def forward(self, values: Mapping[str, torch.Tensor]) -> None:
        """Render the scene of these attributes, by name, each in the shape of its field of ``Scene``."""
        self.ticket = None
        for name, own in self._values.items():
            own.copy_(values[name].reshape(own.shape))
            if name in self._valid:
                own.clamp_(*self._valid[name])
        self._replay(self._renderer.forward_program)
        if not self.is_captured and self._renderer.grow():
            self._graphs.clear()
            self._renderer.forward_complete()
            self.bytes = self._renderer.bytes()

    def show(self, image: torch.Tensor) -> None:
        """Write the rendered image into ``image``, shape (height, width, 4)."""
        self._run(self._show, image)

    def backward(self, image_grad: torch.Tensor, gradients: Mapping[str, torch.Tensor]) -> None:
        """Write into ``gradients``, by the names of their attributes; this uses up the forward pass.

        ``image_grad``: gradient of the image, shape (height, width, 4).
        """
        self.ticket = None
        self._run(self._take, image_grad)
        self._replay(self._renderer.backward_program)
        for name, gradient in gradients.items():
            gradient.copy_(self._grads[name].reshape(gradient.shape))

    def _replay(self, program: Program) -> None:
        """Run a program: as a graph, without Python, where there can be one; in a CUDA graph of torch,
        launches become part of that.
        """
        if self.is_captured:
            program.run()
            return
        replay = self._graphs.get(program) or Replay(program.device, [program])
        if replay.graph or program.device.is_cuda:  # what a GPU refuses, it always does
            self._graphs[program] = replay
        replay()

    @staticmethod
    def _run(program: Program, image: torch.Tensor) -> None:
        """Run a copy with the tensor's own memory as the image."""
        array = wp.from_torch(image, dtype=wp.vec4, requires_grad=False)
        assert isinstance(array, wp.array)
        program.rebind("pixels", array)
        program.run()

    def freeze(self) -> None:
        """Prepare for calls in a CUDA graph, after which nothing is read back."""
        self.is_captured = True
        if not self._opaque:
            self._valid["opacities"] = (0.0, OPACITY_RANGE[1])


engines: OrderedDict[tuple[object, ...], Engine] = OrderedDict()
"""Those used last, by the keys of their specifications."""

captured: dict[tuple[object, ...], Engine] = {}
"""Those in CUDA graphs of torch, which replay them without a call: they do nothing else."""

_engines_lock = threading.Lock()


def clear_cache() -> None:
    """Free the renderers that are kept for further calls. They are recorded again when they are needed.

    CUDA graphs of torch that hold some must not be replayed afterwards.
    """
    with _engines_lock:
        engines.clear()
        for engine in captured.values():
            wp.synchronize_device(engine.device)  # torch may be replaying its graphs on any stream
        captured.clear()


def check_memory(spec: RenderSpec, count: int = 1) -> None:
    """Raise a ``ResourceError`` if there is no memory for ``count`` images."""
    memory.check_memory(spec.viewport, _warp_device(spec.device), count)


@contextlib.contextmanager
def engine_of(spec: RenderSpec) -> Iterator[Engine]:
    """Yield the engine of ``spec``, for this thread alone and in ``shared_stream``."""
    with device_lock(_warp_device(spec.device)), shared_stream(spec.device):
        with _engines_lock:
            engine = _captured_engine(spec) if is_capturing(spec.device) else _kept_engine(spec)
        with engine.lock:
            yield engine


def _kept_engine(spec: RenderSpec) -> Engine:
    """Return an engine of ``engines``, or a new one; those that have not been used for longest are freed."""
    engine = engines.pop(spec.key, None) or Engine(spec)
    engines[spec.key] = engine
    while len(engines) > 1 and (
        len(engines) > KEPT or sum(each.bytes for each in engines.values()) > KEPT_BYTES
    ):
        engines.popitem(last=False)
    return engine


def _captured_engine(spec: RenderSpec) -> Engine:
    """Return an engine of ``captured``, or one that leaves ``engines``, with the capacity that it has."""
    engine = captured.get(spec.key) or engines.pop(spec.key)
    captured[spec.key] = engine
    engine.freeze()
    return engine


def known(spec: RenderSpec) -> RenderSpec:
    """Return ``spec`` with the ``opaque`` of an engine that there is, preferably true: it suits all values.

    Raises:
        UsageError: there is no engine.
    """
    for opaque in (True, False):
        found = replace(spec, opaque=opaque)
        if found.key in captured or found.key in engines:
            return found
    raise UsageError("a CUDA graph can only hold a scene of a structure and size that was rendered before")


_start = functools.cache(start_warp)


def _warp_device(device: torch.device) -> wp.Device:
    """Return Warp's device, starting Warp."""
    if device.type not in ("cpu", "cuda"):
        raise UsageError(f"tensors are on {device}, neither on the CPU nor on CUDA")
    _start()
    found: wp.Device = wp.device_from_torch(device)
    return found
