"""Declare the commands about the program itself."""

from warpsplat.extensions import Command, Extension

FOLDER = "warpsplat.tools.commands"

EXTENSION = Extension(
    commands={
        "bench": Command("Time the stages of a training step.", f"{FOLDER}.bench:command"),
        "info": Command("Show version and devices.", f"{FOLDER}.doctor:info"),
        "doctor": Command("Check that everything a run needs works.", f"{FOLDER}.doctor:command"),
    },
    uses=("torch",),
)
