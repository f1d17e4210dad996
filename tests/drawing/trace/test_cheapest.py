"""The cheapest chain of curves along a span."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.trace.cheapest import CurvePieces, cheapest_chains
from warpsplat.drawing.trace.spans import Polyline, cut_at_corners


def chain(points: np.ndarray, tolerance: float = 0.2) -> CurvePieces:
    spans = cut_at_corners([Polyline(points[1:-1], False, points[0], points[-1])], [tolerance])
    return cheapest_chains(spans, np.full(len(spans.owner), tolerance))


def test_one_line_one_cubic_or_several() -> None:
    x = np.linspace(0, 60, 121)
    flat, arc, waves = (np.stack([x, y], axis=1) for y in (0.1 * x, 0.01 * x * x, 6 * np.sin(x / 5)))
    assert chain(flat).is_line.tolist() == [True]
    assert chain(arc).is_line.tolist() == [False]
    several = chain(waves)
    assert len(several.span) > 2
    np.testing.assert_allclose(several.cubics[1:, 0], several.cubics[:-1, 3])
    assert np.isfinite(several.costs).all()
    assert len(chain(waves, 0.03).span) > len(several.span)
