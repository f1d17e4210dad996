"""DiffVG's painterly rendering with our module: filled shapes follow a photograph."""

import sys

import torch

import warpsplat
from warpsplat.torch import Module


def main(source: str, output: str, steps: int = 200, curves: int = 128) -> list[float]:
    """The loss after each step."""
    wanted, losses = torch.tensor(warpsplat.load_image(source))[..., :3], []
    module = Module(warpsplat.starting_scene(source, curves))
    optimizer = torch.optim.Adam(module.parameter_groups())
    for _ in range(steps):
        optimizer.zero_grad()
        loss = torch.nn.functional.mse_loss(module()[..., :3], wanted)
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
