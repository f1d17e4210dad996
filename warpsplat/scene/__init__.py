"""Scenes: shapes on a canvas, which are optimised and which files hold. NumPy only."""

from warpsplat.scene.attributes import (
    ATTRIBUTES,
    GRADIENTS,
    NO_DASHES,
    NO_PICTURE,
    OPACITY_RANGE,
    TRAITS,
    Attribute,
    Basis,
    Cap,
    Join,
    Kind,
    Paint,
    Rule,
    Spread,
    Unit,
)
from warpsplat.scene.scene import Canvas, FloatArray, IndexArray, Picture, Scene

__all__ = [
    "ATTRIBUTES",
    "GRADIENTS",
    "NO_DASHES",
    "NO_PICTURE",
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
    "Paint",
    "Picture",
    "Rule",
    "Scene",
    "Spread",
    "Unit",
]
