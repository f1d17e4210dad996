"""What is optimised and what a file holds: shapes on a canvas. NumPy only."""

from warpsplat.scene.attributes import ATTRIBUTES, OPACITY_RANGE, Attribute, Basis, Kind, Unit
from warpsplat.scene.scene import Canvas, FloatArray, IndexArray, Scene

__all__ = [
    "ATTRIBUTES",
    "OPACITY_RANGE",
    "Attribute",
    "Basis",
    "Canvas",
    "FloatArray",
    "IndexArray",
    "Kind",
    "Scene",
    "Unit",
]
