"""Writing pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from PIL import Image

Pixels = torch.Tensor | npt.NDArray[np.floating]

COMPRESSION = 1
"""Of PNGs: scripts write one a step, and the best compression takes longer than the step."""


def imwrite(img: Pixels, filename: str | Path, gamma: float = 2.2, normalize: bool = False) -> None:
    """Write a picture as 8 bits; folders that are missing are made.

    Args:
        img: shape (height, width), or with 1 to 4 channels (height, width, channel), the fourth of which is
            opacity.
        filename: its ending says the format.
        gamma: the first three channels are raised to its inverse; 1 for colours that are sRGB already.
        normalize: whether the least value is made 0 and the largest 1 before.
    """
    values = img.detach().cpu().numpy() if isinstance(img, torch.Tensor) else np.asarray(img)
    values = values.astype(np.float32)
    if normalize and np.ptp(values) > 0:
        values = (values - values.min()) / np.ptp(values)
    values = np.clip(values, 0.0, 1.0)
    if values.ndim == 2:
        values = values[:, :, None]
    if gamma != 1:
        values[:, :, :3] **= 1 / gamma
    pixels = (255 * values + 0.5).astype(np.uint8)
    path = Path(filename)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() in {".jpg", ".jpeg"}:
        pixels = pixels[:, :, :3]
    made = Image.fromarray(pixels.squeeze(2) if pixels.shape[2] == 1 else pixels)
    if path.suffix.lower() == ".png":
        made.save(path, compress_level=COMPRESSION)
    else:
        made.save(path)
