"""The differentiable renderer for PyTorch: ``pip install warpsplat[torch]``.

``render`` draws a scene whose attributes are tensors (``SceneTensors``) and carries gradients back to them;
``Module`` holds such a scene as parameters. Both run on the tensors' device.
"""

try:
    import torch as _torch  # noqa: F401 - only to say how to install it
except ImportError as error:
    raise ImportError("warpsplat.torch needs PyTorch: pip install warpsplat[torch]") from error

from warpsplat.torch.function import over as over
from warpsplat.torch.function import render as render
from warpsplat.torch.kept import clear_cache as clear_cache
from warpsplat.torch.module import Module as Module
from warpsplat.torch.tensors import SceneTensors as SceneTensors
