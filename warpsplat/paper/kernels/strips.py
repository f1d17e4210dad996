"""Strips of Gaussians: how many rows across and stations along, and where the rows lie.

A strip is covered by a grid of rows x stations, the rows running along it. Row ``r`` lies at the fraction
``u_r = Phi(z_r)`` of the way across, for equally spaced ``z_r`` in [-reach, reach], Phi the normal cumulative
distribution (paper section 3.2): rows crowd towards the boundary. ``reach`` puts the outermost row ROW_INSET
inside the path.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.elementary import normal_quantile, normal_tail

wp.set_module_options(constants.MODULE_OPTIONS)

EDGE_MIN = wp.constant(2.0e-7)  # beyond, 1 - 2 x edge would be 1


@wp.func
def row_plan(width: wp.float32) -> wp.vec2:
    """(row count, reach) for a strip ``width`` [px] wide."""
    # The outermost row at a quarter of the strip at the most: two rows are the least. And so far inside a
    # strip of millions of pixels that a float can tell.
    edge = wp.clamp(constants.ROW_INSET / wp.max(width, constants.EPSILON), EDGE_MIN, 0.25)
    reach = normal_quantile(edge)
    # Near the boundary du = phi(z) dz and u = Phi(z), so the relative step is the hazard rate of the
    # normal distribution times dz; z + 1 / (z + 1) is close to it over the range in use.
    step = constants.ROW_GROWTH / (reach + 1.0 / (reach + 1.0))
    return wp.vec2(wp.max(2.0, wp.ceil(2.0 * reach / step) + 1.0), reach)


@wp.func
def row_position(row: wp.int32, rows: wp.int32, reach: wp.float32) -> wp.float32:
    """Fraction ``u`` in (0, 1) of the way across the strip."""
    z = reach * (2.0 * float(row) / float(rows - 1) - 1.0)
    tail = normal_tail(wp.abs(z))
    if z < 0.0:
        return tail
    return 1.0 - tail


@wp.func
def station_plan(length: wp.float32) -> wp.int32:
    """Stations along a curve ``length`` [px] long."""
    count = wp.max(length / constants.STATION_SPACING, constants.STATION_DENSITY * wp.sqrt(length))
    return wp.max(constants.STATIONS_MIN, int(wp.ceil(wp.min(count, 1.0e6))))
