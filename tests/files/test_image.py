"""Reading of images and masks, valid and invalid ones."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.files.samples import RGB, RNG, bad_files, load_image, save
from tests.fuzz.corpus import saved
from warpsplat.errors import ImageError
from warpsplat.files.sources import load_importance


def test_modes(tmp_path: Path) -> None:
    def load(image: Image.Image, name: str = "a.png") -> np.ndarray:
        return load_image(save(tmp_path, image, name))

    pixels = load(Image.fromarray(RGB))
    assert pixels.dtype == np.float32
    np.testing.assert_allclose(pixels * 255, RGB, atol=1e-4)
    rgba = np.dstack([RGB, np.full((20, 33), 51, np.uint8)])
    np.testing.assert_allclose(load(Image.fromarray(rgba)) * 255, 0.2 * RGB + 0.8 * 255, atol=0.01)
    np.testing.assert_allclose(load(Image.fromarray(RGB[..., 0]))[..., 1] * 255, RGB[..., 0], atol=1e-4)
    clear = Image.merge("LA", [Image.fromarray(RGB[..., 0]), Image.new("L", (33, 20), 0)])
    assert (load(clear) == 1).all()
    assert set(np.unique(load(Image.fromarray(RGB).convert("1")))) == {0.0, 1.0}
    red = Image.new("CMYK", (8, 8), (0, 255, 255, 0))
    np.testing.assert_allclose(load(red, "a.tif")[0, 0], [1, 0, 0], atol=0.01)


def test_palette_with_and_without_transparency(tmp_path: Path) -> None:
    palette = Image.fromarray(RGB).quantize(16)
    np.testing.assert_allclose(
        load_image(save(tmp_path, palette, "p.png")) * 255, np.asarray(palette.convert("RGB")), atol=1e-4
    )
    index = int(np.asarray(palette)[0, 0])
    pixels = load_image(save(tmp_path, palette, "t.png", transparency=index))
    np.testing.assert_array_equal(pixels[0, 0], 1)


def test_16_bit_keeps_its_precision(tmp_path: Path) -> None:
    deep = RNG.integers(0, 65536, (20, 33)).astype(np.uint16)
    for name in ("a.png", "a.tif", "a.pgm"):
        pixels = load_image(save(tmp_path, Image.fromarray(deep), name))
        np.testing.assert_allclose(pixels[..., 2] * 65535, deep, atol=0.02, err_msg=name)


def test_animation_gives_its_first_frame(tmp_path: Path) -> None:
    frames = [Image.new("RGB", (8, 8), c) for c in ("red", "blue")]
    path = save(tmp_path, frames[0], "a.gif", save_all=True, append_images=frames[1:])
    np.testing.assert_allclose(load_image(path)[0, 0], [1, 0, 0])


def test_bad_files_give_one_line_with_name_and_cause(tmp_path: Path) -> None:
    for name, path in bad_files(tmp_path).items():
        with pytest.raises(ImageError) as caught:
            load_image(path)
        message = str(caught.value)
        assert message.startswith(f"{path}: "), name
        assert "\n" not in message
        assert len(message) > len(str(path)) + 8
    with pytest.raises(ImageError, match=r"^standard input: not an image"):
        load_image(b"no image", "standard input")


def test_decompression_bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save(tmp_path, Image.fromarray(RGB), "a.png")
    before = Image.MAX_IMAGE_PIXELS
    for limit in (400, 100):  # a warning of Pillow's at the first, an error at the second
        monkeypatch.setattr("warpsplat.files.image.MAX_PIXELS", limit)
        with pytest.raises(ImageError, match="too large: more than"):
            load_image(path)
    assert before == Image.MAX_IMAGE_PIXELS


def test_pillows_own_limit_does_not_apply(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A photograph of 108 megapixels is no bomb."""
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    assert load_image(save(tmp_path, Image.fromarray(RGB), "a.png")).shape == (20, 33, 3)


def test_strips_join_without_a_seam(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rgba = np.dstack([RGB, RNG.integers(0, 256, (20, 33), dtype=np.uint8)])
    deep = Image.fromarray(RNG.integers(0, 65536, (20, 33)).astype(np.uint16))
    images = [Image.fromarray(RGB), Image.fromarray(rgba), Image.fromarray(RGB).quantize(16), deep]
    paths = [save(tmp_path, image, f"{i}.png") for i, image in enumerate(images)]
    whole = [load_image(path) for path in paths]
    monkeypatch.setattr("warpsplat.files.image.STRIP_PIXELS", 7 * 33)
    for path, pixels in zip(paths, whole, strict=True):
        np.testing.assert_array_equal(load_image(path), pixels)


def png(color: int, depth: int, samples: np.ndarray, transparent: list[int]) -> bytes:
    """Return a PNG with ``samples`` of shape (height, width, channels) and a transparent colour (tRNS)."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    height, width = samples.shape[:2]
    bits = (samples.reshape(height, -1, 1) >> np.arange(depth)[::-1]) & 1
    lines = np.packbits(bits.reshape(height, -1).astype(np.uint8), axis=1)
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"tRNS", b"".join(struct.pack(">H", value) for value in transparent))
        + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + line.tobytes() for line in lines)))
        + chunk(b"IEND", b"")
    )


@pytest.mark.parametrize("depth", [1, 2, 4, 8, 16])
def test_transparent_grey_of_any_depth(depth: int) -> None:
    top = 2**depth - 1
    samples = RNG.integers(0, 2, (5, 9, 1)) * top
    samples[:, 4] = max(top // 3, 0)
    transparent = int(samples[0, 4, 0])
    pixels = load_image(png(0, depth, samples, [transparent]))
    want = np.where(samples == transparent, 1, samples / top)
    np.testing.assert_allclose(pixels, np.repeat(want, 3, axis=2), atol=1e-6)


def test_transparent_colour_of_16_bits_is_compared_exactly() -> None:
    samples = np.tile(np.array([0x1234, 0x5678, 0x9ABC]), (4, 6, 1))
    samples[:, 3:] += 1  # alike in the upper bytes
    pixels = load_image(png(2, 16, samples, [0x1234, 0x5678, 0x9ABC]))
    np.testing.assert_array_equal(pixels[:, :3], 1)
    np.testing.assert_allclose(pixels[:, 3:], samples[:, 3:] / 65535, atol=1 / 255)


def test_white_of_integers_and_floats(tmp_path: Path) -> None:
    """White is the least of the usual values that no sample exceeds."""
    ramp = np.linspace(-0.1, 1, 63).reshape(7, 9)
    tops: list[tuple[type, int, float]] = [(np.float32, top, 1e-6) for top in (1, 255, 65535)]
    tops += [(np.int32, top, 0.003) for top in (255, 65535, 2**31 - 1)]
    for dtype, top, tolerance in tops:
        samples = ramp * top if dtype == np.float32 else np.round(np.maximum(ramp, 0) * top)
        pixels = load_image(save(tmp_path, Image.fromarray(samples.astype(dtype)), "a.tif"))
        np.testing.assert_allclose(pixels[..., 1], np.maximum(ramp, 0), atol=tolerance, err_msg=str(top))


@pytest.mark.parametrize(("bad", "count"), [(np.nan, 1), (np.inf, 1), (-np.inf, 3), (np.nan, 63)])
def test_nan_and_infinite_pixels_are_refused(tmp_path: Path, bad: float, count: int) -> None:
    samples = np.zeros(63, np.float32)
    samples[:count] = bad
    path = save(tmp_path, Image.fromarray(samples.reshape(7, 9)), "a.tif")
    with pytest.raises(ImageError, match=rf"^{path}: {count} of 63 pixels are not finite numbers"):
        load_image(path)


def test_libraries_print_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """libtiff names a damaged strip on stderr, behind Python's back."""
    path = save(tmp_path, Image.fromarray(RGB), "a.tif", compression="tiff_deflate")
    data = bytearray(path.read_bytes())
    place = data.index(b"\x78")  # of the compressed strip
    data[place + 2 : place + 40] = bytes(38)
    path.write_bytes(data)
    with pytest.raises(ImageError, match="damaged"):
        load_image(path)
    assert capfd.readouterr() == ("", "")


def test_few_bytes_that_claim_many_pixels(tmp_path: Path) -> None:
    """A blank scan is refused; a drawing of the same size, which is larger, is read."""
    blank = Image.new("1", (6000, 4000), 1)
    blank.save(tmp_path / "blank.tif", compression="group4")
    with pytest.raises(ImageError, match=r"claims 6000x4000 pixels in \d+ bytes"):
        load_image(tmp_path / "blank.tif")
    for row in range(0, 4000, 40):
        blank.paste(0, (row, row, row + 300, row + 20))
    blank.save(tmp_path / "drawing.tif", compression="group4")
    assert load_image(tmp_path / "drawing.tif").shape == (4000, 6000, 3)


def test_missing_strips_are_not_black(tmp_path: Path) -> None:
    """A TIFF of one strip of 20 rows that says it has 40,000."""
    path = save(tmp_path, Image.fromarray(RGB), "a.tif")
    head = (257).to_bytes(2, "little")  # the tag of the height: type, count and value follow
    data = bytearray(path.read_bytes())
    place = data.index(head, 8)
    data[place + 8 : place + 12] = (40_000).to_bytes(4, "little")
    path.write_bytes(data)
    with pytest.raises(ImageError, match=r"a\.tif: damaged: pixel data for 660 of 33x40000 pixels only"):
        load_image(path)


@pytest.mark.parametrize("compression", [None, "tiff_lzw"])
def test_many_strips_of_a_picture_on_its_side(tmp_path: Path, compression: str | None) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    how = {"compression": compression, "strip_size": 200}
    pixels = load_image(save(tmp_path, Image.fromarray(RGB), "a.tif", exif=exif, **how))
    np.testing.assert_allclose(pixels * 255, np.rot90(RGB, -1), atol=1e-4)


def test_float_maps_are_of_0_to_1_and_of_numbers(tmp_path: Path) -> None:
    """PFM: rows from the bottom to the top."""
    grey = np.linspace(0, 1, 12, dtype=np.float32).reshape(3, 4)
    path = tmp_path / "a.pfm"
    path.write_bytes(b"Pf\n4 3\n-1.0\n" + grey[::-1].tobytes())
    np.testing.assert_allclose(load_image(path)[..., 0], grey)
    grey[1, 2] = np.nan
    path.write_bytes(b"Pf\n4 3\n-1.0\n" + grey[::-1].tobytes())
    with pytest.raises(ImageError, match="1 of 12 pixels are not finite numbers"):
        load_image(path)


def test_opacity_that_a_file_does_not_use(tmp_path: Path) -> None:
    """Writers of 32 bits a pixel may leave the last eight of them 0, or anything."""
    clear = Image.fromarray(np.dstack([RGB, np.zeros_like(RGB[..., 0])]))
    seen = clear.copy()
    seen.putpixel((0, 0), (*RGB[0, 0].tolist(), 128))
    for name in ("a.tga", "a.bmp"):
        np.testing.assert_allclose(
            load_image(save(tmp_path, clear, name)) * 255, RGB, atol=1e-4, err_msg=name
        )
    assert (load_image(save(tmp_path, clear, "a.png")) == 1).all(), "the opacity of a PNG is meant"
    undeclared = bytearray(save(tmp_path, seen, "b.tga").read_bytes())
    undeclared[17] &= 0xF0
    for data, wanted in ((bytes(undeclared), RGB[0, 1]), (save(tmp_path, seen, "c.tga").read_bytes(), 255)):
        path = tmp_path / "d.tga"
        path.write_bytes(data)
        np.testing.assert_allclose(load_image(path)[0, 1] * 255, wanted, atol=1e-4)


def as_png(pixels: np.ndarray) -> bytes:
    return saved(Image.fromarray(pixels), "PNG")


def test_grey_of_8_and_16_bits() -> None:
    levels = np.array([[0, 51, 255], [102, 204, 0]])
    for data in (as_png(levels.astype(np.uint8)), as_png((257 * levels).astype(np.uint16))):
        np.testing.assert_allclose(load_importance(data, 3, 2), levels / 255, atol=1e-6)


def test_colours_count_by_their_luma() -> None:
    colours = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    wanted = [[0.299, 0.587], [0.114, 1]]
    np.testing.assert_allclose(load_importance(as_png(colours), 2, 2), wanted, atol=1e-5)


def test_transparent_pixels_are_black() -> None:
    """As in a face marked with a white brush on an empty layer."""
    layer = np.full((2, 2, 4), 255, np.uint8)
    layer[..., 3] = [[0, 255], [51, 0]]
    np.testing.assert_allclose(load_importance(as_png(layer), 2, 2), [[0, 1], [0.2, 0]], atol=1e-6)


@pytest.mark.parametrize(("wide", "tall"), [(768, 512), (1536, 1024), (100, 66), (100, 67), (3, 2)])
def test_any_size_of_the_same_proportions(wide: int, tall: int) -> None:
    assert load_importance(as_png(np.zeros((tall, wide), np.uint8)), 768, 512).shape == (tall, wide)


@pytest.mark.parametrize(("wide", "tall"), [(512, 768), (768, 500), (100, 68), (3, 3)])
def test_other_proportions_are_refused(wide: int, tall: int) -> None:
    with pytest.raises(ImageError, match=rf"^m\.png: {wide}x{tall} pixels; .* 768x512 image$"):
        load_importance(as_png(np.zeros((tall, wide), np.uint8)), 768, 512, "m.png")


def test_no_image() -> None:
    with pytest.raises(ImageError, match=r"^m\.png: not an image"):
        load_importance(b"none", 3, 2, "m.png")
