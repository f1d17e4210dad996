"""Morph one picture into another: the same shapes are fitted to both, and what lies between is interpolated.

Writes OUTPUT, an animated WebP or GIF that goes from one picture to the other and back.
"""

import sys

import torch
from PIL import Image

import warpsplat
from warpsplat.torch import Module, SceneTensors, render


def opaque(path: str) -> Image.Image:
    """A picture on white: all shapes are seen then, and none hides in black where nothing is."""
    image = warpsplat.to_pillow(warpsplat.load_image(path)).convert("RGBA")
    return Image.alpha_composite(Image.new("RGBA", image.size, "white"), image).convert("RGB")


def fitted(scene: warpsplat.Scene, wanted: torch.Tensor, steps: int) -> tuple[Module, float]:
    """The shapes of ``scene`` as they show ``wanted``, and the mean squared error that is left."""
    module = Module(scene)
    optimizer = torch.optim.Adam(module.parameter_groups())
    for _ in range(steps):
        optimizer.zero_grad()
        loss = (module()[..., :3] - wanted).square().mean()
        loss.backward()
        optimizer.step()
        module.project()
    return module, loss.item()


def between(a: SceneTensors, b: SceneTensors, share: float) -> SceneTensors:
    """The scene that lies ``share`` of the way from ``a`` to ``b``."""
    values = {name: torch.lerp(a.values[name], b.values[name], share) for name in a.values}
    return SceneTensors(a.layout, values)


def main(first: str, second: str, output: str, steps: int = 150, curves: int = 120) -> list[float]:
    """Mean squared errors of both ends."""
    image = opaque(first)
    a, b = warpsplat.load_image(image), warpsplat.load_image(opaque(second).resize(image.size))
    start, start_error = fitted(warpsplat.starting_scene(image, curves), torch.tensor(a), steps)
    end, end_error = fitted(start.scene(), torch.tensor(b), 2 * steps)
    with torch.no_grad():
        shares = [i / 12 for i in (*range(13), *range(11, 0, -1))]
        shown = render([between(start.tensors(), end.tensors(), share) for share in shares])
    frames = [warpsplat.to_pillow(each.numpy()) for each in shown]
    frames[0].save(output, save_all=True, append_images=frames[1:], duration=80, loop=0)
    return [start_error, end_error]


if __name__ == "__main__":
    if len(sys.argv) <= 3:
        sys.exit(f"usage: {sys.argv[0]} FIRST SECOND OUTPUT.webp [STEPS]")
    found = main(*sys.argv[1:4], *map(int, sys.argv[4:]))
    print(f"mean squared errors of the ends: {found[0]:.5f}, {found[1]:.5f}")
