"""Fit an image with a loss of your own: absolute differences, of colours and of edges."""

import sys

import torch

import warpsplat
from warpsplat.torch import Module


def edges(image: torch.Tensor) -> torch.Tensor:
    """Differences of neighbouring pixels."""
    return torch.cat([image.diff(dim=0).flatten(), image.diff(dim=1).flatten()])


def main(source: str, output: str, steps: int = 200, curves: int = 200) -> list[float]:
    """The loss after each step."""
    start = warpsplat.starting_scene(source, curves)
    wanted = torch.tensor(warpsplat.load_image(source))[..., :3]
    module = Module(start)
    optimizer = torch.optim.Adam(module.parameter_groups())
    losses = []
    for _ in range(steps):
        shown = module()[..., :3]
        loss = (shown - wanted).abs().mean() + 2 * (edges(shown) - edges(wanted)).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        module.project()
        losses.append(loss.item())
    warpsplat.save_svg(module.scene(), output)
    return losses


if __name__ == "__main__":
    if len(sys.argv) <= 2:
        sys.exit(f"usage: {sys.argv[0]} IMAGE OUTPUT.svg [STEPS]")
    found = main(*sys.argv[1:3], *map(int, sys.argv[3:]))
    print(f"loss {found[0]:.4f} -> {found[-1]:.4f}")
