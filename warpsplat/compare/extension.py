"""Declare the command that compares our files with another program's."""

from warpsplat.extensions import Command, Extension

EXTENSION = Extension(
    commands={
        "compare": Command("Compare our files with another program's.", "warpsplat.compare.command:command")
    },
)
