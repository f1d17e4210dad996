"""Declare animations and terminal previews."""

from warpsplat.extensions import Extension

EXTENSION = Extension(
    run_hooks=("warpsplat.motion.hook:MotionHook",), api={"Recorder": "warpsplat.motion.recorder"}
)
