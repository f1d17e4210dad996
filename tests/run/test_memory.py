"""Memory: what a run needs, and runs on smaller images than those that were asked for."""

from __future__ import annotations

import gc
import io
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests.cli.helpers import Cli, run
from tests.fit.pictures import picture
from warpsplat.errors import ExitCode, ResourceError
from warpsplat.files.image import ImageFacts, image_facts, load_rows
from warpsplat.files.sources import image_of
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.native import container_limits
from warpsplat.portable.filters import boxed
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.rendering.renderer import Renderer
from warpsplat.run import memory
from warpsplat.run.memory import Demand, DeviceMemory, check_refined, memory_limit, near_edges
from warpsplat.run.prepare import prepare

HUGE = ImageFacts(12_000, 9_000, 3, 4, drafts=True)
QUICK = {"iterations": 2, "curves": 4, "subject": "photo", "device": "cpu"}
WIDTH, HEIGHT = 65, 49


def pixels(mode: str = "RGB") -> Image.Image:
    """Odd sides, so that the last pixels of a smaller image stand for a part of a square."""
    levels = np.round(255 * cv2.resize(picture(), (WIDTH, HEIGHT))).astype(np.uint8)
    image = Image.fromarray(levels)
    if mode == "RGBA":
        opacity = np.full((HEIGHT, WIDTH), 255, np.uint8)
        opacity[:30, :20] = 0
        image.putalpha(Image.fromarray(opacity))
    return image.convert("L").convert("I;16") if mode == "I;16" else image


def encoded(image: Image.Image, kind: str = "PNG", **options: object) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only what grows with the image counts, so that a small image can be too large."""
    for name in ("PROGRAM", "STRIPS", "SHAPE", "DRAWN"):
        monkeypatch.setattr(memory, name, 0)
    monkeypatch.setattr(memory, "LEAST_REDUCED_SIDE", 4)


def test_a_need_grows_with_all_that_takes_memory() -> None:
    huge, kept = Demand(HUGE), Demand(replace(HUGE, kept=12))
    base = huge.need(Settings())
    assert 2 << 30 < base < 4e9
    assert huge.need(Settings(), 2) < base / 1.5 < base < kept.need(Settings())
    small = Demand(ImageFacts(1200, 900, 3, 4, drafts=False))
    options = ("curves", 8000), ("open", True), ("paint", "auto"), ("levels", "8,512"), ("subject", "line")
    for name, value in options:
        assert small.need(make_settings(**{name: value})) > small.need(Settings()), name


def test_a_drawing_takes_memory_for_its_edges(bare: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that one of few is not reduced for nothing."""
    plain, hatched = Image.new("RGB", (64, 48), "white"), Image.new("RGB", (64, 48))
    plain.paste((0, 0, 200), (20, 20, 30, 30))
    hatched.putdata([(255 * (x // 3 % 2),) * 3 for _ in range(48) for x in range(64)])
    counts = [near_edges(image_of(image)) for image in (plain, hatched)]
    assert counts == [16**2 - 4**2 - 4, 64 * 48], "3 px on each side, but for the corners"
    monkeypatch.setattr(memory, "STRIP_PIXELS", 64 * 16)
    assert near_edges(image_of(hatched)) == counts[1]
    facts = image_facts(encoded(plain))
    limit = Demand(facts, edges=counts[0]).need(make_settings(subject="drawing", quality="draft"))
    assert limit < Demand(facts, edges=counts[0]).need(make_settings(subject="drawing"))
    settings = make_settings(subject="drawing", quality="draft", max_memory=limit)
    assert prepare(encoded(plain), settings).reduction is None
    reduction = prepare(encoded(hatched), settings).reduction
    assert reduction and Demand(facts, edges=counts[1]).need(settings, reduction.factor) <= limit


def test_the_size_is_the_largest_within_the_limit() -> None:
    for limit in ("4GB", "1GB", "600MB"):
        settings = make_settings(max_memory=limit)
        factor = Demand(HUGE).factor(settings, "huge.jpg")
        most = settings.max_memory
        assert most and memory_limit(settings) == most and Demand(HUGE).need(settings, factor) <= most
        assert factor == 1 or Demand(HUGE).need(settings, factor // 2) > most
    with pytest.raises(ResourceError, match=r"^huge\.jpg: at least \d+ MB are needed, max-memory is 1 MB$"):
        Demand(HUGE).factor(make_settings(max_memory="1MB"), "huge.jpg")


def test_the_machine_s_memory_is_the_default_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    for found, processes, limit in ((10**9, 1, 9 * 10**8), (10**9, 3, 3 * 10**8), (None, 1, None)):
        monkeypatch.setattr(memory, "machine_memory", lambda found=found: found)
        monkeypatch.setattr(memory, "processes", processes)
        assert memory_limit(Settings()) == limit
    assert Demand(HUGE).factor(Settings(), "huge.jpg") == 1


def test_the_limits_of_containers_are_seen(tmp_path: Path) -> None:
    def write(name: str, text: str) -> None:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)

    assert container_limits(tmp_path) == []
    write("proc/self/cgroup", "0::/user/app\n")
    write("sys/fs/cgroup/user/app/memory.max", "max\n")
    write("sys/fs/cgroup/user/memory.max", "5000000\n")
    assert container_limits(tmp_path) == [5_000_000]
    write("proc/self/cgroup", "7:cpu,cpuacct:/\n6:memory:/box\n")
    write("sys/fs/cgroup/memory/box/memory.limit_in_bytes", "700\n")
    write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9000\n")
    assert container_limits(tmp_path) == [700, 9000]


@pytest.mark.parametrize(
    ("mode", "kind", "options"),
    [
        ("RGB", "PNG", {}),
        ("RGB", "JPEG", {"quality": 95}),
        ("RGB", "JPEG", {"quality": 95, "progressive": True}),
        ("RGBA", "PNG", {}),
        ("I;16", "PNG", {}),
        ("RGB", "WEBP", {"lossless": True}),
    ],
)
@pytest.mark.parametrize("factor", [2, 4])
def test_an_image_is_read_smaller(mode: str, kind: str, options: dict[str, object], factor: int) -> None:
    """A pixel is the mean of its square; what a JPEG's decoder makes of it is nearly that."""
    data = encoded(pixels(mode), kind, **options)
    whole = image_of(data)
    small = image_of(data, factor=factor)
    assert small.shape == (-(-HEIGHT // factor), -(-WIDTH // factor), 4 if mode == "RGBA" else 3)
    apart = np.abs(small - boxed(whole, factor))
    assert apart.mean() < (0.02 if kind == "JPEG" else 1e-6)
    if kind != "JPEG" and factor == 2:
        np.testing.assert_allclose(small[3, 5], whole[6:8, 10:12].mean(axis=(0, 1)), atol=1e-5)
    facts = image_facts(data)
    assert facts and (facts.width, facts.height, facts.channels) == (WIDTH, HEIGHT, whole.shape[2])
    assert (facts.kept > 0) == ("progressive" in options) and facts.deep == (mode == "I;16")


def test_a_turned_image_is_read_smaller() -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    data = encoded(pixels(), "JPEG", exif=exif, quality=95)
    assert image_of(data, factor=2).shape == (33, 25, 3)
    facts = image_facts(data)
    assert facts and (facts.width, facts.height) == (HEIGHT, WIDTH)


@pytest.mark.parametrize("mode", ["RGB", "RGBA"])
def test_strips_of_an_image_are_those_of_all_of_it(mode: str) -> None:
    data = encoded(pixels(mode))
    paper = None if mode == "RGBA" else 1.0
    image = image_of(data, paper=paper)
    whole = load_rows(data, paper, image.shape[2])
    assert whole.shape == image.shape
    for rows in (slice(0, 7), slice(30, 49), slice(30, 49), slice(0, 49)):
        np.testing.assert_array_equal(whole[rows], image[rows])


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize("mode", ["RGB", "RGBA", "I;16"])
def test_a_file_of_a_smaller_run_has_the_size_of_the_image(
    mode: str, whole: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = encoded(pixels(mode))
    facts = image_facts(data)
    assert facts
    limit = Demand(facts).need(make_settings(curves=4)) - 1
    monkeypatch.setattr("warpsplat.run.memory.whole_score", lambda *_: limit + (not whole))
    output = tmp_path / "out.svg"
    made = warpsplat.vectorize(data, **QUICK, max_memory=limit, output=output, name="big.png")
    assert output.read_text() == made.svg
    assert 'height="49" width="65"' in made.svg or 'width="65" height="49"' in made.svg
    assert (made.scene.canvas.width, made.scene.canvas.height) == (WIDTH, HEIGHT)
    assert f"{WIDTH}x{HEIGHT} pixels take about" in made.reduced and "max-memory is" in made.reduced
    measured = "full" if whole and mode != "I;16" else "that"
    assert made.reduced.endswith(f"processed at 33x25, measured at {measured} size")
    assert made.as_dict()["reduced"] == made.reduced
    own = warpsplat.score(made.svg, data)
    assert made.score and made.score.bytes == own.bytes and made.score.gzip_bytes == own.gzip_bytes
    assert made.score.psnr == pytest.approx(own.psnr, abs=1e-6 if measured == "full" else 2)
    # As good as a run at full size, but for the luck of two steps.
    usual = warpsplat.vectorize(data, **QUICK)
    assert usual.reduced == "" and usual.score and own.psnr > usual.score.psnr - 2


@pytest.mark.usefixtures("bare")
def test_a_mask_counts_and_is_read_smaller_with_its_image() -> None:
    data, mask = encoded(pixels()), encoded(pixels().convert("L"))
    facts, of_mask = image_facts(data), image_facts(mask)
    assert facts and of_mask
    settings = make_settings(curves=4)
    small = replace(of_mask, width=WIDTH // 4, height=HEIGHT // 4)
    assert [Demand(facts, each).mask_factor(4) for each in (of_mask, small)] == [4, 1], "it keeps its detail"
    whole = Demand(facts, mask=of_mask).need(settings)
    assert whole > Demand(facts).need(settings)
    for limit, words in ((whole - 1, "processed at 33x25"), (whole, "")):
        made = warpsplat.vectorize(data, **QUICK, importance=mask, max_memory=limit, name="big.png")
        assert words in made.reduced and bool(words) == bool(made.reduced)


def test_refining_against_a_too_large_image_is_refused(
    tmp_path: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before its pixels are read."""
    image, svg, output = tmp_path / "a.png", tmp_path / "a.svg", tmp_path / "b.svg"
    image.write_bytes(encoded(pixels()))
    svg.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}">'
        '<path d="M9 9H40V30H9z" fill="#853"/></svg>'
    )
    arguments = ("refine", svg, image, "-o", output, "--iterations", 1, "--device", "cpu")
    facts = image_facts(image.read_bytes())
    assert facts
    limit = memory.need_refined(facts, make_settings())
    assert run(*arguments, "--max-memory", limit) == 0
    monkeypatch.setattr("warpsplat.run.refine.load_target", None)
    error = cli(*arguments, "--max-memory", limit - 1, code=ExitCode.RESOURCES).line
    assert "a.png: 65x49 pixels take about" in error
    monkeypatch.setattr(memory, "machine_memory", lambda: 1000)
    with pytest.raises(
        ResourceError, match=r"^the image: .* memory for it is 0 MB; refine against a smaller"
    ):
        warpsplat.refine(svg, image.read_bytes(), device="cpu")


def test_nothing_of_a_run_is_left() -> None:
    """Arrays go with the last reference to them, before the collector of cycles runs."""

    def living() -> int:
        return sum(type(each) in {Renderer, Program, Parameters} for each in gc.get_objects())

    gc.collect()
    before = living()
    gc.disable()
    try:
        for paint in ("flat", "auto"):
            warpsplat.vectorize(picture(), **QUICK | {"iterations": 30}, paint=paint)
        assert living() == before
    finally:
        gc.enable()


def test_the_memory_of_a_gpu_limits_the_size_too() -> None:
    for limit in (400 << 20, 150 << 20, 60 << 20):
        factor = Demand(HUGE, gpu=DeviceMemory("cuda:0", limit)).factor(Settings(), "huge.jpg")
        assert Demand(HUGE).need_on_gpu(Settings(), factor) <= limit
        assert factor == 1 or Demand(HUGE).need_on_gpu(Settings(), factor // 2) > limit
    words = (
        r"^huge\.jpg: at least \d+ MB are needed, free memory of cuda:1 for it is 1 MB; .*--device cpu none"
    )
    with pytest.raises(ResourceError, match=words):
        Demand(HUGE, gpu=DeviceMemory("cuda:1", 1 << 20)).factor(Settings(), "huge.jpg")
    data = encoded(pixels())
    with pytest.raises(
        ResourceError, match=r"65x49 pixels take about .*, free memory of cuda:0 .*; refine against"
    ):
        check_refined(data, Settings(), "a.png", DeviceMemory("cuda:0", 1 << 20))
    check_refined(data, Settings(), "a.png", DeviceMemory("cuda:0", 1 << 30))


@pytest.mark.parametrize("quality", ["draft", "balanced"])
def test_only_the_draft_of_a_drawing_starts_no_device(quality: str) -> None:
    """The draft of a drawing is traced on the host, so that no GPU limits its size."""
    started: list[int] = []

    def backend() -> Backend:
        started.append(1)
        return Backend.on("cpu")

    prepare(encoded(pixels()), make_settings(subject="drawing", quality=quality), backend=backend)
    assert bool(started) == (quality != "draft")
