"""The renderer: the stages in order, arrays of fixed capacity, launches recorded once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import warp as wp

from warpsplat.errors import CapacityError
from warpsplat.kernels import composite, constants
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.bins import Bins, StageInputs
from warpsplat.rendering.film import Film
from warpsplat.rendering.forms import record_gather, record_place
from warpsplat.rendering.kernel_cache import expect
from warpsplat.rendering.memory import check_memory
from warpsplat.rendering.models import EXACT, Model
from warpsplat.rendering.paint import Painting
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.tiles import from_tiles, read_tiles, to_tiles, write_tiles
from warpsplat.scene import GRADIENTS, FloatArray, IndexArray, Scene
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.scene.scene import IntArray

SLOT_LIMIT = 1_500_000
"""Most slots before a scene is refused: 1.3 KiB each, 2.4 for strokes, and 1 more on a GPU; up to 5 GiB."""
SAMPLE_LIMIT = 16_000_000
"""Most Gaussians or vertices (about 120 bytes each, 200 with styled strokes) before a scene is refused."""


@dataclass(frozen=True)
class Capacity:
    """Sizes of the arrays whose need depends on the scene."""

    samples: int
    """Vertices or Gaussians."""
    slots: int


class Visible(NamedTuple):
    """Weights with which shapes' colours enter the image, in the tiles where they are visible."""

    shape: IntArray
    """Shape (slot,)."""
    tile: IntArray
    """Shape (slot,)."""
    share: FloatArray
    """By column and row of the tile, in [0, 1], shape (slot, TILE, TILE)."""
    colored: IndexArray
    """The slots of gradients, ascending, shape (colored,)."""
    color: FloatArray
    """Theirs, shape (colored, 3, TILE, TILE)."""


class Renderer:
    """Renders ``parameters`` into ``viewport``; and the adjoint.

    Nothing is allocated and nothing is copied to the host between ``forward`` and ``backward``. A scene
    that needs more than the capacity is rendered without the shapes that do not fit; ``grow`` fixes that.
    """

    def __init__(
        self,
        parameters: Parameters,
        viewport: Viewport,
        *,
        model: Model = EXACT,
        capacity: Capacity | None = None,
        opaque: bool = False,
        straight: bool = False,
    ) -> None:
        """Record the stages.

        Args:
            parameters: what is rendered.
            viewport: the image.
            model: of coverage.
            capacity: without, a guess that ``grow`` corrects.
            opaque: whether shapes may have opacities beyond OPACITY_RANGE, and gradients even so.
            straight: whether colours are not premultiplied; on a transparent canvas, with any opacities.

        Raises:
            ResourceError: the image takes more memory than there is.
        """
        self.parameters, self.viewport = parameters, viewport
        self.backend = parameters.backend
        check_memory(viewport, self.backend.device)
        self.model, self._opaque = model, opaque or straight
        canvas = parameters.structure.canvas
        self.film = Film(self.backend, viewport, canvas, opaque=self._opaque, straight=straight)
        self._needed = self.backend.array(wp.int32, 2)
        self.needed_samples, self.needed_slots = self._needed[:1], self._needed[1:]
        self._needed_on_host = self._needed.numpy() if self.backend.device.is_cpu else None
        shapes = parameters.shape_count
        slots_per_shape = 8  # first guess of the need, besides one for each tile
        first_guess = Capacity(
            model.samples_per_shape * shapes, viewport.tile_count + slots_per_shape * shapes
        )
        self._build(capacity or first_guess)

    def _build(self, capacity: Capacity) -> None:
        """Make the stages for ``capacity`` and record their launches."""
        backend, p, v = self.backend, self.parameters, self.viewport
        self.capacity = capacity
        limit = OPACITY_RANGE[1] if self._opaque else 1.0
        self.bins = Bins(backend, p, v, capacity.slots, self.needed_slots, opacity_limit=limit)
        inputs = StageInputs(backend, p, v, self.bins, capacity.samples, capacity.slots, self.needed_samples)
        self.geometry, self.coverage = self.model.stages(inputs)
        self.paint = Painting(inputs)
        self.film.attach(self.bins, self.coverage, self.paint)
        self.forward_program = backend.program()
        self._record_forward(self.forward_program)
        self._backward_program: Program | None = None
        self._revision = p.revision

    def check_current(self) -> None:
        """Check that the programs were recorded for the parameters' current arrays.

        Raises:
            RuntimeError: surgery has replaced the arrays, whose addresses the recorded launches hold.
        """
        if self._revision != self.parameters.revision:
            raise RuntimeError("recorded before the last surgery")

    def _record_forward(self, program: Program) -> None:
        program.stage = "outline"
        record_place(program, self.parameters)  # values -> points, where there are forms
        self.geometry.forward(program)  # points, widths -> samples
        program.stage = "bins"
        self.bins.forward(program, self.geometry.samples())  # samples -> slots, sorted by tile
        program.stage = "forward"
        self.coverage.states(program)  # slots, samples -> states
        self.bins.list_visible(program)  # states, paint -> each tile's list
        self.coverage.values(program)  # lists, samples -> coverages
        self.paint.forward(program)  # frames, stops -> colours of pixels, where there are gradients
        self.film.forward(program)  # -> image

    @property
    def backward_program(self) -> Program:
        """The adjoint, recorded when first used: many renderers only render."""
        if self._backward_program is None:
            self._backward_program = self.backend.program("backward")
            self._record_backward(self._backward_program)
        return self._backward_program

    def _record_backward(self, program: Program) -> None:
        self.film.backward(program)  # image_grad -> by slot
        self.paint.backward(program)  # -> colours, opacities
        self.coverage.backward(program)  # -> samples -> points, widths
        record_gather(program, self.parameters)  # -> values

    def expect_backward(self) -> None:
        """Announce the kernels of the adjoint now, as those of ``forward`` are (``kernel_cache.expect``)."""
        _ = self.backward_program

    def expect_removal_costs(self) -> None:
        """Announce the kernel of ``removal_costs``."""
        expect(composite.make_removal_cost(self.backend.column), self.backend.device)

    def bytes(self) -> int:
        """Return the memory of all arrays that the programs work on [bytes]."""
        return sum((self.forward_program.memory() | self.backward_program.memory()).values())

    def forward(self) -> None:
        """Render into the film."""
        self.check_current()
        self.forward_program.run()

    def backward(self) -> None:
        """Compute the gradients of the parameters from the film's gradient and the last forward pass."""
        self.check_current()
        self.backward_program.run()

    def read_image(self) -> FloatArray:
        """Return the image on the host: sRGB in [0, 1], shape (height, width, 3); of a transparent canvas
        premultiplied, and opacity: shape (height, width, 4).
        """
        return from_tiles(self.film.buffers.image.numpy(), self.viewport.width, self.viewport.height)

    def write_image_grad(self, gradient: FloatArray) -> None:
        """Set the image's gradient from the host, in the image's shape."""
        write_tiles(self.film.buffers.image_grad, to_tiles(gradient))

    def removal_costs(self, target: wp.array, importance: wp.array | None = None) -> FloatArray:
        """Return by how much the mean squared error against ``target`` would grow without each shape.

        ``target``: tiles as the film's image; ``importance``: weights of the pixels by tiles, without all 1.
        Shape of the result: (shape,). To be called after ``forward``. Allocates and copies to the host: for
        use between steps.
        """
        cost = self.backend.array(wp.float32, self.capacity.slots, self.backend.lanes)
        program = self.backend.program()
        importance = self.film.buffers.inside if importance is None else importance
        values = {"target": target, "importance": importance, "slot_cost": cost}
        self.film.launch(program, composite.make_removal_cost(self.backend.column), **values)
        program.run()
        shapes = self.bins.buffers.slot_shape.numpy()
        used = shapes >= 0
        totals = np.bincount(
            shapes[used],
            weights=self.backend.lane_sums(cost)[used],
            minlength=self.parameters.shape_count,
        )
        return np.asarray(totals / (3 * self.viewport.pixel_count), np.float32)

    def visible(self) -> Visible:
        """Return what is visible of each shape, after ``forward``. Allocates and copies to the host: for use
        between steps.
        """
        column = self.backend.column
        seen = self.backend.array(column, self.capacity.slots, self.backend.columns)
        program = self.backend.program()
        self.film.launch(program, composite.make_visibility(column), seen=seen)
        program.run()
        shapes, shares = self.bins.buffers.slot_shape.numpy(), read_tiles(seen)
        rows = np.flatnonzero((shapes >= 0) & shares.any(axis=(1, 2)))
        tiles = self.bins.buffers.slot_tile.numpy()
        colored, colors = np.zeros(0, np.intp), np.zeros((0, 3, constants.TILE, constants.TILE), np.float32)
        if self.paint.has_gradients:
            paint = self.parameters.arrays["paint"].numpy()[shapes[rows]]
            colored = np.flatnonzero(np.isin(paint, GRADIENTS))
            colors = read_tiles(self.paint.buffers.paint_columns)[rows[colored], :3]
        return Visible(shapes[rows], tiles[rows], shares[rows], colored, colors)

    def grow(self) -> bool:
        """Enlarge the arrays and record the programs again if a pass since the last call ran out of capacity;
        return whether it did.

        Reads two counters back from the device, at once.

        Raises:
            CapacityError: the scene needs more than SLOT_LIMIT or SAMPLE_LIMIT.
        """
        samples, slots = self._needs()
        if samples > SAMPLE_LIMIT or slots > SLOT_LIMIT:
            need = f"{_counted(samples)} samples and {_counted(slots)} tile slots"
            raise CapacityError(
                f"the scene needs {need}, more than the limits of {SAMPLE_LIMIT} and {SLOT_LIMIT}: "
                "fewer shapes or a smaller image are needed"
            )
        now = self.capacity
        if samples <= now.samples and slots <= now.slots:
            return False
        self._needed.zero_()
        growth = 1.5  # capacity over need when an array has to grow, so that a growing scene seldom does
        self._build(Capacity(max(now.samples, int(growth * samples)), max(now.slots, int(growth * slots))))
        return True

    def capacity_and_need(self) -> tuple[Capacity, Capacity]:
        """Return the capacity, and the largest need since it last grew: a pass depends on both."""
        return self.capacity, Capacity(*self._needs())

    def _needs(self) -> list[int]:
        """Return the numbers of samples and of slots that the passes needed."""
        shared = self._needed_on_host  # a CPU's, which costs less to keep than to ask for
        counts: list[int] = (self._needed.numpy() if shared is None else shared).tolist()
        return counts

    def restore_capacity(self, capacity: Capacity, needed: Capacity) -> None:
        """Set ``capacity_and_need`` to that of an earlier renderer of the same shapes; may record again."""
        if capacity != self.capacity:
            self._build(capacity)
        self.needed_samples.fill_(needed.samples)
        self.needed_slots.fill_(needed.slots)

    def forward_complete(self) -> bool:
        """Render, growing until everything fits; return whether it grew, and so has other programs now."""
        self.forward()
        grown = False
        while self.grow():
            grown = True
            self.forward()
        return grown


def _counted(need: int) -> str:
    """Return a need, as ``kernels.ranges`` counts it, as text."""
    return "over 2 billion" if need == constants.INT_MAX else str(need)


def render(
    scene: Scene, *, scale: float = 1.0, model: Model = EXACT, backend: Backend | None = None
) -> FloatArray:
    """Render ``scene`` at ``scale`` px per canvas unit, as its file looks or by another model.

    Samples follow the size in pixels, so a scene can be rendered at any size (paper section 3.3).

    Returns:
        as ``Renderer.read_image``.
    """
    canvas = scene.canvas
    size = max(1, round(canvas.width * scale)), max(1, round(canvas.height * scale))
    return render_into(scene, Viewport(*size, scale), model=model, backend=backend)


def render_into(
    scene: Scene, viewport: Viewport, *, model: Model = EXACT, backend: Backend | None = None
) -> FloatArray:
    """Render as ``render`` does, at a size in pixels."""
    made = Renderer(Parameters(scene, backend or Backend.on()), viewport, model=model)
    made.forward_complete()
    return made.read_image()
