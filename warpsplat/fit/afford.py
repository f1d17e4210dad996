"""Estimating how many shapes fit into a file of a given size."""

from __future__ import annotations

from dataclasses import replace

from warpsplat.fit.export import export
from warpsplat.fit.rounding import USUAL_GRID, choose_grid, finest
from warpsplat.fit.schedule import mean_points_at
from warpsplat.fit.settings import Settings
from warpsplat.fit.step import Step
from warpsplat.portable import elementary
from warpsplat.scene import Basis, Kind

HEAD_BYTES = 150
"""Bytes of a file besides its shapes."""

STYLE_BYTES = {Kind.FILL: 35, Kind.STROKE: 55}
"""Bytes of a shape besides its coordinates."""

SEPARATOR = 1.6
"""Bytes of a number besides the digits of whole pixels."""

SPARE_CURVES = 1.3
"""Trained shapes over those expected to fit: the excess is removed with the surplus."""

LATER = 0.92
"""Bytes of a shape in the file over its bytes before the last steps: opacities become 1, the grid coarser."""


def affordable_curves(settings: Settings, width: int, height: int) -> int:
    """Return how many shapes fit into ``max_bytes`` on a canvas of ``width`` x ``height`` px, and a few more.

    Coordinates are relative: each has as many digits before the point as the distance between shapes.
    """
    assert settings.max_bytes
    numbers = 4 + 2 * settings.density.mean_points
    room = settings.max_bytes - HEAD_BYTES
    count = float(settings.curves)
    for _ in range(8):  # settles within a shape
        digits = max(0.0, 0.5 * float(elementary.log10(width * height / max(count, 1.0))))
        count = max(0.0, room / (STYLE_BYTES[settings.kind] + numbers * (SEPARATOR + digits)))
    return max(1, min(settings.curves, round(SPARE_CURVES * count)))


def affordable(step: Step) -> Settings:
    """Return the settings of a fit whose surplus is being removed, with as many shapes as fit ``max_bytes``.

    A shape counts by its present bytes, less those of the points that it is still to lose.
    """
    settings, state = step.settings, step.state
    assert settings.max_bytes
    if state.step <= settings.density.thin * settings.iterations:
        return settings
    scene = state.scene()
    coarse = state.step < settings.coarse * settings.iterations
    grid = (
        min(USUAL_GRID, finest(settings)) if coarse else choose_grid(step, staged=True, rate_distortion=True)
    )
    per_shape = (len(export(scene, settings, grid)) - HEAD_BYTES) / max(len(scene), 1)
    splines = scene.basis == Basis.SPLINE
    if splines.any():
        points = float(scene.point_counts()[splines].mean())
        lost = max(0.0, points - mean_points_at(settings, settings.iterations)) / (points + 2)
        per_shape -= lost * max(per_shape - STYLE_BYTES[settings.kind], 0.0)
    room = round((settings.max_bytes - HEAD_BYTES) / max(LATER * per_shape, 1.0))
    return replace(settings, curves=min(settings.curves, max(room, 1)))
