"""The extension ``batch``: its command, and ``vectorize`` with several images."""

from warpsplat.extensions import Command, Extension

EXTENSION = Extension(
    commands={
        "batch": Command(
            "Vectorize many images: files, folders, patterns, lists.", "warpsplat.batch.command:command"
        )
    },
    provides={"vectorize_images": "warpsplat.batch.command:vectorize_images"},
    uses=("pages",),
)
