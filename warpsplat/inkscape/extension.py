"""The command ``inkscape``."""

from warpsplat.extensions import Command, Extension

EXTENSION = Extension(
    commands={
        "inkscape": Command("Install the Inkscape extension.", "warpsplat.inkscape.command:command"),
    }
)
