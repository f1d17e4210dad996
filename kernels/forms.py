"""Forms: a shape's control points as functions of its values, and the adjoint (``warpsplat.forms``).

A form has two functions: ``point(values, first, count, k)`` is control point ``k`` of a shape with ``count``
values from ``first`` on, and ``adjoint(values, first, count, j, points_grad, start, drawn)`` the gradient of
value ``j``, by those of the ``drawn`` control points from ``start`` on. Their kernels are made from them.
"""

from typing import Any

import warp as wp

from warpsplat.kernels import constants

wp.set_module_options(constants.MODULE_OPTIONS)

Rows = wp.array[wp.vec2]
"""Values or control points, or their gradients."""


def make_place(name: str, point: Any) -> wp.Kernel:
    """Return the kernel that computes the control points of a form's shapes."""

    @wp.kernel(name=f"place_{name}", module="unique", module_options=constants.MODULE_OPTIONS)
    def place(
        # In:
        offset: wp.int32,
        values: wp.array[wp.vec2],  # [value_count] canvas units
        value_first: wp.array[wp.int32],  # [shape_count + 1]
        form: wp.array[wp.int32],  # [shape_count]
        own: wp.int32,  # the form of this kernel
        point_first: wp.array[wp.int32],  # [shape_count + 1]
        point_shape: wp.array[wp.int32],  # [point_count]
        # Out:
        points: wp.array[wp.vec2],  # [point_count] canvas units
    ):
        """One thread a control point."""
        i = offset + wp.tid()
        shape = point_shape[i]
        if form[shape] == own:
            first = value_first[shape]
            points[i] = point(values, first, value_first[shape + 1] - first, i - point_first[shape])

    return place


def make_gather(name: str, adjoint: Any) -> wp.Kernel:
    """Return the kernel of the adjoint."""

    @wp.kernel(name=f"gather_{name}", module="unique", module_options=constants.MODULE_OPTIONS)
    def gather(
        # In:
        offset: wp.int32,
        values: wp.array[wp.vec2],  # [value_count] canvas units
        value_first: wp.array[wp.int32],  # [shape_count + 1]
        value_shape: wp.array[wp.int32],  # [value_count]
        form: wp.array[wp.int32],  # [shape_count]
        own: wp.int32,  # the form of this kernel
        point_first: wp.array[wp.int32],  # [shape_count + 1]
        points_grad: wp.array[wp.vec2],  # [point_count]
        # Out:
        values_grad: wp.array[wp.vec2],  # [value_count] written
    ):
        """One thread a value, that is, two numbers."""
        i = offset + wp.tid()
        shape = value_shape[i]
        if form[shape] == own:
            first = value_first[shape]
            start = point_first[shape]
            count = value_first[shape + 1] - first
            drawn = point_first[shape + 1] - start
            values_grad[i] = adjoint(values, first, count, i - first, points_grad, start, drawn)

    return gather


@wp.func
def curve_point(values: Rows, first: int, count: int, k: int):
    """Return the control point of a curve, whose values are its points."""
    return values[first + k]


@wp.func
def curve_adjoint(values: Rows, first: int, count: int, j: int, points_grad: Rows, start: int, drawn: int):
    """Return the gradient of a curve's point."""
    return points_grad[start + j]


place_curve = make_place("curve", curve_point)
gather_curve = make_gather("curve", curve_adjoint)
"""Kernels of the curves in scenes that have shapes of forms too."""
