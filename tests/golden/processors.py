"""Environments in which libraries take the code of other processors."""

from __future__ import annotations

import os

from tests import ROOT

SETTINGS: dict[str, dict[str, str]] = {
    "native": {},
    "without AVX-512": {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL"},
    "old processor": {
        "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL",
        "OPENBLAS_CORETYPE": "Nehalem",
        "OPENCV_IPP": "disabled",
        "OPENCV_CPU_DISABLE": "AVX2,FP16,AVX,SSE4.2",
        "OPENCV_FOR_THREADS_NUM": "3",
        "OMP_NUM_THREADS": "3",
    },
}
"""By which libraries take the code of other processors; they read these when they are imported."""


def environment_of(processor: str) -> dict[str, str]:
    return {**os.environ, **SETTINGS[processor], "PYTHONPATH": str(ROOT)}
