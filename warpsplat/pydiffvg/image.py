"""Image files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch
from PIL import Image


def imwrite(
    img: torch.Tensor | npt.NDArray[np.floating],
    filename: str | Path,
    gamma: float = 2.2,
    normalize: bool = False,
) -> None:
    """Write an image with 8 bits per channel, in the format of the extension; missing folders are made.

    ``img``: in [0, 1], shape (height, width) or (height, width, channel) with 1 to 4 channels, the fourth of
    which is opacity. The others are raised to the power 1 / ``gamma``; 1 for colours that are sRGB.
    ``normalize``: whether to map the least value to 0 and the largest to 1 first.
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
    image = Image.fromarray(pixels.squeeze(2) if pixels.shape[2] == 1 else pixels)
    # Scripts write an image at each step, and the best compression takes longer than the step.
    png_compression = 1
    image.save(path, compress_level=png_compression)  # which other formats ignore
