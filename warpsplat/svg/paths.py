"""SVG path data as cubics (SVG 1.1 section 8.3), in time linear in its length."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.portable.elementary import arctan2, cos, sin, tan
from warpsplat.portable.linear import product
from warpsplat.svg.inspect import ARGUMENTS, COMMAND, numbers

Points = npt.NDArray[np.float64]


class Subpath(NamedTuple):
    """A part of a path that is drawn without lifting the pen."""

    points: Points
    """Points of cubics: p0, c, c, p3, c, c, p6 ..., shape (1 + 3 cubics, 2)."""
    is_closed: bool
    """Whether it ends with the command that closes it."""
    is_spline: bool
    """Whether it is a quadratic followed by smooth ones only: a uniform quadratic B-spline."""

    def moved(self, linear: Points, shift: Points) -> Subpath:
        """Return it under an affine map."""
        return self._replace(points=product(self.points, linear.T) + shift)

    def ring(self) -> Points:
        """Return its points and a straight cubic back to the start."""
        return np.concatenate([self.points, straight(self.points[-1], self.points[0])])

    def controls(self) -> Points:
        """Return the control points of the quadratics, shape (quadratic, 2)."""
        return 1.5 * self.points[1::3] - 0.5 * self.points[:-1:3]

    def spline_chain(self) -> Points | None:
        """Return a spline's ``Scene`` points as an open contour; None if it is not a spline."""
        if not self.is_spline:
            return None
        return np.concatenate([self.points[:1], self.controls(), self.points[-1:]])

    def spline_ring(self) -> Points | None:
        """Return a spline's ``Scene`` points as a ring; None if it does not close smoothly."""
        controls = self.controls()
        if not self.is_spline or len(controls) < 3:
            return None
        seam = (controls[0] + controls[-1]) / 2
        # Largest distance [px] of a closed spline's start from the middle of its control points.
        closes = 1e-3
        return controls if np.allclose(self.points[[0, -1]], seam, rtol=0, atol=closes) else None


def cubics(data: str, *, keep_dots: bool) -> list[Subpath]:
    """Return the subpaths of path data, up to its first error if it has any (SVG 1.1, F.2).

    ``keep_dots`` keeps subpaths without extent, which show in a stroke.
    """
    data = data.strip()
    if data in {"", "none"} or data[0] not in "Mm":
        return []
    pen = _Pen()
    for command, text in COMMAND.findall(data):
        size = ARGUMENTS[command.lower()]
        values, is_whole = numbers(text, of_arcs=size == 7)
        for i in range(0, max(len(values) - size + 1, 1 - size), max(size, 1)):
            # Further pairs after a move are lines.
            move_on = i and command in "Mm"
            pen.draw(("l" if command == "m" else "L") if move_on else command, values[i : i + size])
        if not is_whole or (len(values) % size or not values if size else values):
            break
    return [
        Subpath(np.array([(p.real, p.imag) for p in points]), is_closed, is_spline)
        for points, is_closed, is_spline in pen.finish(keep_dots)
        if len(points) > 1
    ]


class _Pen:
    """A pen that draws commands as cubics; points are complex numbers."""

    def __init__(self) -> None:
        self.subpaths: list[tuple[list[complex], bool, bool]] = []
        self.points: list[complex] = []
        self.is_spline = True
        """Whether the subpath is a spline so far."""
        self.at = self.start = 0j
        self.control: tuple[str, complex] = ("", 0j)
        """Family (``c`` or ``q``) and last control point of the command before."""

    def draw(self, command: str, v: list[float]) -> None:
        """Draw one command with the arguments of one node."""
        kind = command.lower()
        origin = self.at if command == kind else 0j
        before, self.control = self.control, ("", 0j)
        if kind == "m":
            self._lift(False)
            self.at = self.start = origin + complex(v[0], v[1])
            self.points = [self.at]
            return
        if kind == "z":
            # Relative coordinates return to the start up to rounding, which needs no further cubic.
            if not (_is_near(self.at.real, self.start.real) and _is_near(self.at.imag, self.start.imag)):
                self._line(self.start)
                self.is_spline = False
            self._lift(True)
            return
        self.points = self.points or [self.at]  # empty: a subpath was closed before
        # In a spline only the first command has a control point.
        self.is_spline &= kind == ("t" if len(self.points) > 1 else "q")
        if kind == "h":
            self._line(complex(origin.real + v[0], self.at.imag))
        elif kind == "v":
            self._line(complex(self.at.real, origin.imag + v[0]))
        elif kind == "a":
            self._arc(v, origin + complex(v[5], v[6]))
        else:
            points = [origin + complex(x, y) for x, y in zip(v[::2], v[1::2], strict=True)]
            family = {"s": "c", "t": "q"}.get(kind, kind)
            if family != kind:  # smooth: the control point before, mirrored
                points.insert(0, 2 * self.at - before[1] if before[0] == family else self.at)
            if family == "l":
                self._line(points[0])
                return
            self.control = (family, points[-2])
            if family == "q":
                points = [(self.at + 2 * points[0]) / 3, (points[1] + 2 * points[0]) / 3, points[1]]
            self.points += points
            self.at = points[-1]

    def _lift(self, is_closed: bool) -> None:
        if self.points:
            self.subpaths.append((self.points, is_closed, self.is_spline and len(self.points) > 1))
        self.points = []
        self.is_spline = True

    def finish(self, keep_dots: bool) -> list[tuple[list[complex], bool, bool]]:
        """Return all subpaths; a closed point, if dots are kept, as a cubic without extent."""
        self._lift(False)
        return [
            (4 * points if keep_dots and is_closed and len(points) == 1 else points, is_closed, is_spline)
            for points, is_closed, is_spline in self.subpaths
        ]

    def _line(self, end: complex) -> None:
        self.points += line(self.at, end)
        self.at = end

    def _arc(self, v: list[float], end: complex) -> None:
        """Draw an elliptical arc, a cubic for each quarter of the ellipse (SVG 1.1 appendix F.6)."""
        start, rx, ry = self.at, abs(v[0]), abs(v[1])
        if start == end:
            return
        if not (rx > 0 and ry > 0):
            self._line(end)
            return
        # Half of the chord in the ellipse's own coordinates, in which it is a circle.
        angle = math.radians(v[2])
        cosine, sine = float(cos(angle)), float(sin(angle))
        chord = (start - end) / 2
        x, y = (chord.real * cosine + chord.imag * sine) / rx, (chord.imag * cosine - chord.real * sine) / ry
        half = math.sqrt(x * x + y * y)
        across = 0.0
        if half < 1:
            across = math.sqrt(1 / (half * half) - 1) * (-1 if bool(v[3]) == bool(v[4]) else 1)
        else:  # an ellipse that is too small grows until it reaches
            x, y, rx, ry = x / half, y / half, rx * half, ry * half
        center_x, center_y = y * across, -x * across
        first = float(arctan2(y - center_y, x - center_x))
        sweep = (float(arctan2(-y - center_y, -x - center_x)) - first) % math.tau
        sweep -= 0 if v[4] else math.tau
        count = max(1, math.ceil(abs(sweep) / (math.pi / 2) - 1e-9))
        reach = 4 / 3 * float(tan(sweep / count / 4))

        def back(x: float, y: float) -> complex:
            x, y = (x + center_x) * rx, (y + center_y) * ry
            return (start + end) / 2 + complex(x * cosine - y * sine, x * sine + y * cosine)

        for i in range(count):
            ends = (first + sweep * i / count, first + sweep * (i + 1) / count)
            (ax, ay), (bx, by) = ((float(cos(angle)), float(sin(angle))) for angle in ends)
            self.points += [
                back(ax - ay * reach, ay + ax * reach),
                back(bx + by * reach, by - bx * reach),
                back(bx, by),
            ]
        self.points[-1] = self.at = end


def _is_near(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)


def line(start: complex, end: complex) -> list[complex]:
    """Return a straight cubic without its first point."""
    return [start + (end - start) / 3, start + 2 / 3 * (end - start), end]


def straight(start: Points, end: Points) -> Points:
    """Return a straight cubic without its first point, shape (3, 2)."""
    return np.array([(z.real, z.imag) for z in line(complex(*start), complex(*end))])
