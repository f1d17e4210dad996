"""What is optimised and what a file holds: shapes on a canvas. NumPy only."""

from warpsplat.scene.attributes import ATTRIBUTES, Attribute, Kind, Unit
from warpsplat.scene.scene import Canvas, FloatArray, IndexArray, Scene

__all__ = ["ATTRIBUTES", "Attribute", "Canvas", "FloatArray", "IndexArray", "Kind", "Scene", "Unit"]
