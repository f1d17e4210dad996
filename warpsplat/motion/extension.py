"""Declare animations, and previews in terminals and notebooks."""

from warpsplat.extensions import Extension

EXTENSION = Extension(
    run_hooks=("warpsplat.motion.hook:MotionHook",),
    api={"Recorder": "warpsplat.motion.recorder", "Live": "warpsplat.motion.notebook"},
)
