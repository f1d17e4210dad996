"""What animations and terminal previews add to the core."""

from warpsplat.extensions import Extension

EXTENSION = Extension(
    run_hooks=("warpsplat.motion.hook:MotionHook",), api={"Recorder": "warpsplat.motion.recorder"}
)
