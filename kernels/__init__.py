"""Device side of warpsplat: Warp kernels, one file a stage, in pipeline order.

Conventions, here once:

* Lengths are pixels of the image being rendered ([px]); x right, y down; the centre of pixel
  (column j, row i) lies at (j + 0.5, i + 0.5), as in SVG. The scene itself is in canvas units (pixels of
  the input image); ``scale`` in ``sample`` takes it to render pixels.
* Colours are sRGB values in [0, 1], not linearised (SVG composites so), straight, not premultiplied.
* A *curve* is one shape of the scene; row 0 is painted first (furthest back), as in SVG.
* A *part* is what is composited once with one opacity: a whole curve, or one segment of a stroke that
  has an opacity per segment. Part ``p`` belongs to curve ``p // opacity_count``.
* A part is sampled on a grid of ``rows x columns`` Gaussians; Gaussian ``part_first + row * columns +
  column``. Columns run along the curve, rows across it.
* A *slot* is one (part, tile) pair. The slots of a part are the tiles of its bounding rectangle, row by
  row, parts from the front to the back, so that the slot of a pixel is found by arithmetic.
* Pixels lie by tiles, and in a tile by columns: an image is [tile, channel, column], a coverage [slot,
  column], each element a vector of the 16 pixels from top to bottom (``tile.column``). Kernels that go pixel
  by pixel have the same memory as [slot, 16 x column + row].
* The state of a slot says whether it is covered (``constants.COVERED``, ``UNCOVERED``), and so whether there
  is a coverage to read; HIDDEN ones are on no list.
* A CPU gives a thread a whole tile (one lane); a GPU has 16 lanes a tile, each a row or a column.
* Gradients are named after their value with ``_grad``. No kernel adds floats atomically: each output
  element has one writer, so results are the same bits on every run of one device, and a launch may be cut
  into pieces (``first`` is the index of a piece's first thread) that run on different CPU threads.

Data flow of a step (forward, then its adjoint in reverse order)::

    points, widths  --sample-->  grid positions  --gaussian-->  mean, conic, extent
                    --bin-->     slots sorted by tile, front to back
                    --splat-->   coverage per slot and pixel (1 - product of 1 - g)
    points          --flatten--> vertices, --bin-->, --fill--> or --stroke--> coverage
                    --composite--> image    --loss-->  image_grad    --adam--> new parameters
"""
