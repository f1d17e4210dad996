"""The renderer under the transforms of ``torch.func``, which take more time than plain differentiation."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import torch

from warpsplat.torch.engine import RenderSpec
from warpsplat.torch.passes import backward, forward, images_for, restored

Tensor = torch.Tensor

Names = tuple[str, ...]

are_active: Callable[[], bool] = getattr(torch._C, "_are_functorch_transforms_active", lambda: True)
"""Return whether the caller is within a transform."""


class Transformed(torch.autograd.Function):
    """Attributes, in the order of ``names`` -> image, and the state of the pass."""

    @staticmethod
    def forward(spec: RenderSpec, names: Names, *values: Tensor) -> tuple[Tensor, Tensor]:
        """Render."""
        image = images_for(spec)
        return image, forward(spec, dict(zip(names, values, strict=True)), image).state()

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, Tensor]) -> None:
        """Keep what the backward pass needs."""
        ctx.spec, ctx.names, *values = inputs
        ctx.save_for_backward(output[1], *values)
        ctx.set_materialize_grads(False)

    @staticmethod
    def backward(ctx: Any, image_grad: Tensor | None, _: None) -> tuple[Tensor | None, ...]:
        """Return the gradients of all inputs."""
        if image_grad is None:
            return (None,) * len(ctx.needs_input_grad)
        wanted = tuple(itertools.compress(ctx.names, ctx.needs_input_grad[2:]))
        found = TransformedBackward.apply(ctx.spec, ctx.names, wanted, image_grad, *ctx.saved_tensors)
        gradients = dict(zip(wanted, found, strict=True))
        return None, None, *map(gradients.get, ctx.names)

    @staticmethod
    def vmap(info: Any, in_dims: tuple[Any, ...], *inputs: Any) -> tuple[Any, tuple[int, int]]:
        """Render one scene after the other."""
        return _each(Transformed.apply, info.batch_size, in_dims, inputs), (0, 0)


class TransformedBackward(torch.autograd.Function):
    """Gradient of the image, state of the pass, attributes -> gradients of the attributes ``wanted``."""

    @staticmethod
    def forward(
        spec: RenderSpec, names: Names, wanted: Names, image_grad: Tensor, state: Tensor, *values: Tensor
    ) -> tuple[Tensor, ...]:
        """Return the gradients."""
        found = backward(restored(spec, state), dict(zip(names, values, strict=True)), image_grad, wanted)
        return tuple(found[name] for name in wanted)

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, ...]) -> None:
        """Keep nothing."""

    @staticmethod
    def backward(ctx: Any, *_: Any) -> None:
        """Refuse."""
        raise RuntimeError("cannot differentiate twice: warpsplat.torch has first derivatives only")

    @staticmethod
    def vmap(info: Any, in_dims: tuple[Any, ...], *inputs: Any) -> tuple[Any, tuple[int, ...]]:
        """Return the gradients of one scene after the other."""
        found = _each(TransformedBackward.apply, info.batch_size, in_dims, inputs)
        return found, (0,) * len(found)


def _each(
    function: Callable[..., tuple[Tensor, ...]], count: int, in_dims: tuple[Any, ...], inputs: tuple[Any, ...]
) -> tuple[Tensor, ...]:
    """Return the stacked results of a function of each of ``count`` elements of ``inputs``.

    ``in_dims``: a number for each tensor that is batched, its axis of elements.
    """
    pairs = list(zip(inputs, in_dims, strict=True))
    each = (
        function(*(x.select(dim, i) if isinstance(dim, int) else x for x, dim in pairs)) for i in range(count)
    )
    return tuple(map(torch.stack, zip(*each, strict=True)))
