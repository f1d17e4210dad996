"""The stage of forms: values -> control points, and the adjoint. Scenes of curves alone have none of it."""

from __future__ import annotations

from typing import NamedTuple

import warp as wp

from warpsplat.forms import form_of
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.scene import Basis


class _Kernels(NamedTuple):
    place: wp.Kernel
    gather: wp.Kernel


def _kernels(basis: Basis) -> _Kernels:
    """Return the kernels of a form, or of curves beside forms."""
    if not basis.is_form:
        from warpsplat.kernels import forms

        return _Kernels(forms.place_curve, forms.gather_curve)
    form = form_of(basis.name)
    return _Kernels(form.place, form.gather)


def record_place(program: Program, parameters: Parameters) -> None:
    """Record values -> control points."""
    for basis in parameters.forms:
        kernel = _kernels(basis).place
        program.launch(kernel, parameters.point_count, parameters.arrays, own=int(basis), split=True)


def record_gather(program: Program, parameters: Parameters) -> None:
    """Record gradients of control points -> gradients of values."""
    for basis in parameters.forms:
        count = parameters.arrays["values"].shape[0]
        program.launch(_kernels(basis).gather, count, parameters.arrays, own=int(basis), split=True)
