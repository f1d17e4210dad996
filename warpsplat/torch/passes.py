"""Forward and backward passes by the engines, on tensors without history."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np
import torch

from warpsplat.rendering.helpers import shared
from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.torch.cuda import is_capturing
from warpsplat.torch.engine import RenderSpec, Ticket
from warpsplat.torch.kept import engine_of, known
from warpsplat.torch.tensors import check_extremes, extremes

Tensor = torch.Tensor
Result = TypeVar("Result")
Values = Mapping[str, Tensor]
"""All attributes that the shapes have, by name, in float32."""

numbers = itertools.count(1)
"""Numbers of forward passes, by which a backward pass recognises its own in an engine."""


class Pass(NamedTuple):
    """A forward pass."""

    spec: RenderSpec
    """As examined."""
    number: int
    ticket: Ticket | None = None
    """Keeps an engine from being used for others before the backward pass, as long as it exists."""

    def state(self) -> Tensor:
        """Return what ``restored`` needs, for those that can only keep tensors; int64, shape (2,)."""
        return torch.tensor([self.number, self.spec.opaque], dtype=torch.int64)


def restored(spec: RenderSpec, state: Tensor) -> Pass:
    """Return the pass with ``spec`` that had this ``state``."""
    number, opaque = state.tolist()
    return Pass(replace(spec, opaque=bool(opaque)), number)


def examined(spec: RenderSpec, values: Values) -> RenderSpec:
    """Return ``spec`` with ``opaque``; unless that is known already, check that all values are finite.

    While a CUDA graph is captured nothing can be read back, and nothing is checked; see ``known``.
    """
    if spec.opaque is not None:
        return spec
    if is_capturing(spec.device):
        return known(spec)
    found = dict(zip(values, extremes(values.values()), strict=True))
    check_extremes(found)
    opaque = "opacities" in found and bool(found["opacities"][1] > np.float32(OPACITY_RANGE[1]))
    return replace(spec, opaque=opaque)


def images_for(spec: RenderSpec, *count: int) -> Tensor:
    """Return memory for images, shape (``count``, height, width, 4)."""
    shape = (*count, spec.viewport.height, spec.viewport.width, 4)
    if spec.device.type == "cpu":  # NumPy asks for large pages, which take less than half of the time
        return torch.from_numpy(np.empty(shape, np.float32))
    return torch.empty(shape, dtype=torch.float32, device=spec.device)


def forward(spec: RenderSpec, values: Values, image: Tensor, *, held: bool = False) -> Pass:
    """Render into ``image``; see ``examined``.

    ``held``: whether the engine is to keep the pass for its backward pass, where memory allows.
    """
    done = Pass(examined(spec, values), next(numbers), Ticket() if held else None)
    with engine_of(done.spec) as engine:
        engine.forward(values)
        engine.show(image)
        engine.hold(done.number, done.ticket)
    return done


def backward(done: Pass, values: Values, image_grad: Tensor, wanted: Sequence[str]) -> dict[str, Tensor]:
    """Return the gradients of the attributes ``wanted`` for that of an image, in the shapes of ``values``."""
    if not wanted:
        return {}
    image_grad = image_grad.contiguous()
    found = {
        name: torch.empty(values[name].shape, dtype=torch.float32, device=done.spec.device) for name in wanted
    }
    with engine_of(done.spec, done.number) as engine:
        if engine.number != done.number:  # another call has used the buffers since
            engine.forward(values)
        engine.backward(image_grad, found)
    return found


class Passes(NamedTuple):
    """Forward passes of one call."""

    each: list[Pass]
    threads: int
    """How many are worked on at a time: on a CPU as many as there are threads, since a single step gains
    little from more than four (``USUAL_THREADS``)."""


def forward_all(specs: Sequence[RenderSpec], values: Sequence[Values], images: Tensor, held: bool) -> Passes:
    """Render scenes into ``images``, shape (scene, height, width, 4); see ``forward``."""
    threads = min(len(specs), specs[0].threads) if specs[0].device.type == "cpu" else 1
    if threads > 1:
        specs = [replace(spec, threads=spec.threads // threads) for spec in specs]
    work = partial(forward, held=held)
    return Passes(_each(work, zip(specs, values, images.unbind(), strict=True), threads), threads)


def backward_all(
    passes: Passes, values: Sequence[Values], image_grads: Tensor, wanted: Sequence[Sequence[str]]
) -> list[dict[str, Tensor]]:
    """Return what ``backward`` does for each of several passes."""
    scenes = list(zip(passes.each, values, image_grads.unbind(), wanted, strict=True))
    # Where memory was short the last ones are still there.
    return _each(backward, reversed(scenes), passes.threads)[::-1]


def _each(
    function: Callable[..., Result], arguments: Iterable[tuple[Any, ...]], threads: int
) -> list[Result]:
    """Return a function's results, computed on up to so many threads, none of which records history."""
    given = list(arguments)
    if len(given) == 1:
        return [function(*given[0])]
    found: dict[int, Result] = {}

    def work(i: int) -> None:
        with torch.no_grad():  # which each thread has to say for itself
            found[i] = function(*given[i])

    shared([partial(work, i) for i in range(len(given))], threads)
    return [found[i] for i in range(len(given))]
