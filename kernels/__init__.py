"""Device side of warpsplat: Warp kernels, one file a stage.

Conventions and glossary, here once:

* Lengths are pixels of the image being rendered ([px]); x right, y down; the centre of pixel
  (column j, row i) lies at (j + 0.5, i + 0.5), as in SVG. The scene itself is in canvas units (pixels of
  the input image); ``scale`` takes it to render pixels.
* Colours are sRGB values in [0, 1], not linearised (SVG composites so), straight, not premultiplied.
* A **shape** is a path of the file, which is composited once. Row 0 is painted first (furthest back).
  Its **kind** is FILL (a ring of Béziers) or STROKE (a chain), its **basis** CUBIC or SPLINE
  (``constants``). Shapes are ragged: the control **points** of shape ``i`` are those from ``point_first[i]``
  to ``point_first[i + 1]``, its **Béziers** those from ``bezier_first[i]`` on; ``point_shape`` is the shape
  of each point.
* A **sample** is a point from which a shape's tiles are found: a **vertex** of its polyline (exact coverage),
  or a **Gaussian** (splats). A shape's samples, corners and slots are its ``*_range``: the first, and one
  past the last; empty where they did not fit into the capacity.
* A **corner** is a vertex of the polygons that a styled stroke is drawn as; they lie one after the other as
  the vertices do. The **part** of a shape says which kernels cover it: its kind, or STYLED.
* Gaussians lie on a grid of **rows** across a shape and **stations** along it, number
  ``gaussian_range[shape][0] + row * stations + station``. Stations fall into **runs**: neighbours only inside
  a run.
* The **strength** of a soft Gaussian is its opacity inside the product over its shape's Gaussians; the
  **fades** of a stroke are what its thirds add to its opacity.
* A **slot** is one (shape, tile) pair. The slots of a shape are the tiles of its bounding rectangle, row by
  row, shapes from the front to the back, so that the slot of a pixel is found by arithmetic. Its **state**
  says whether it is covered (``constants.COVERED``, ``UNCOVERED``), and so whether there is a coverage to
  read; slots that are HIDDEN are on no list.
* Pixels lie by tiles, and in a tile column by column. A **column** of an array, image [tile, channel,
  column] or coverage [slot, column], is a vector of pixels from top to bottom: all 16 on a CPU, 4 on a GPU,
  where a tile so has 64 columns. Kernels are made for a type of column (``tile``). Those that go pixel by
  pixel have the same memory as [slot, 16 x + y].
* A **lane** is a thread's share of a tile: a CPU gives a thread a whole tile (one lane), a GPU has 64 lanes a
  tile, each a column; or 16 (row lanes), each a row of pixels.
* A **coverage mapping** turns the sum s that a model computes into a coverage: AREA, |s| clamped at 1, or
  PRODUCT, 1 - exp(-s).
* The **transmittance** of a slot is the part of the light that the slots in front let through.
* Gradients are named after their value with ``_grad``. No kernel adds floats atomically: each output
  element has one writer, so results are the same bits on every run of one device, and a launch may be cut
  into pieces (``offset`` is the index of a piece's first thread) that run on different CPU threads.
* Parameters are bound to arrays by name (``rendering.program.bind``). ``constants`` are used by their names.

Data flow of a step (forward, then its adjoint in reverse order)::

    points         --outline-->  vertices    --bins-->  slots by tile  --coverage/fill, stroke-->  coverage
    vertices       --stroker, corners-->  polygons of styled strokes, covered as fills are
    points, widths --grid-->     Gaussians   --bins-->  slots by tile  --coverage/splat-->         coverage
    coverage, paint --composite--> image --loss--> image_grad      gradients --adam--> new parameters
"""
