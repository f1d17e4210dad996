"""The library as its users call it."""

from __future__ import annotations

import io
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests import ROOT
from tests.cli.helpers import run
from warpsplat.extensions import extensions
from warpsplat.scene import Kind

QUICK = {"curves": 6, "iterations": 30, "subject": "photo"}


def photograph(channels: int = 3) -> np.ndarray:
    """40x32 px of 8 bits; the fourth channel has holes."""
    y, x = np.mgrid[:32, :40] / 32
    pixels = np.stack([x, y, 0.5 + 0.3 * np.sin(9 * x * y), (x - 0.6) ** 2 + (y - 0.5) ** 2 < 0.2], axis=2)
    return np.round(255 * np.clip(pixels, 0, 1)).astype(np.uint8)[..., :channels]


def as_png(pixels: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG")
    return out.getvalue()


@pytest.mark.parametrize("channels", [3, 4])
def test_all_forms_of_an_image_give_the_same_file(channels: int, tmp_path: Path, device: str) -> None:
    pixels = photograph(channels)
    path = tmp_path / "a.png"
    path.write_bytes(as_png(pixels))
    with path.open("rb") as file:
        forms = [path, str(path), path.read_bytes(), file, Image.open(path), pixels, pixels / np.float32(255)]
        results = [
            warpsplat.vectorize(form, 6, subject="photo", iterations=4, device=device) for form in forms
        ]
    assert len({result.svg for result in results}) == 1
    assert ("<rect" in results[0].svg) == (channels == 3)


def test_grey_and_bits_are_images(device: str) -> None:
    grey = photograph()[..., 0]
    wanted = warpsplat.vectorize(np.repeat(grey[..., None], 3, axis=2), device=device, **QUICK).svg
    assert warpsplat.vectorize(grey, device=device, **QUICK).svg == wanted
    assert warpsplat.vectorize(grey.astype(np.uint16) * 257, device=device, **QUICK).svg == wanted
    black = warpsplat.vectorize(np.uint8(255) * (grey > 127), device=device, **QUICK).svg
    assert warpsplat.vectorize(grey > 127, device=device, **QUICK).svg == black


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((4, 5, 7), np.uint8), r"shape \(4, 5, 7\)"),
        (np.zeros((4, 5, 3), np.int64), "type int64"),
        (np.full((4, 5, 3), 2.0), r"60 of 60 values are not in \[0, 1\]"),
        (np.full((4, 5, 3), np.nan), "60 of 60 values"),
        (np.zeros((1, 5, 3), np.uint8), "5x1 pixels"),
        (b"not an image", "not an image"),
        (io.BytesIO(b""), "is empty"),
        ("missing.png", "missing.png: no such file"),
    ],
)
def test_invalid_images_are_refused(image: object, message: str) -> None:
    with pytest.raises(warpsplat.ImageError, match=message):
        warpsplat.vectorize(image)


def test_wrong_types_are_refused() -> None:
    with pytest.raises(TypeError, match="not int"):
        warpsplat.vectorize(7)
    with pytest.raises(TypeError, match="not float"):
        warpsplat.load_svg(1.0)


@pytest.mark.parametrize(
    ("name", "more"), [("colour", "; did you mean 'colors'?"), ("outptu", ".*'output'"), ("xing", "")]
)
def test_unknown_keywords_are_refused_with_the_nearest(name: str, more: str) -> None:
    with pytest.raises(TypeError, match=rf"^vectorize\(\) has no keyword '{name}'{more}"):
        warpsplat.vectorize(photograph(), **{name: 3})


def test_settings_and_their_values_exclude_each_other() -> None:
    settings = warpsplat.make_settings()
    with pytest.raises(warpsplat.UsageError, match="seed as well"):
        warpsplat.vectorize(photograph(), settings=settings, seed=3)
    with pytest.raises(warpsplat.UsageError, match="quality as well"):
        warpsplat.suggest(photograph(), settings=settings, quality="draft")
    with pytest.raises(warpsplat.UsageError, match="several numbers of shapes and max-bytes"):
        warpsplat.vectorize_several(photograph(), [4, 8], max_bytes="2KB")
    with pytest.raises(warpsplat.UsageError, match="closed and open"):
        warpsplat.vectorize(photograph(), closed=True, open=True)
    with pytest.raises(warpsplat.UsageError, match="threads"):
        warpsplat.vectorize(photograph(), threads=0)


@pytest.mark.parametrize("nothing", ["", " \n", b""])
def test_an_empty_svg_is_refused(nothing: str | bytes) -> None:
    for read in (warpsplat.load_svg, lambda svg: warpsplat.score(svg, photograph())):
        with pytest.raises(warpsplat.ImageError, match=r"^the SVG: is empty: give an SVG's text"):
            read(nothing)


def test_a_callback_sees_the_history_and_ends_the_run(tmp_path: Path, device: str) -> None:
    seen: list[warpsplat.Progress] = []

    def enough(progress: warpsplat.Progress) -> bool:
        seen.append(progress)
        assert progress.snapshot
        scene = progress.snapshot.scene()
        assert len(scene) == progress.shapes
        shown.append(np.abs(progress.snapshot.image() - warpsplat.render(scene)[..., :3]).mean())
        return len(seen) == 2

    shown: list[float] = []
    path = tmp_path / "a.svg"
    result = warpsplat.vectorize(
        photograph(), 6, subject="photo", iterations=200, device=device, callback=enough, output=path
    )
    assert result.stopped
    assert tuple(seen) == result.history
    assert all(progress.snapshot is None for progress in result.history)
    assert max(shown) < 0.1, "0.015 to 0.044 over five seeds: the image is that before the last step"
    assert result.iterations < 200
    assert path.read_text() == result.svg
    result.save(tmp_path / "b.svgz")
    assert warpsplat.load_svg(tmp_path / "b.svgz").canvas.width == 40


def test_the_command_line_api_and_file_agree(tmp_path: Path, device: str) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(as_png(photograph()))
    options = ("--subject", "photo", "--curves", 6, "--iterations", 30, "--device", device, "-q")
    assert run("vectorize", path, *options, "-o", tmp_path / "a.svg") == 0
    result = warpsplat.vectorize(path, device=device, **QUICK)
    assert (tmp_path / "a.svg").read_text() == result.svg
    assert result.score == warpsplat.score(result.svg, path)
    png = tmp_path / "r.png"
    assert run("render", tmp_path / "a.svg", "-o", png, "--renderer", "exact", "--device", device) == 0
    shown = warpsplat.render(result.svg, device=device)
    assert np.array_equal(np.asarray(Image.open(png)), np.asarray(warpsplat.to_pillow(shown)))
    scene = warpsplat.load_svg(result.svg)
    np.testing.assert_allclose(warpsplat.render(scene, device=device), shown, atol=1e-5)
    np.testing.assert_allclose(warpsplat.render(result.scene, device=device), shown, atol=0.003)


def test_a_saved_scene_is_loaded(tmp_path: Path, device: str) -> None:
    scene = warpsplat.vectorize(photograph(4), device=device, **QUICK).scene
    text = warpsplat.save_svg(scene, tmp_path / "a.svg", precision=4, title="a <b>", minify=True)
    assert (tmp_path / "a.svg").read_text() == text
    assert "<title>a &lt;b&gt;</title>" in text
    again = warpsplat.load_svg(text)
    assert again.canvas.background is None
    shown = [warpsplat.render(each, device=device) for each in (scene, again)]
    np.testing.assert_allclose(shown[0], shown[1], atol=1e-3)
    for source in (tmp_path / "a.svg", text.encode(), io.StringIO(text)):
        assert np.array_equal(warpsplat.load_svg(source).points, again.points)


def test_sizes_of_a_render(device: str) -> None:
    scene = warpsplat.vectorize(photograph(), device=device, **QUICK).scene
    assert warpsplat.render(scene, device=device).shape == (32, 40, 4)
    assert warpsplat.render(scene, 20, device=device).shape == (16, 20, 4)
    assert warpsplat.render(scene, height=64, device=device).shape == (64, 80, 4)
    assert warpsplat.render(scene, 60, 48, device=device).shape == (48, 60, 4)
    viewed = warpsplat.render(scene, scale=2, renderer="viewer")
    assert abs(viewed - warpsplat.render(scene, scale=2, device=device)).mean() < 0.005
    with pytest.raises(warpsplat.UsageError, match="proportions"):
        warpsplat.render(scene, 40, 40)
    with pytest.raises(warpsplat.UsageError, match="either a scale"):
        warpsplat.render(scene, 40, scale=2)


def test_a_scene_to_start_from(device: str) -> None:
    fills, strokes = (warpsplat.starting_scene(photograph(), 20, open=is_open) for is_open in (False, True))
    assert len(fills) == len(strokes) == 20
    assert (strokes.kind == Kind.STROKE).all()
    wanted, shown = photograph() / 255, warpsplat.render(fills, device=device)[..., :3]
    assert ((shown - wanted) ** 2).mean() < 0.7 * ((wanted - wanted.mean(axis=(0, 1))) ** 2).mean()


def test_an_svg_is_refined(device: str) -> None:
    text = '<svg xmlns="http://www.w3.org/2000/svg" width="40" height="32"><path d="M2 3H30V29H2z"/></svg>'
    wanted = np.full((32, 40, 3), 255, np.uint8)
    wanted[5:27, 6:33] = 40
    result = warpsplat.refine(text, wanted, device=device)
    assert result.score and result.before and result.score.psnr > result.before + 5
    assert result.history
    assert result.score == warpsplat.score(result.svg, wanted)


def test_threads_do_not_disturb_each_other(device: str) -> None:
    """A step of one thread is a graph, which must not record other threads' launches."""
    images = [np.roll(photograph(), 5 * i, axis=1) for i in range(4)]

    def made(image: np.ndarray) -> str:
        return warpsplat.vectorize(image, 6, subject="photo", iterations=60, device=device, threads=1).svg

    wanted = [made(image) for image in images]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(made, images)) == wanted
    assert len(set(wanted)) == 4
    assert not [t for t in threading.enumerate() if t.name.startswith("ThreadPool")]


EXTENSIONS_OF = {"report": "pages", "Recorder": "motion", "Live": "motion", "load_preset": "batch"}
"""Public names of extensions."""


def test_public_names_exist_and_import_quickly() -> None:
    public = {
        *("vectorize", "refine", "render", "load_svg", "save_svg", "score", "to_pillow", "make_settings"),
        *("starting_scene", "load_image", "vectorize_several", "suggest", "CustomLoss"),
        *("Result", "Score", "Progress", "Snapshot", "Settings", "Scene", "Canvas", "__version__"),
        *("Suggestion", "Expected", "CustomLoss"),
        *("WarpsplatError", "DeviceError", "ImageError", "OutputError", "ResourceError", "UsageError"),
    }
    public |= {name for name, home in EXTENSIONS_OF.items() if home in extensions()}
    assert set(warpsplat.__all__) == public == set(dir(warpsplat))
    for name in public:
        assert getattr(warpsplat, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'vectorise'"):
        warpsplat.vectorise  # noqa: B018
    code = "import sys, warpsplat; print(sorted({'numpy', 'warp', 'torch'} & set(sys.modules)))"
    assert subprocess.check_output([sys.executable, "-c", code], cwd=ROOT, text=True) == "[]\n"


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str], device: str) -> None:
    warpsplat.vectorize(photograph(), device=device, **QUICK)
    assert capfd.readouterr() == ("", "")
