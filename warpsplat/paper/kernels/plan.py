"""Shapes -> how many Gaussians they have along and across."""

import warp as wp

from warpsplat.kernels import constants
from warpsplat.paper.kernels.fill import chain_cubics, measure_strip
from warpsplat.paper.kernels.strips import ShapeGrid, bounded_product, row_plan, station_plan
from warpsplat.paper.kernels.stroke import cap_plan, longest_segment

wp.set_module_options(constants.MODULE_OPTIONS)


@wp.kernel
def plan_grid(
    # In:
    offset: wp.int32,
    points: wp.array[wp.vec2],  # [point_count] canvas units
    widths: wp.array[wp.float32],  # [shape_count] canvas units
    kind: wp.array[wp.int32],  # [shape_count]
    point_first: wp.array[wp.int32],  # [shape_count + 1]
    scale: wp.float32,  # render pixels per canvas unit; soft ones are planned in canvas units: 1
    soft: wp.int32,  # 1: strokes are one row of Gaussians, without caps
    density: wp.float32,  # Gaussians along and across over their usual number
    # Out:
    shape_grid: wp.array[ShapeGrid],  # [shape_count]
    gaussian_count: wp.array[wp.int32],  # [shape_count] stations x rows
):
    """Grid size of a fill from its longer chain and the mean width of its strip; of a stroke from its longest
    segment, as all of them have as many stations, and its width. One thread a shape.
    """
    shape = offset + wp.tid()
    start = point_first[shape]
    grid = ShapeGrid()
    grid.runs = 1
    rows = wp.vec2(1.0, 0.0)
    if kind[shape] == constants.FILL:
        strip = measure_strip(points, start, chain_cubics(point_first, shape), scale)
        grid.stations = station_plan(strip[0], density)
        rows = row_plan(strip[1], density)
        grid.sign = wp.sign(strip[2])
    else:
        segments = (point_first[shape + 1] - start) / 3
        each = station_plan(longest_segment(points, start, segments, scale), density)
        if soft == 0:
            grid.runs = segments
            rows = row_plan(scale * widths[shape], density)
            each += 2 * cap_plan(int(rows[0]))
        grid.stations = bounded_product(segments, each)
    grid.rows = int(rows[0])
    grid.reach = rows[1]
    shape_grid[shape] = grid
    gaussian_count[shape] = bounded_product(grid.stations, grid.rows)
