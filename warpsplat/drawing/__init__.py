"""Drawings, line art and pixel art: traced, fitted and tidied.

The words of these modules:

* picture: an image as it is drawn, without enlargement, noise of flat colours and surplus margin
  (``picture``).
* colouring: what a part of a picture is painted with: a flat colour, a gradient, or a band, which is a step
  of smooth shading.
* region: connected pixels of one colouring.
* share: the part of a pixel's area that a colouring covers; doubt: how far off a share may be
  (``trace.shares``).
* partition: the plane cut up into regions, whose boundaries are contours of shares; cell: the unit of its
  grid, a pixel or less (``trace.partition``).
* crack: the side of a cell between two regions; loop: cracks around a region; outline: a loop as a line.
* span: an outline between two corners; knot: where one curve of a span may end and the next begin.
* node: where two curves of a path meet; joint: how they do.
* price: the error that a byte is worth (``prices``).
* glyph: a letter, or another small part, that is drawn once and placed several times.
* optics: what made a picture of sharp shapes: the light in which colours were mixed, and a kernel
  (``optics``).
* ink: the colour of thin parts; pen: the colour and width of strokes.
"""
