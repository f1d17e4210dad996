"""Reports on results, and the command ``serve``."""

from warpsplat.extensions import Command, Extension

EXTENSION = Extension(
    commands={
        "serve": Command(
            "Open a page to vectorize images in a browser.", "warpsplat.pages.serve.command:command"
        )
    },
    run_hooks=("warpsplat.pages.hook:ReportHook",),
    api={"report": "warpsplat.pages.report"},
)
