"""What is traced of noisy pictures is the same whichever code libraries choose for a processor.

Clean pictures, and whole files, are those of ``tests/golden``.
"""

from __future__ import annotations

import dataclasses
import hashlib
import subprocess
import sys

import numpy as np

from tests import ROOT
from tests.golden import pictures
from tests.golden.processors import environment_of
from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import trace_ink
from warpsplat.drawing.strokes.tour import toured
from warpsplat.drawing.trace.trace import trace
from warpsplat.scene import FloatArray


def noisy(image: pictures.Bytes) -> FloatArray:
    levels = image + np.random.default_rng(0).integers(-5, 6, image.shape)
    return np.asarray(np.clip(levels, 0, 255) / 255, np.float32)


def digest() -> str:
    """Of what several pictures are traced to."""
    scenes = [trace(noisy(image)).scene for image in (pictures.logo(), pictures.shaded())]
    scenes += [trace_ink(find_ink(noisy(pictures.sketch())), mixed=mixed).scene() for mixed in (True, False)]
    found = hashlib.sha256()
    for scene in (*scenes, toured(scenes[-1])):
        for name in sorted(part.name for part in dataclasses.fields(scene)):
            value = getattr(scene, name)
            if isinstance(value, np.ndarray):
                found.update(value.tobytes())
    return found.hexdigest()


def test_the_same_bits_as_on_an_old_processor() -> None:
    command = [sys.executable, "-W", "ignore", "-c", f"from {__name__} import digest; print(digest())"]
    environment = environment_of("old processor")
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == digest()
