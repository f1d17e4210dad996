"""Declare the commands about the program itself."""

from warpsplat.extensions import Command, Extension

EXTENSION = Extension(
    commands={
        name: Command(text, f"warpsplat.tools.commands.{name}:command")
        for name, text in {
            "compare": "Compare our files with another program's.",
            "bench": "Time the stages of a training step.",
            "info": "Show version and devices.",
            "doctor": "Check that everything a run needs works.",
        }.items()
    },
    uses=("torch",),
)
