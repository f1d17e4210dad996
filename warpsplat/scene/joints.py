"""The role of each control point on a drawing's outline."""

from __future__ import annotations

from enum import IntEnum


class Joint(IntEnum):
    """Kind of a control point on a drawing's outline."""

    FREE = 0
    """A handle, or a point without conditions."""
    CORNER = 1
    """On the outline, which may turn there."""
    SMOOTH = 2
    """On the outline, which has no corner there: both handles lie on one line through it."""
    LINE_HANDLE = 3
    """At a third of a straight line."""
