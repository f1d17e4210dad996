"""Strokes that paint a picture under a mask only: in an ellipse in its middle, or where MASK.png is white."""

import sys

import cv2
import numpy as np
import torch

import warpsplat
from warpsplat.torch import Module, over


def ellipse(height: int, width: int) -> np.ndarray:
    """1 inside, 0 outside, shape (height, width)."""
    mask = np.zeros((height, width), np.float32)
    cv2.ellipse(mask, (width // 2, height // 2), (width // 3, height // 3), 0, 0, 360, 1.0, -1)
    return mask


def main(source: str, output: str, steps: int = 200, mask: str = "", curves: int = 150) -> list[float]:
    """The loss after each step."""
    image = warpsplat.load_image(source)[..., :3]
    height, width = image.shape[:2]
    inside = warpsplat.load_image(mask)[..., :1] if mask else ellipse(height, width)[..., None]
    # Outside the mask the picture has no opacity: shapes that reach there are wrong on any background.
    wanted = torch.tensor(np.concatenate([image * inside, inside], axis=2))
    straight = np.concatenate([image, inside], axis=2)
    module = Module(warpsplat.starting_scene(straight, curves, open=True))
    optimizer = torch.optim.Adam(module.parameter_groups())
    losses = []
    for _ in range(steps):
        shown = module()
        loss = sum((over(shown, grey) - over(wanted, grey)).square().mean() for grey in (0.0, 1.0))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        module.project()
        losses.append(loss.item())
    warpsplat.save_svg(module.scene(), output)
    return losses


if __name__ == "__main__":
    if len(sys.argv) <= 2:
        sys.exit(f"usage: {sys.argv[0]} IMAGE OUTPUT.svg [STEPS] [MASK.png]")
    found = main(*sys.argv[1:3], *map(int, sys.argv[3:4]), *sys.argv[4:5])
    print(f"loss {found[0]:.4f} -> {found[-1]:.4f}")
