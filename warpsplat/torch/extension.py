"""The PyTorch interface: losses for fits; the command line gets nothing from it."""

from warpsplat.extensions import Extension

EXTENSION = Extension(provides={"torch_loss": "warpsplat.torch.loss:with_gradient"})
