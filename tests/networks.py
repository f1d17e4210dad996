"""Stand-ins for packages of networks whose weights the documentation's readers bring: small ones."""

from __future__ import annotations

from types import ModuleType
from typing import Any


def stand_ins() -> dict[str, ModuleType]:
    """Return modules like ``lpips`` and ``open_clip``, by name."""
    import torch

    class Lpips(torch.nn.Module):
        def __init__(self, net: str) -> None:
            super().__init__()
            self.layer = torch.nn.Conv2d(3, 4, 3)

        def forward(self, one: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
            return (self.layer(one) - self.layer(other)).square().mean(dim=(1, 2, 3), keepdim=True)

    class Clip(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.layer = torch.nn.Conv2d(3, 8, 32, stride=32)

        def encode_image(self, images: torch.Tensor) -> torch.Tensor:
            assert images.shape[1:] == (3, 224, 224)
            found: torch.Tensor = self.layer(images).mean(dim=(2, 3))
            return found

        def encode_text(self, tokens: torch.Tensor) -> torch.Tensor:
            return torch.ones(len(tokens), 8)

    def create(name: str, *, pretrained: str) -> tuple[Any, None, None]:
        return Clip(), None, None

    lpips, open_clip = ModuleType("lpips"), ModuleType("open_clip")
    vars(lpips)["LPIPS"] = Lpips
    vars(open_clip)["create_model_and_transforms"] = create
    vars(open_clip)["get_tokenizer"] = lambda name: lambda texts: torch.zeros(len(texts), 77)
    return {"lpips": lpips, "open_clip": open_clip}
