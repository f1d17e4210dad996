"""Renderers for torch: recorded programs and their buffers."""

from __future__ import annotations

import functools
import hashlib
import threading
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

import torch
import warp as wp

from warpsplat.kernels import constants, pixels
from warpsplat.rendering.backend import Backend, Viewport, view
from warpsplat.rendering.models import Model
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program, Replay
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import OPACITY_RANGE, TRAITS, Scene
from warpsplat.torch.tensors import attributes_of

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


class Ticket:
    """A forward pass that may have a backward pass, as long as someone keeps it."""

    __slots__ = ("__weakref__",)


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
        shapes = {name: getattr(spec.layout, name).shape for name in names}
        groups = [(name, parameters.groups[name], shapes[name]) for name in names]
        self._values = {name: wp.to_torch(group.value).view(shape) for name, group, shape in groups}
        self._grads = {name: wp.to_torch(group.grad).view(shape) for name, group, shape in groups}
        buffers = self._renderer.film.buffers
        self._show = self._record(pixels.tiles_to_pixels, buffers.image, backend, spec.viewport)
        self._take = self._record(pixels.pixels_to_tiles, buffers.image_grad, backend, spec.viewport)
        self.lock = threading.Lock()
        self.number = 0
        """Number of the forward pass in the buffers; 0: there is none."""
        self._ticket: Callable[[], Ticket | None] = _no_ticket
        self.is_captured = False
        """Whether a CUDA graph of torch holds its programs, which then must stay as they are."""
        self._valid = dict(VALID)
        self._opaque = spec.opaque
        self.device = backend.device
        self.bytes = self._renderer.bytes()
        self._graphs: dict[Program, Replay] = {}

    def _record(self, kernel: wp.Kernel, tiles: wp.array, backend: Backend, viewport: Viewport) -> Program:
        """Record a copy between tiles and an image, whose memory ``_run`` binds as ``pixels``."""
        shape = (viewport.tile_count, self._renderer.film.planes, constants.TILE_PIXELS // constants.QUAD)
        program = backend.program()
        program.launch(
            kernel,
            (viewport.tile_count, constants.TILE // constants.QUAD),
            viewport,
            pixels=view(tiles, wp.vec4, (viewport.height, viewport.width)),
            image_quads=view(tiles, wp.vec4, shape),
            split=True,
        )
        return program

    def forward(self, values: Mapping[str, torch.Tensor]) -> None:
        """Render the scene of these attributes, by name, each in the shape of its field of ``Scene``."""
        self.number = 0
        for name, own in self._values.items():
            if name in self._valid:
                torch.clamp(values[name], *self._valid[name], out=own)
            else:
                own.copy_(values[name])
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
        self.number = 0
        self._run(self._take, image_grad)
        self._replay(self._renderer.backward_program)
        for name, gradient in gradients.items():
            gradient.copy_(self._grads[name])

    def hold(self, number: int, ticket: Ticket | None) -> None:
        """Keep the forward pass in the buffers, which has this number, as long as ``ticket`` exists."""
        self.number = number
        self._ticket = weakref.ref(ticket) if ticket else _no_ticket

    @property
    def is_held(self) -> bool:
        """Whether a backward pass may still ask for what is in the buffers."""
        return self.number != 0 and self._ticket() is not None

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
        """Run a copy with the memory of a contiguous tensor as the image."""
        program.rebind("pixels", image.data_ptr())
        program.run()

    def freeze(self) -> None:
        """Prepare for calls in a CUDA graph, after which nothing is read back."""
        self.is_captured = True
        if not self._opaque:
            self._valid["opacities"] = (0.0, OPACITY_RANGE[1])


def _no_ticket() -> None:
    """Stand in for a reference to a ticket that there is no longer."""
