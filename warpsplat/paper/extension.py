"""The extension that adds the paper's renderers to the core."""

from warpsplat.extensions import Extension

EXTENSION = Extension(
    renderers={
        "splat": "warpsplat.paper.renderers:SPLAT",
        "gaussian": "warpsplat.paper.renderers:GAUSSIAN",
    }
)
