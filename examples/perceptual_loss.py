"""A perceptual loss: pictures are compared by what a network for images sees in them.

The weights are yours: a state dictionary of VGG16's convolutions, as torchvision saves it
(``features.0.weight`` ...); no network's weights come with this program.
"""

import sys

import torch
import torch.nn.functional as F  # noqa: N812 - its usual name

import warpsplat
from warpsplat.torch import Module

POOLED = {2, 4, 7, 10}
"""Convolutions of VGG16, counted from 0, before which the picture is halved."""
COMPARED = {1, 3, 6}
"""Those after which pictures are compared."""
REDUCED = 2
"""How much smaller the network sees pictures, for speed."""
MEAN, DEVIATION = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])


def load(path: str) -> list[tuple[torch.Tensor, torch.Tensor]]:
    """Weights and biases of the convolutions, in order."""
    state = torch.load(path, map_location="cpu", weights_only=True)
    names = sorted(
        (name for name in state if name.endswith(".weight") and state[name].ndim == 4), key=_number
    )
    return [(state[name], state[name.replace(".weight", ".bias")]) for name in names]


def _number(name: str) -> int:
    return int(name.split(".")[-2])


def features(layers: list[tuple[torch.Tensor, torch.Tensor]], image: torch.Tensor) -> list[torch.Tensor]:
    """What the network sees in an image of shape (height, width, 3), at several depths."""
    x, found = F.avg_pool2d(((image - MEAN) / DEVIATION).permute(2, 0, 1)[None], REDUCED), []
    for i, (weight, bias) in enumerate(layers[: max(COMPARED) + 1]):
        x = F.max_pool2d(x, 2) if i in POOLED else x
        x = F.relu(F.conv2d(x, weight, bias, padding=1))
        if i in COMPARED:
            found.append(x)
    return found


def main(source: str, output: str, weights: str, steps: int = 60, curves: int = 200) -> list[float]:
    """The loss after each step."""
    layers = load(weights)
    wanted = torch.tensor(warpsplat.load_image(source))[..., :3]
    seen = features(layers, wanted)
    module = Module(warpsplat.starting_scene(source, curves))
    optimizer = torch.optim.Adam(module.parameter_groups())
    losses = []
    for _ in range(steps):
        shown = module()[..., :3]
        apart = [
            F.mse_loss(a, b) / b.square().mean() for a, b in zip(features(layers, shown), seen, strict=True)
        ]
        loss = sum(apart) + 10 * F.mse_loss(shown, wanted)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        module.project()
        losses.append(loss.item())
    warpsplat.save_svg(module.scene(), output)
    return losses


if __name__ == "__main__":
    if len(sys.argv) <= 3:
        sys.exit(f"usage: {sys.argv[0]} IMAGE OUTPUT.svg WEIGHTS.pth [STEPS]")
    found = main(*sys.argv[1:4], *map(int, sys.argv[4:]))
    print(f"loss {found[0]:.4f} -> {found[-1]:.4f}")
