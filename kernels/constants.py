"""Numbers that host code, kernels and the reference renderer share, with the reason for each."""

import platform

FILL = 0
STROKE = 1
"""Kinds of shapes: a closed ring of cubics that is painted inside, a chain of cubics painted along."""

STYLED = 2
"""Part, in exact coverage, of strokes that are drawn as polygons, as they have dashes, or caps or joins that
are not round; the parts of other shapes are their kinds."""

CUBIC = 0
SPLINE = 1
"""Bases of a shape's control points: a chain of cubic Béziers (points 0, 3, 6 ... lie on the outline), or a
uniform quadratic B-spline (each point is the control point of one quadratic Bézier, whose ends lie midway to
the neighbouring points)."""

NONZERO = 0
EVENODD = 1
"""Rules of what is inside of a fill."""

ROUND = 0
BUTT = 1
SQUARE = 2
"""Caps of strokes."""

MITER = 1
BEVEL = 2
"""Joins of strokes, besides ROUND."""

FLAT = 0
LINEAR = 1
RADIAL = 2
PICTURE = 3
"""Paints of shapes."""

PAD = 0
REFLECT = 1
REPEAT = 2
"""How gradients go on beyond their ends."""

NONE = -1
"""No such row."""

SEGMENT_MIN = 1.0e-3
"""Length [px] below which a piece of a stroke's centre line has no direction, and no part in its length."""

DASH_PERIOD_MIN = 0.5
"""Shortest pattern of dashes that is drawn [px]; shorter ones are drawn a whole number of times larger."""

CORNERS_MAX = 2**25
"""Corners of a stroke's polygons beyond which they are not counted further: more than any capacity."""

MITERED = -1.0
"""Radius of a corner of a stroke that is the tip of a mitre."""

TILE = 16
"""Tile edge [px]; the paper (and 3D Gaussian splatting) bins into 16x16 tiles."""

TILE_PIXELS = TILE * TILE
QUAD = 4
"""Pixels of a column that are copied to rows of pixels at a time."""

TRANSMITTANCE_MIN = 1.0e-4
"""Transmittance below which a pixel is finished: what lies behind changes no 8-bit colour."""

SEEN = 0.5 / 255.0
"""Opacity from which on a shape hides the black that pictures that are not premultiplied begin with."""

NOTHING = 1.0e-28
"""Opacity of a pixel below which its colour is no longer divided by it."""

EPSILON = 1.0e-6
"""Length [px] below which a difference vector has no direction."""

INT_MAX = 2**31 - 1
"""Sort key of an unused slot: sorts behind every tile; a need that 32 bits do not hold."""

FLATNESS = 0.04
"""Largest distance [px] of a flattened curve from the curve. Coarser pieces are fitted to the image by the
optimiser and then missing in the file, whose curves are smooth (docs/experiments.md)."""

FLATNESS_STROKE = 0.08
"""The same for strokes: their corners are rounded by their width, and each piece costs the stroke's width."""

SLANT = 0.2
"""Largest distance [px] of a corner of a cap or join from where it would be at the curve itself."""

PIECES_MIN = 3
PIECES_MAX = 64
"""Bounds of the straight pieces of one cubic; 64 are enough for one as large as 8,000 px."""

PIECES_MIN_SPLINE = 2
"""The same for a quadratic: with one piece its control point would not move what lies between the ends."""

REACH_MAX = 1.0e7
"""Largest distance [px] from the origin, and largest width of a stroke; what is beyond is moved there."""

COVERED = 1
UNCOVERED = 2
"""States of a slot are sums: some of its pixels are covered, some are not (wholly)."""

FULL = COVERED
PARTIAL = COVERED + UNCOVERED
"""Only for a slot in this state is there a coverage to read; one that is FULL has coverage 1 throughout."""

HIDDEN = 4
"""Added to the state of a slot that is hidden by opaque slots in front."""

ALIGNED = 8
"""Added to PARTIAL where an edge of the shape lies on a border of pixels."""

TILE_MARGIN = 0.01
"""Distance [px] from a tile at which an edge of a fill counts as touching it."""

EDGE_BLOCK = 32
"""Edges in a row whose heights are known together: rows of tiles beyond them leave them out."""

NEARLY_NONE = 1.0e-20
NEARLY_ALL = 1.0 - 2.0**-24
"""Coverages that show as 0 and 1 but have a gradient, where an edge on a border of pixels may change them."""

AREA = 0
PRODUCT = 1
"""Coverage mappings from the sum s that a model computes: |s|, clamped at 1, or 1 - exp(-s)."""

STACK_FLAGS = " -mstackrealign -mstack-alignment=32" * (platform.machine().lower() in {"x86_64", "amd64"})
"""Vectors that do not fit into registers lie at multiples of 32 bytes on the stack. Otherwise half of all
processes, by where their stack happens to begin, take twice as long for compositing."""

MODULE_OPTIONS = {
    "enable_backward": False,
    "optimization_level": 3,
    "cpu_compiler_flags": "-march=native -ffp-contract=off -DWP_NO_BFLOAT16="
    " -mllvm=-inline-threshold=9000 -mllvm=-unroll-full-max-count=4" + STACK_FLAGS,
}
"""Options of every kernel module. A CPU contracts no products and sums, or results would depend on whether
it has fused multiply-adds. Loops over the 16 elements of a column become vector instructions only where
they are not unrolled before; unrolled, they also take ten times as long to compile. Warp's headers are
precompiled once for all modules whose options for the compiler are the same; without 16-bit floats, which
no kernel uses, that takes two thirds of the time."""

CACHEABLE = 1
"""A tile that shows nothing but flat colours which cover it, so that no outline has a gradient there ..."""

CACHED = 2
"""... and showed the same shapes in the last pass, so that its pixels and loss are still valid."""

STEEP = 1.0e9
"""Makes a step of a difference, which is then clamped: vectors have no comparisons."""
