"""The renderer as an operator of torch: what ``torch.compile`` keeps in its graphs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch

from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.kept import check_memory
from warpsplat.torch.passes import backward, forward, images_for, restored
from warpsplat.torch.tensors import WITHOUT_GRADIENT, SceneTensors

Tensor = torch.Tensor

specs: dict[str, RenderSpec] = {}
"""Specifications by the keys that compiled graphs hold."""


def key_of(spec: RenderSpec) -> str:
    """Return the key of a specification, a new one unless it is known."""
    for key, known in specs.items():
        if known.layout is spec.layout and known.key == spec.key:  # the layout's values count as well
            return key
    key = str(len(specs))
    specs[key] = spec
    return key


@torch.library.custom_op(
    "warpsplat::render", mutates_args=(), schema="(Tensor[] values, str names, str spec) -> (Tensor, Tensor)"
)
def render(values: Sequence[Tensor], names: str, spec: str) -> tuple[Tensor, Tensor]:
    """Return an image, and the state of the pass.

    Args:
        values: attributes, each float32 or float64.
        names: theirs, with commas in between.
        spec: key in ``specs``.
    """
    check_memory(specs[spec])
    image = images_for(specs[spec])
    return image, forward(specs[spec], _scene(values, names, spec).drawn(), image).state()


@render.register_fake
def _(values: Sequence[Tensor], names: str, spec: str) -> tuple[Tensor, Tensor]:
    viewport, device = specs[spec].viewport, specs[spec].device
    image = torch.empty(viewport.height, viewport.width, 4, dtype=torch.float32, device=device)
    return image, torch.empty(2, dtype=torch.int64)


@torch.library.custom_op(
    "warpsplat::render_backward",
    mutates_args=(),
    schema="(Tensor image_grad, Tensor state, Tensor[] values, str names, str spec) -> Tensor[]",
)
def render_backward(
    image_grad: Tensor, state: Tensor, values: Sequence[Tensor], names: str, spec: str
) -> list[Tensor]:
    """Return the gradients of all attributes that have one; see ``render``."""
    scene = _scene(values, names, spec)
    drawn = scene.drawn()
    wanted = [name for name in scene.values if name in drawn and name not in WITHOUT_GRADIENT]
    found = backward(restored(specs[spec], state), drawn, image_grad, wanted)
    return [
        found[name].to(value.dtype) if name in found else torch.zeros_like(value)
        for name, value in scene.values.items()
    ]


@render_backward.register_fake
def _(image_grad: Tensor, state: Tensor, values: Sequence[Tensor], names: str, spec: str) -> list[Tensor]:
    return [torch.empty_like(value) for value in values]


def _scene(values: Sequence[Tensor], names: str, spec: str) -> SceneTensors:
    return SceneTensors(specs[spec].layout, dict(zip(names.split(","), values, strict=False)))


def _setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, Tensor]) -> None:
    values, ctx.names, ctx.spec = inputs
    ctx.save_for_backward(output[1], *values)


def _backward(ctx: Any, image_grad: Tensor, _: None) -> tuple[Any, ...]:
    state, *values = ctx.saved_tensors
    found = render_backward(image_grad, state, values, ctx.names, ctx.spec)
    needed = ctx.needs_input_grad[0]
    return [each if wanted else None for each, wanted in zip(found, needed, strict=True)], None, None


render.register_autograd(_backward, setup_context=_setup_context)
