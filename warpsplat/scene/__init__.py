"""What is optimised and what a file holds: shapes on a canvas. NumPy only."""

from warpsplat.scene.attributes import (
    ATTRIBUTES,
    NO_DASHES,
    OPACITY_RANGE,
    TRAITS,
    Attribute,
    Basis,
    Cap,
    Join,
    Kind,
    Rule,
    Unit,
)
from warpsplat.scene.scene import Canvas, FloatArray, IndexArray, Scene

__all__ = [
    "ATTRIBUTES",
    "NO_DASHES",
    "OPACITY_RANGE",
    "TRAITS",
    "Attribute",
    "Basis",
    "Canvas",
    "Cap",
    "FloatArray",
    "IndexArray",
    "Join",
    "Kind",
    "Rule",
    "Scene",
    "Unit",
]
