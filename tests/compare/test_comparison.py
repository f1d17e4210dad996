"""Rows of a comparison: ours and another program, measured alike; their tables."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.compare.tracers import SIZES, bands, stub
from tests.fit.pictures import picture
from tests.runs import vectorize
from warpsplat.compare.comparison import OURS, Comparison, ComparisonRow, compare
from warpsplat.compare.tables import means
from warpsplat.compare.tracer import VTRACER_SETTINGS, TracerOptions, vtracer
from warpsplat.files.sources import image_of
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.metrics import Score
from warpsplat.rendering.backend import Backend
from warpsplat.run.result import Result
from warpsplat.scene import FloatArray


def run(target: FloatArray, settings: Settings, write: Callable[[str], None]) -> Result:
    return vectorize(target, settings, Backend.on("cpu"), write=write)


def test_the_tracer_sees_the_image_on_white(tmp_path: Path) -> None:
    rgba = np.random.default_rng(0).integers(0, 256, (20, 30, 4), dtype=np.uint8)
    rgba[:10, :, 3] = 0
    Image.fromarray(rgba).save(tmp_path / "a.png")
    target = image_of(tmp_path / "a.png", paper=1.0)
    seen: list[np.ndarray] = []

    def trace(png: bytes, options: TracerOptions) -> str:
        seen.append(np.asarray(Image.open(io.BytesIO(png))))
        return bands(png, options)

    list(compare("a.png", target, [], stub(trace), run))
    assert len(seen) == len(SIZES)
    for pixels in seen:
        assert (pixels[:10] == 255).all()
        assert pixels.shape == (20, 30, 3)
        assert np.abs(pixels / 255 - target).max() <= 0.5 / 255 + 1e-6


class PanicException(BaseException):
    """As pyo3 raises it."""


@pytest.mark.parametrize(
    ("failure", "words"),
    [
        (ValueError("bad\x1b[31m\nand more"), "failed: ValueError: bad\\x1b[31m"),
        (PanicException("index out of bounds"), "failed: PanicException: index out of bounds"),
        (MemoryError(), "failed: MemoryError: no cause given"),
    ],
)
def test_a_tracer_that_fails_at_one_setting(failure: BaseException, words: str) -> None:
    def trace(png: bytes, options: TracerOptions) -> str:
        if options["bands"] == 1:
            raise failure
        return bands(png, options)

    failed, fine = compare("a.png", picture(), [], stub(trace), run)
    assert (failed.svg, failed.score, failed.error) == ("", None, words)
    assert failed.as_dict()["error"] == words
    assert fine.score and not fine.error


def test_a_file_that_cannot_be_rendered() -> None:
    rows = list(compare("a.png", picture(), [], stub(lambda png, options: "no SVG"), run))
    assert all(row.svg == "no SVG" and row.score is None for row in rows)
    assert all(row.error.startswith("its file: not ") or "well-formed" in row.error for row in rows)


def test_vtracer_takes_all_of_its_settings() -> None:
    """Flat areas come out as they are, and the options do what they are for."""
    pixels = np.full((48, 64, 3), 255, np.uint8)
    pixels[8:40, 8:30], pixels[12:30, 36:60] = (200, 30, 20), (10, 60, 220)
    target = pixels.astype(np.float32) / 255
    rows = {row.setting: row for row in compare("a.png", target, [], vtracer(), run)}
    assert list(rows) == list(VTRACER_SETTINGS)
    for row in rows.values():
        least = 10 if row.setting == "photo" else 20  # it rounds corners
        assert row.program == "VTracer" and row.score and row.score.psnr > least, row.setting
    curved = {name: bool(re.search(r' d="[^"]*C', row.svg)) for name, row in rows.items()}
    assert curved["default"] and not curved["polygon"]
    assert len(rows["polygon"].svg) < len(rows["default"].svg)


def test_a_panic_of_vtracer_is_a_row(capfd: pytest.CaptureFixture[str]) -> None:
    """Rust would print a trace of its own."""
    options: dict[str, TracerOptions] = {"none": {"color_precision": 0}, "one": {"color_precision": 1}}
    panicked, fine = compare("a.png", picture(), [], replace(vtracer(), settings=options), run)
    assert panicked.error.startswith("failed: PanicException: assertion failed")
    assert fine.score
    assert capfd.readouterr().err == ""


SCORE = Score(28.125, 0.75, ms_ssim=0.9, ssimulacra2=None, paths=8, nodes=96, bytes=1234, gzip_bytes=640)


def row(image: str, program: str = OURS, setting: str = "8", score: Score | None = SCORE) -> ComparisonRow:
    return ComparisonRow(
        image, program, setting, "<svg/>", 2.5, 4.25, score, "" if score else "failed: ValueError: no"
    )


def comparison(*rows: ComparisonRow) -> Comparison:
    return Comparison(rows, make_settings(curves=8, iterations=12, seed=3), stub())


def test_means_are_of_settings_that_all_images_have() -> None:
    found = comparison(
        row("a.png"),
        row("a.png", "Bands", "one"),
        row("b.png", score=replace(SCORE, psnr=30.125, ssim=None, bytes=2234)),
        row("b.png", "Bands", "one", score=None),
    )
    ((program, setting, values),) = means(found)
    assert (program, setting) == (OURS, "8")
    assert [values[k] for k in ("psnr", "bytes", "seconds", "cpu_seconds")] == [29.125, 1734, 2.5, 4.25]
    assert values["ssim"] is None


def test_infinity_is_null_in_json() -> None:
    values = comparison(row("a.png", score=replace(SCORE, psnr=math.inf)), row("b.png", score=None)).as_dict()
    assert values["results"][0]["psnr"] is None
    assert values["results"][1]["error"] == "failed: ValueError: no"
    assert values[OURS]["kind"] == "fill"
    assert values["Bands"]["settings"] == {"one": {"bands": 1}, "four": {"bands": 4}}
