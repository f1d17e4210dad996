"""What is traced is the same whichever code NumPy, OpenCV and BLAS choose for a processor."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import importlib
import os
import subprocess
import sys

import numpy as np

from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import trace_ink
from warpsplat.drawing.strokes.tour import toured
from warpsplat.drawing.trace.trace import trace
from warpsplat.scene import FloatArray

FINE = 8
WIDTH, HEIGHT = 96, 72
Y, X = np.mgrid[: FINE * HEIGHT, : FINE * WIDTH]


def antialiased(fine: np.ndarray) -> np.ndarray:
    """Levels of 8 bits, in whole numbers."""
    sums = fine.reshape(HEIGHT, FINE, WIDTH, FINE, 3).sum(axis=(1, 3))
    return np.asarray((2 * sums + FINE * FINE) // (2 * FINE * FINE), np.int64)


def disc(x: int, y: int, radius: int) -> np.ndarray:
    return np.asarray((X - x) * (X - x) + (Y - y) * (Y - y) < radius * radius)


def painted(*parts: tuple[np.ndarray, tuple[int, int, int]]) -> np.ndarray:
    fine = np.full((*X.shape, 3), 250)
    for inside, color in parts:
        fine[inside] = color
    return fine


def drawing() -> np.ndarray:
    fine = painted(
        (disc(260, 280, 210), (40, 90, 200)),
        (3 * X - 7 * Y > 420, (230, 60, 70)),
        (2 * (X - 480) * (X - 480) + 5 * (Y - 400) * (Y - 400) < 30_000, (20, 20, 20)),
        (disc(240, 300, 30), (255, 210, 0)),
    )
    ramp = (abs(X - 620) < 100) & (abs(Y - 440) < 110)
    fine[ramp] = np.stack([X // 4, 255 - Y // 3, X // 9 + Y // 9], axis=2)[ramp]
    return antialiased(fine)


def line_art() -> np.ndarray:
    ring = disc(260, 300, 200) & ~disc(260, 300, 176)
    fork = (abs(5 * X - 7 * Y + 300) < 110) | ((abs(3 * X + 4 * Y - 3300) < 60) & (X > 400))
    return antialiased(
        painted(
            (ring, (0, 0, 0)), (fork & (X > 80) & (X < 700), (0, 0, 0)), (disc(660, 120, 40), (200, 0, 0))
        )
    )


def image(levels: np.ndarray) -> FloatArray:
    return np.asarray(np.clip(levels, 0, 255) / 255, np.float32)


@functools.cache
def digest() -> str:
    """Of what several pictures are traced to."""
    noise = np.random.default_rng(0).integers(-5, 6, (HEIGHT, WIDTH, 3))
    scenes = [trace(image(levels)).scene for levels in (drawing(), drawing() + noise)]
    scenes.append(trace_ink(find_ink(image(line_art())), mixed=True).scene())
    for levels in (line_art(), line_art() + noise):
        scenes.append(trace_ink(find_ink(image(levels))).scene())
        scenes.append(toured(scenes[-1]))
    found = hashlib.sha256()
    for scene in scenes:
        for name in sorted(part.name for part in dataclasses.fields(scene)):
            value = getattr(scene, name)
            if isinstance(value, np.ndarray):
                found.update(value.tobytes())
    return found.hexdigest()[:16]


def old_processor() -> dict[str, str]:
    """Settings by which libraries take the code that runs on any processor of this kind."""
    numpy = importlib.import_module("numpy._core._multiarray_umath")
    known = [name for name in numpy.__cpu_dispatch__ if numpy.__cpu_features__.get(name)]
    return {
        "NPY_DISABLE_CPU_FEATURES": " ".join(known),
        "OPENBLAS_CORETYPE": "Nehalem",
        "OPENCV_IPP": "disabled",
        "OPENCV_CPU_DISABLE": "AVX2,FP16,AVX,SSE4.2",
    }


def test_the_same_bits_as_ever() -> None:
    assert digest() == "065a12cf35472a6a"


def test_the_same_bits_as_on_an_old_processor() -> None:
    settings = {
        **os.environ,
        **old_processor(),
        "OMP_NUM_THREADS": "3",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    code = f"import cv2; cv2.setNumThreads(3); from {__name__} import digest; print(digest())"
    done = subprocess.run(
        [sys.executable, "-c", code], env=settings, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == digest()
