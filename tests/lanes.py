"""Tiles divided among threads on a CPU as on a GPU, whose kernels have shorter vectors of pixels."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from warpsplat.rendering.backend import GPU_LANES, Backend


def divide_as_on_gpu(monkeypatch: pytest.MonkeyPatch, lanes: int = GPU_LANES) -> None:
    """Make backends from now on have a GPU's lanes, or fewer."""
    usual = Backend.on

    def on(*arguments: Any, **named: Any) -> Backend:
        return replace(usual(*arguments, **named), lanes=lanes)

    monkeypatch.setattr(Backend, "on", staticmethod(on))
