"""Numbers that host code, kernels and the reference of the paper's models share, with the reason for each."""

import math

GAUSSIAN_MIN = 1.0 / 255.0
"""Value below which a Gaussian is cut: it changes no 8-bit colour."""

Q_MAX = -2.0 * math.log(GAUSSIAN_MIN)
"""The same cut as a squared Mahalanobis distance: exp(-Q_MAX / 2) = GAUSSIAN_MIN."""

Q_INNER = 6.0
"""The cut of all rows but the two outermost. There a pixel lies under a dozen Gaussians, so that what is cut
off (g < 0.05) raises 1 - coverage by a seventh of its 0.015; and it is where inner rows would reach out of
the shape."""

Q_SOFT = 9.0
"""The cut of soft Gaussians, at three standard deviations as in 3D Gaussian splatting."""

GAUSSIAN_MAX = 0.99
"""Peak of one Gaussian. Below 1 so that 1 - g can divide in the adjoint; the clamp is the same forward and
backward, and a clamped Gaussian has no gradient."""

SPREAD = 2.0 / 3.0
"""1 / rho of the paper's eq. 6: standard deviation as a fraction of the distance between samples."""

WIDTH_SIGMA = 0.4
"""Standard deviation across a soft stroke, over its width: opaque, it covers half at half the width."""

PIXEL_VARIANCE = 1.0 / 12.0
"""Variance of a pixel's area [px squared], which is added to that of a soft Gaussian."""

PIXEL_SIGMA = 0.13
"""Standard deviation [px] added in quadrature to both scales, so that no Gaussian vanishes. The softer the
edges, the better splats fit a photograph and the less the file, whose edges are hard, looks like them: 0.13
keeps the file within half a dB of the render (docs/experiments.md)."""

ROW_INSET = 0.45
"""Distance [px] from the path of the outermost row of Gaussians. A row's half-coverage line lies outside
the row; with this inset it lies on the path, so the splat covers what the exported path will cover."""

ROW_GROWTH = 0.65
"""Distance between rows as a fraction of the distance to the boundary: small enough that the Gaussians of
an inner row end at the path."""

STATION_SPACING = 5.0
"""Largest distance [px] between stations along a curve."""

STATION_DENSITY = 3.5
"""Stations along a curve of length L [px]: at least this times sqrt(L). A Gaussian is straight, so on a bend
of radius R its ends leave the curve by SPREAD^2 h^2 / R for a spacing h; with R about L / 3 this keeps it
under a quarter of a pixel."""

STATIONS_MIN = 8
"""Fewest stations along a curve, however small it is."""

PLAN_SAMPLES = 6
"""Samples of a cubic that measure its length and a strip's width."""

PLATEAU = 0.985
"""Mean coverage well inside a splatted shape (its Gaussians overlap to a little less than 1). A solid path
with this fraction of the opacity looks like the splat."""

COUNT_MAX = 2**30
"""Bound of a shape's count of samples: more than any capacity, and two of them can be added."""
