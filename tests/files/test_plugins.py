"""Formats that need further packages: read as others are, or refused with what to install."""

from __future__ import annotations

import importlib
import io
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags, Image

from tests.files.profiles import DISPLAY_P3, rgb_profile
from warpsplat.errors import ImageError
from warpsplat.files.image import image_facts
from warpsplat.files.plugins import PLUGINS, Plugin, plugin_formats
from warpsplat.files.sources import image_of

HEADS = {"HEIF": b"\0\0\0\x1cftypheic\0\0\0\0mif1heic", "JXL": b"\xff\x0a\x10\0"}

each = pytest.mark.parametrize("plugin", PLUGINS, ids=lambda plugin: plugin.format)


def saved(plugin: Plugin, image: Image.Image, **options: Any) -> bytes:
    """Return an image in a plugin's format; skip the test without it."""
    pytest.importorskip(plugin.module)
    plugin_formats(HEADS[plugin.format])
    out = io.BytesIO()
    image.save(
        out, plugin.format, **({"lossless": True} if plugin.format == "JXL" else {"quality": 100}), **options
    )
    return out.getvalue()


def halves() -> Image.Image:
    pixels = np.zeros((24, 40, 3), np.uint8)
    pixels[:, :20] = (20, 60, 200)
    pixels[:, 20:] = (220, 150, 40)
    return Image.fromarray(pixels)


@each
def test_colours_are_read(plugin: Plugin) -> None:
    found = image_of(saved(plugin, halves()))
    assert found.shape == (24, 40, 3)
    np.testing.assert_allclose(found, np.asarray(halves()) / 255, atol=8 / 255)


@each
def test_it_is_upright(plugin: Plugin) -> None:
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    exif[ExifTags.Base.XResolution] = exif[ExifTags.Base.YResolution] = 300.0
    data = saved(plugin, halves(), exif=exif.tobytes())
    found, facts = image_of(data), image_facts(data)
    assert found.shape == (40, 24, 3)
    assert found[2, 12, 2] > found[2, 12, 0]
    assert found[-3, 12, 2] < found[-3, 12, 0]
    assert facts
    assert (facts.width, facts.height, facts.resolution) == (24, 40, (300, 300))


def test_colour_profiles() -> None:
    plugin = PLUGINS[0]  # the other one writes none
    png = io.BytesIO()
    halves().save(png, "PNG", icc_profile=rgb_profile(DISPLAY_P3))
    found = image_of(saved(plugin, halves(), icc_profile=rgb_profile(DISPLAY_P3)))
    np.testing.assert_allclose(found, image_of(png.getvalue()), atol=10 / 255)
    assert np.abs(found - np.asarray(halves()) / 255).max() > 20 / 255, "the profile makes a difference"


@each
def test_opacity(plugin: Plugin) -> None:
    image = halves()
    image.putalpha(Image.fromarray(np.repeat(np.uint8([[0, 255]]), 20, axis=1).repeat(24, axis=0)))
    found = image_of(saved(plugin, image))
    assert found.shape == (24, 40, 4)
    assert found[:, :18, 3].max() < 0.05
    assert found[:, 22:, 3].min() > 0.95


@each
def test_without_the_package(plugin: Plugin, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    hint = rf"a.heic: {plugin.name} needs .*: pip install {plugin.package}, .*'\.\[{plugin.extra}\]'$"
    with pytest.raises(ImageError, match=hint):
        image_of(HEADS[plugin.format], "a.heic")


@each
def test_damaged_files(plugin: Plugin) -> None:
    data = saved(plugin, halves())
    for cut in (len(data) // 2, 14):
        with pytest.raises(ImageError, match=r"^a: [^\n]*$"):
            image_of(data[:cut], "a")
