"""A transform as a turn, scales, a shear and a shift."""

from __future__ import annotations

import math
from typing import Any

import torch

from warpsplat.errors import UsageError, shown

Tensor = torch.Tensor

MODES = ("move", "rigid", "similarity", "affine")
ALIKE = 1e-3
"""By how much a transform may differ from what a mode can say."""


class Motion(torch.nn.Module):
    """``turn @ scale @ shear @ shift``, as far as a mode optimises them; what else a transform does stays in
    front.
    """

    fixed: Tensor
    mirror: Tensor

    def __init__(self, matrix: Tensor, settings: dict[str, Any]) -> None:
        """Begin at ``matrix``, shape (3, 3).

        Raises:
            UsageError: a mode that is none.
        """
        super().__init__()
        mode = settings["transform_mode"]
        if mode not in MODES:
            raise UsageError(f"transform_mode {shown(mode)} is none of {', '.join(MODES)}")
        self.optimizes = bool(settings["optimize_transforms"])
        self._rates = settings["transform_lr"], settings["transform_lr"] * settings["translation_mult"]
        turn, scale, shear, shift = decompose(matrix.double())
        mirrored = scale[0] * scale[1] < 0
        uniform = abs(abs(scale[0]) - abs(scale[1])) < ALIKE and abs(shear) < ALIKE
        fits = {
            "move": uniform and abs(abs(scale[0]) - 1) < ALIKE and not mirrored,
            "rigid": uniform and not mirrored,
            "similarity": uniform,
            "affine": True,
        }[mode]
        self.register_buffer("fixed", torch.eye(3) if fits else matrix.clone())
        if not fits:
            turn, scale, shear, shift, mirrored = 0.0, (1.0, 1.0), 0.0, (0.0, 0.0), False
        self.register_buffer("mirror", torch.tensor([1.0, -1.0 if mirrored and mode != "affine" else 1.0]))

        def number(value: Any, optimized: bool = True) -> torch.nn.Parameter:
            return torch.nn.Parameter(
                torch.tensor(value, dtype=torch.float32), requires_grad=optimized and self.optimizes
            )

        self.turn = number(turn)
        self.scale = number(scale if mode == "affine" else scale[:1], mode != "move")
        self.shear = number(shear, mode == "affine")
        self.shift = number(shift)

    def parameter_groups(self) -> list[dict[str, Any]]:
        """What an optimiser takes."""
        others = [p for p in (self.turn, self.scale, self.shear) if p.requires_grad]
        return [{"params": others, "lr": self._rates[0]}, {"params": [self.shift], "lr": self._rates[1]}]

    def forward(self) -> Tensor:
        """The transform, shape (3, 3)."""
        cos, sin = self.turn.cos(), self.turn.sin()
        zero, one = torch.zeros_like(cos), torch.ones_like(cos)
        turn = torch.stack([torch.stack([cos, -sin]), torch.stack([sin, cos])])
        scale = self.scale.expand(2) * self.mirror
        shear = torch.stack([torch.stack([one, self.shear]), torch.stack([zero, one])])
        linear = (turn * scale) @ shear
        moved = torch.cat([linear, (linear @ self.shift)[:, None]], dim=1)
        last = torch.stack([zero, zero, one])[None]
        return self.fixed @ torch.cat([moved, last])

    def text(self) -> str:
        """As a value of ``transform``."""
        values = self()[:2].T.flatten().tolist()
        return f"matrix({' '.join(f'{value:.7g}' for value in values)})"


def decompose(matrix: Tensor) -> tuple[float, tuple[float, float], float, tuple[float, float]]:
    """Turn, scales, shear and shift whose product is ``matrix``, shape (3, 3)."""
    (a, c), (b, d) = matrix[:2, :2].tolist()
    turn, first = math.atan2(b, a), math.hypot(a, b)
    shear = (a * c + b * d) / (first * first)
    shift = torch.linalg.solve(matrix[:2, :2], matrix[:2, 2]).tolist()
    return turn, (first, (a * d - b * c) / first), shear, (shift[0], shift[1])
