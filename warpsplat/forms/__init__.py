"""Forms: shapes with few values, of which their control points are functions.

A form is a member of ``scene.Basis`` and the module of this package with its name, which has what ``Form``
lists. ``Scene.points`` of a shape are then its values, each a row of two numbers; all are lengths in canvas
units, so that one learning rate suits them. What is drawn are cubics (``Scene.drawn``).
"""

from __future__ import annotations

import functools
import importlib
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy.typing as npt

if TYPE_CHECKING:
    import warp as wp

Array = npt.NDArray[Any]


class Form(Protocol):
    """Interface of the module of a form. Arrays of values have shape (shape, value, 2)."""

    VALUES: int
    """Number of values; 0: any, as vertices."""
    TAGS: tuple[str, ...]
    """SVG elements that are read as this form."""
    TURNED: bool
    """Whether elements are turned, by the last of their numbers [degrees] about the origin."""
    place: wp.Kernel
    """Values -> control points, see ``kernels.forms``."""
    gather: wp.Kernel
    """The adjoint."""

    def outline(self, values: Array, closed: bool) -> Array:
        """Return the control points of cubics, shape (shape, point, 2): what ``place`` computes."""

    def start(self, centres: Array, areas: Array, angles: Array, count: int) -> Array:
        """Return the values of new shapes, with ``count`` vertices if the form has vertices."""

    def numbers(self, values: Array) -> Array:
        """Return the numbers of the elements of ``values`` in units of the file, shape (shape, number)."""

    def values(self, numbers: Array) -> Array:
        """Return the values of elements with these numbers, from which ``numbers`` makes the same again."""

    def element(self, numbers: list[float], closed: bool) -> str:
        """Return an element without brackets and style."""

    def read(self, points: Array, closed: bool) -> Array:
        """Return the values whose outline may be ``points``, shape (point, 2); the caller compares."""


@functools.cache
def form_of(name: str) -> Form:
    """Return the form with the name of a member of ``scene.Basis``."""
    return cast("Form", importlib.import_module(f"{__name__}.{name.lower()}"))
