"""warpsplat: raster image in, SVG of Bézier shapes out, by gradient descent."""

from warpsplat._version import __version__ as __version__
