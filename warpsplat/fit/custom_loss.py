"""A loss of the user's own: a function of the render that replaces the squared error, or joins it."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from dataclasses import dataclass
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

from warpsplat.errors import UsageError, cause_of, shown
from warpsplat.extensions import declared, load
from warpsplat.field_docs import described
from warpsplat.scene import FloatArray

LossFunction = Callable[..., Any]
"""A function of a render: sRGB in [0, 1], shape (height, width, 3); of an image with opacity premultiplied,
and opacity, shape (height, width, 4). The size is that of the training, which grows in the course of a run.

One of torch gets a float32 tensor on the run's device and returns a tensor that torch can differentiate.
Any other gets a float32 array, and returns the value and its gradient, an array of the render's shape.

The value is a number, or has one for each pixel, shape (height, width), whose mean is the loss: new shapes
are then placed where it is large, else where the gradient is.
"""


CHANGING = (
    "the render has {0} by {1} pixels now, and others later: CustomLoss(function, with_target=True) calls it "
    "with the target at the render's size"
)
"""For messages about errors that name a side of the render."""

BEGIN = 0.5
"""``CustomLoss.begin`` of losses that replace the squared error."""


@described
@dataclass(frozen=True)
class CustomLoss:
    """A loss of your own, for ``vectorize`` and ``refine``."""

    function: LossFunction
    """See ``LossFunction``."""
    squared_error: float = 0.0
    """Weight of the mean squared error, which the loss joins; 0: it is replaced."""
    with_target: bool = False
    """Whether the function is called with two images: the render, and the target at its size."""
    torch: bool | None = None
    """Whether the function is one of torch; None: it is if it is a module of torch, or its source file
    imports torch.
    """
    begin: float | None = None
    """Share of the steps of ``vectorize`` before which the squared error alone counts; None: 0 if the loss
    joins it, half if the loss replaces it, as few losses lead shapes to their places from afar.
    """

    def __post_init__(self) -> None:
        """Check the types."""
        if not callable(self.function):
            raise UsageError(f"a loss is a function of a render, not {shown(self.function)}")
        if not _is_number(self.squared_error):
            raise UsageError(f"squared_error must be a number from 0, not {shown(self.squared_error)}")
        if self.begin is not None and not (_is_number(self.begin) and self.begin <= 1):
            raise UsageError(f"begin must be a number from 0 to 1, not {shown(self.begin)}")

    def counts_at(self, progress: float) -> bool:
        """Return whether the loss counts after a share of the steps."""
        begin = BEGIN if self.begin is None and not self.squared_error else self.begin
        return progress >= (begin or 0)

    @property
    def name(self) -> str:
        """Its name, by which a checkpoint knows it."""
        found = self.function if hasattr(self.function, "__qualname__") else type(self.function)
        begin = "" if self.begin is None else f" from {self.begin:g}"
        return f"{found.__module__}.{found.__qualname__} + {self.squared_error:g} l2{begin}"

    def on(self, device: str) -> LossFunction:
        """Return the function of arrays that returns a value and a gradient, as NumPy has them.

        Raises ``UsageError`` for a function of torch if the extension ``torch`` is not there.
        """
        if not (uses_torch(self.function) if self.torch is None else self.torch):
            return self.function
        bridge = declared("provides").get("torch_loss")
        if bridge is None:
            raise UsageError("a loss of torch needs the extension torch, which is not installed")
        try:
            made: LossFunction = load(bridge)(self.function, device)
        except ImportError as error:
            raise UsageError(f"a loss of torch: {error}") from error
        return made


def uses_torch(function: LossFunction) -> bool:
    """Return whether a function is a module of torch, or stands in a file that imports from torch."""
    if isinstance(function, functools.partial):
        return uses_torch(function.func)
    if hasattr(function, "register_forward_hook"):
        return True
    code = function if hasattr(function, "__globals__") else getattr(function, "__func__", None)
    names = getattr(code or type(function).__call__, "__globals__", {})
    return any(_package(value) == "torch" for value in [*names.values()])


def _package(value: object) -> str:
    """Return the package of a module, class or function, or of a value's class."""
    if isinstance(value, ModuleType):
        return value.__name__.partition(".")[0]
    kind = value if isinstance(value, (type, FunctionType)) else type(value)
    return kind.__module__.partition(".")[0]


def _is_number(value: object) -> bool:
    """Return whether a value is a finite number from 0."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and 0 <= value < np.inf


class Evaluation(NamedTuple):
    """A loss at an image."""

    value: float
    by_pixel: FloatArray | None
    """Whose mean is the value, shape (height, width)."""
    gradient: FloatArray
    """By the image, in its shape."""


def evaluate(function: LossFunction, image: FloatArray, *target: FloatArray) -> Evaluation:
    """Return a loss, as ``CustomLoss.on`` gives it, at an image, and with a target if it takes one.

    Raises ``UsageError`` if it raises an error, or returns anything but a finite value and gradient.
    """
    try:
        found = function(image, *target)
    except (UsageError, MemoryError):
        raise
    except Exception as error:
        cause = cause_of(error)
        sides = {str(side) for side in image.shape[:2]} & {*re.findall(r"\d+", cause)}
        hint = f"; {CHANGING.format(*image.shape)}" if sides and not target else ""
        raise UsageError(f"the loss raised {type(error).__name__}: {cause}{hint}") from error
    if not (isinstance(found, tuple) and len(found) == 2):
        raise UsageError(
            f"the loss returned {shown(found)}, without a gradient: it must return (value, gradient), or be "
            "a function of torch (CustomLoss(function, torch=True))"
        )
    value, gradient = (_as_array(each) for each in found)
    value, size = value.reshape(()) if value.size == 1 else value, image.shape[:2]
    if value.shape not in ((), size):
        raise UsageError(f"the loss's value has shape {value.shape}: it must be a number, or have {size}")
    if gradient.shape != image.shape:
        raise UsageError(f"the loss's gradient has shape {gradient.shape}, not the render's, {image.shape}")
    total = float(value.mean(dtype=np.float64))
    if not np.isfinite(total):
        raise UsageError(f"the loss is {total}")
    if not np.isfinite(gradient).all():
        raise UsageError(f"the loss's gradient has numbers that are not finite; the loss is {total:g}")
    return Evaluation(total, value if value.ndim else None, gradient)


def _as_array(value: object) -> FloatArray:
    """Return numbers as float32."""
    try:
        return np.asarray(value, np.float32)
    except (TypeError, ValueError, RuntimeError) as error:
        raise UsageError(f"the loss returned {shown(value)}, which is not a number or array") from error
