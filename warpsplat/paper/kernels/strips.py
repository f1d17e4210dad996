"""Strips of Gaussians: how many rows across and stations along, and where the rows lie.

A strip is covered by a grid of rows x stations, the rows running along it. Row ``r`` lies at the fraction
``u_r = Phi(z_r)`` of the way across, for equally spaced ``z_r`` in [-reach, reach], Phi the normal cumulative
distribution (paper section 3.2): rows crowd towards the boundary. ``reach`` puts the outermost row ROW_INSET
inside the path.
"""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.kernels.ranges import find_range
from warpsplat.paper import constants as paper

wp.set_module_options(constants.MODULE_OPTIONS)

EDGE_MIN = wp.constant(2.0e-7)  # beyond, 1 - 2 x edge would be 1
SQRT_HALF = wp.constant(0.7071067811865476)
TAIL_MAX = wp.constant(4.0)  # beyond this times the square root of 2, a normal variable has a chance of 8e-9
HALVINGS = wp.constant(26)  # of an interval of that length: to a float's last bits


@wp.func
def bounded_product(a: wp.int32, b: wp.int32) -> wp.int32:
    """Return ``a`` times ``b``, clamped to [0, COUNT_MAX]."""
    return wp.int32(wp.clamp(wp.int64(a) * wp.int64(b), wp.int64(0), wp.int64(paper.COUNT_MAX)))


@wp.func
def normal_tail(z: wp.float32) -> wp.float32:
    """Chance that a normal variable exceeds ``z`` >= 0 standard deviations.

    Up to the square root of 2, by a polynomial in z^2; beyond, by one whose 16th power is the inverse of the
    complementary error function. Both are Chebyshev interpolants.
    """
    x = wp.min(z * SQRT_HALF, TAIL_MAX)
    if x < 1.0:
        s = x * x
        p = 1.12837913 + s * (
            -0.376123438 + s * (0.112803167 + s * (-0.0267150542 + s * (0.00492176203 + s * -0.000564805987)))
        )
        return 0.5 - 0.5 * x * p
    t = (x - 2.5) / 1.5
    low = 1.62893424 + t * (0.817421711 + t * (0.421312806 + t * (0.146538078 + t * 0.0466382937)))
    high = 0.0129177276 + t * (
        0.00315187556 + t * (0.000746777281 + t * (0.000168796991 + t * 3.4582237e-05))
    )
    t2 = t * t
    r = low + t2 * t2 * t * high
    r2 = r * r
    r4 = r2 * r2
    r8 = r4 * r4
    return 0.5 / (r8 * r8)


@wp.func
def normal_quantile(tail: wp.float32) -> wp.float32:
    """Standard deviations that a normal variable exceeds with the chance ``tail``, from 1e-8 to 0.5."""
    low = float(0.0)
    high = TAIL_MAX / SQRT_HALF
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if normal_tail(middle) > tail:
            low = middle
        else:
            high = middle
    return low


@wp.func
def row_plan(width: wp.float32, density: wp.float32) -> wp.vec2:
    """(row count, reach) for a strip ``width`` [px] wide; ``density``: rows over their usual number."""
    # The outermost row at a quarter of the strip at the most: two rows are the least. And so far inside a
    # strip of millions of pixels that a float can tell.
    edge = wp.clamp(paper.ROW_INSET / wp.max(width, constants.EPSILON), EDGE_MIN, 0.25)
    reach = normal_quantile(edge)
    # Near the boundary du = phi(z) dz and u = Phi(z), so the relative step is the hazard rate of the
    # normal distribution times dz; z + 1 / (z + 1) is close to it over the range in use.
    step = paper.ROW_GROWTH / (reach + 1.0 / (reach + 1.0))
    rows = density * wp.max(2.0, wp.ceil(2.0 * reach / step) + 1.0)
    return wp.vec2(wp.max(2.0, wp.ceil(rows)), reach)


@wp.func
def row_position(row: wp.int32, rows: wp.int32, reach: wp.float32) -> wp.float32:
    """Fraction ``u`` in (0, 1) of the way across the strip."""
    z = reach * (2.0 * float(row) / float(rows - 1) - 1.0)
    tail = normal_tail(wp.abs(z))
    if z < 0.0:
        return tail
    return 1.0 - tail


@wp.func
def station_plan(length: wp.float32, density: wp.float32) -> wp.int32:
    """Stations along a curve ``length`` [px] long; ``density``: stations over their usual number."""
    count = wp.max(length / paper.STATION_SPACING, paper.STATION_DENSITY * wp.sqrt(length))
    usual = wp.max(paper.STATIONS_MIN, int(wp.ceil(wp.min(count, 1.0e6))))
    return wp.max(3, int(wp.ceil(density * float(usual))))


@wp.struct
class ShapeGrid:
    """How many Gaussians a shape has, and where their rows lie."""

    stations: wp.int32  # along the shape
    runs: wp.int32  # stretches of stations without neighbours in one another; 1: all are neighbours
    rows: wp.int32  # across the shape
    reach: wp.float32  # of the outermost rows, see the module
    sign: wp.float32  # 1 or -1: orientation of a fill's outline; 0 for strokes, which may fold


@wp.struct
class Place:
    """Place of a Gaussian in the grid of its shape."""

    start: wp.int32  # first control point of the shape
    count: wp.int32  # of control points
    width: wp.float32  # canvas units
    scale: wp.float32
    station: wp.int32
    u: wp.float32  # of its row


def make_grid_forward(name: str, own_kind: int, position: wp.Function) -> wp.Kernel:
    """Return the kernel that puts the Gaussians of shapes of ``own_kind`` at ``position``, a function of the
    control points, a ``Place`` and a ``ShapeGrid`` [canvas units].
    """

    @wp.kernel(name=name, module="unique", module_options=constants.MODULE_OPTIONS)
    def forward(
        # In:
        offset: wp.int32,
        points: wp.array[wp.vec2],  # [point_count] canvas units
        widths: wp.array[wp.float32],  # [shape_count] canvas units
        kind: wp.array[wp.int32],  # [shape_count]
        point_first: wp.array[wp.int32],  # [shape_count + 1]
        scale: wp.float32,
        gaussian_ends: wp.array[wp.int32],  # [shape_count]
        gaussian_range: wp.array[wp.vec2i],  # [shape_count]
        shape_grid: wp.array[ShapeGrid],  # [shape_count]
        # Out:
        gaussian_shape: wp.array[wp.int32],  # [gaussian_capacity] -1: unused
        gaussian_across: wp.array[wp.float32],  # [gaussian_capacity] u of the row
        mean: wp.array[wp.vec2],  # [gaussian_capacity] px
    ):
        """One thread a Gaussian."""
        i = offset + wp.tid()
        shape = find_range(gaussian_ends, gaussian_ends.shape[0], i)
        if shape >= gaussian_ends.shape[0]:
            gaussian_shape[i] = -1
            return
        if kind[shape] != own_kind:
            return
        gaussian_shape[i] = -1
        if i >= gaussian_range[shape][1]:
            return
        grid = shape_grid[shape]
        index = i - gaussian_range[shape][0]
        place = Place()
        place.start = point_first[shape]
        place.count = point_first[shape + 1] - point_first[shape]
        place.width = widths[shape]
        place.scale = scale
        place.station = index % grid.stations
        place.u = row_position(index / grid.stations, grid.rows, grid.reach)
        gaussian_shape[i] = shape
        gaussian_across[i] = place.u
        mean[i] = scale * position(points, place, grid)

    return forward
