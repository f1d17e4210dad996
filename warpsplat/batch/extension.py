"""The extension ``batch``: its command, ``vectorize`` with several images, and presets."""

from warpsplat.extensions import Command, Extension

EXTENSION = Extension(
    commands={
        "batch": Command(
            "Vectorize many images: files, folders, patterns, lists.", "warpsplat.batch.command:command"
        )
    },
    provides={
        "vectorize_images": "warpsplat.batch.command:vectorize_images",
        "preset_names": "warpsplat.batch.presets:preset_names",
        "with_preset": "warpsplat.batch.presets:with_preset",
    },
    api={"load_preset": "warpsplat.batch.presets"},
    uses=("pages",),
)
