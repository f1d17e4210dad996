"""Programs of PyTorch users, on the test device or the CPU: prints digests of images and gradients.

python -m tests.fake_cuda.torch_programs cuda|side|cpu
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import sys
from collections.abc import Callable

import numpy as np
import pytest
import torch

import warpsplat.torch
from tests.lanes import divide_as_on_gpu
from tests.scenes import mixed_scene, random_scene
from warpsplat import pydiffvg
from warpsplat.rendering.device import start_warp
from warpsplat.scene import Kind
from warpsplat.torch import clear_cache, kept

Tensors = dict[str, torch.Tensor]


def digest(tensor: torch.Tensor) -> str:
    """Return a digest of a tensor's bytes."""
    return hashlib.sha256(np.array(tensor.detach().tolist(), np.float32).tobytes()).hexdigest()[:12]


def steps_of_torch() -> Tensors:
    """Render a scene, follow its gradient twice."""
    module = warpsplat.torch.Module(mixed_scene(48, 32))
    optimizer = torch.optim.SGD(module.parameters(), lr=0.1)
    for _ in range(2):
        optimizer.zero_grad()
        image = module()
        ((image - 0.5) ** 2).sum().backward()
        optimizer.step()
    grads = {name: value.grad for name, value in module.named_parameters() if value.grad is not None}
    return {"image": image, **grads}


def circle_of_pydiffvg(output: pydiffvg.OutputType = pydiffvg.OutputType.color) -> Tensors:
    """Render a circle and differentiate by its radius."""
    radius = torch.tensor(9.0, requires_grad=True, device=pydiffvg.get_device())
    circle = pydiffvg.Circle(radius=radius, center=torch.tensor([20.0, 14.0]))
    group = pydiffvg.ShapeGroup(shape_ids=torch.tensor([0]), fill_color=torch.tensor([0.2, 0.6, 0.3, 0.8]))
    arguments = pydiffvg.RenderFunction.serialize_scene(48, 32, [circle], [group], output_type=output)
    image = pydiffvg.RenderFunction.apply(48, 32, 2, 2, 0, None, *arguments)
    image.square().sum().backward()
    assert radius.grad is not None
    return {"image": image, "radius": radius.grad}


def distances_of_pydiffvg() -> Tensors:
    """Measure distances from the circle."""
    return circle_of_pydiffvg(pydiffvg.OutputType.sdf)


def renderers_that_leave() -> Tensors:
    """Render on two streams, so that renderers leave the cache while they are at work on the other one."""
    found, usual, kept.KEPT = {}, kept.KEPT, 1
    streams = [None, None] if pydiffvg.get_device().type == "cpu" else [torch.cuda.Stream() for _ in range(2)]
    scenes = [
        warpsplat.torch.SceneTensors.of(random_scene(Kind.FILL, 3 + i), pydiffvg.get_device())
        for i in range(4)
    ]
    for i, scene in enumerate(scenes):
        with torch.cuda.stream(streams[i % 2]):
            found[str(i)] = warpsplat.torch.render(scene)
    for i, image in enumerate(found.values()):
        with torch.cuda.stream(streams[i % 2]):
            found[str(i)] = image.clone()
    kept.KEPT = usual
    return found


PROGRAMS: tuple[Callable[[], Tensors], ...] = (
    steps_of_torch,
    circle_of_pydiffvg,
    distances_of_pydiffvg,
    renderers_that_leave,
)


def main() -> None:
    """Run all programs on the device of the first argument."""
    start_warp()
    context: contextlib.AbstractContextManager[None] = contextlib.nullcontext()
    if sys.argv[1] == "cpu":
        divide_as_on_gpu(pytest.MonkeyPatch())
    else:
        from tests.fake_cuda.torch_device import tensors_on_device

        context = tensors_on_device(side_stream=sys.argv[1] == "side")
    with context:
        pydiffvg.set_device(torch.device("cpu" if sys.argv[1] == "cpu" else "cuda:0"))
        for program in PROGRAMS:
            found = {name: digest(tensor) for name, tensor in program().items()}
            print(json.dumps({program.__name__: found}))
        clear_cache()


if __name__ == "__main__":
    main()
