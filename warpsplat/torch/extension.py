"""The PyTorch interface adds nothing to the command line."""

from warpsplat.extensions import Extension

EXTENSION = Extension()
