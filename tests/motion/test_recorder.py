"""Animations of a run, decoded again."""

from __future__ import annotations

import functools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.scenes import mixed_scene, with_gradients
from warpsplat import Canvas, Recorder, Result, Scene, UsageError
from warpsplat.errors import CapacityError
from warpsplat.files.output import may_replace
from warpsplat.fit.export import export
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.fit.settings import Settings
from warpsplat.metrics import psnr
from warpsplat.motion import films, recorder
from warpsplat.motion.timing import HOLD
from warpsplat.motion.training import Painter
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene.geometry import enlarged
from warpsplat.svg.viewer import on_white, premultiplied, render_own, render_svg
from warpsplat.svg.write import GRIDS

Recorded = tuple[Recorder, Result]
FLAT = mixed_scene(48, 36)
CLEAR = replace(FLAT, canvas=Canvas(48, 36, None))


def frames_of(path: Path) -> tuple[list[np.ndarray], float]:
    """Return the frames of a film, on white, and its duration [s]."""
    if path.suffix == ".mp4":
        av = pytest.importorskip("av")
        with av.open(str(path)) as film:
            stream = film.streams.video[0]
            assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
            pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(stream)]
            return pictures, len(pictures) / float(stream.average_rate)
    pictures, seconds = [], 0.0
    with Image.open(path) as film:
        for i in range(getattr(film, "n_frames", 1)):
            film.seek(i)
            pictures.append(on_white(film))
            seconds += film.info["duration"] / 1000
    return pictures, seconds


@pytest.mark.parametrize("what", ["training", "drawing"])
@pytest.mark.parametrize("ending", ["gif", "webp", "mp4"])
def test_a_film_ends_with_the_file(
    recorded: Recorded, tmp_path: Path, ending: str, what: recorder.Subject
) -> None:
    made, result = recorded
    path = tmp_path / f"a.{ending}"
    size = made.save(path, result, what=what, width=64, seconds=1)
    assert size == path.stat().st_size
    pictures, seconds = frames_of(path)
    assert seconds == pytest.approx(1 + HOLD, abs=0.15)
    assert {picture.shape for picture in pictures} == {(48, 64, 3)}
    end = on_white(render_svg(result.svg, zoom=64 / 48))
    assert psnr(pictures[-1], end) > 28
    assert psnr(pictures[0], end) < psnr(pictures[len(pictures) // 4], end) < psnr(pictures[-1], end)
    assert may_replace(path)
    path.write_bytes(path.read_bytes()[:-20].replace(b"\xfe\x09warpsplat", b"\xfe\x09somebody."))
    assert not may_replace(path), "somebody else's"


def test_an_animated_svg_shows_the_file_where_nothing_is_animated(recorded: Recorded, tmp_path: Path) -> None:
    made, result = recorded
    path = tmp_path / "a.svg"
    made.save(path, result)
    text = path.read_text()
    assert may_replace(path)
    assert text.count('<animate attributeName="d"') > 0
    assert "<script" not in text and "prefers-reduced-motion" in text
    assert np.array_equal(np.asarray(render_own(text)), np.asarray(render_own(result.svg)))
    # The moving shapes end where the run did.
    moving = re.sub(r"<style>.*</style>", "", text.partition('<g class="e">')[0] + "</svg>")
    moving = re.sub(r'<path[^>]*forwards".*', "", moving)  # those that fade out
    assert psnr(on_white(render_own(moving)), on_white(render_own(result.svg))) > 22, (
        "32 dB and more over five seeds"
    )


def test_translucent_shapes_are_not_seen_twice(recorded: Recorded, tmp_path: Path) -> None:
    """Without a background, the file replaces the last shapes at once."""
    made = recorder_of([CLEAR] * 3)
    made.save(tmp_path / "a.svg", replace(recorded[1], scene=CLEAR), seconds=2)
    text = (tmp_path / "a.svg").read_text()
    assert "animation:m 2s}" in text and "animation:e 0s 2s backwards" in text


def recorder_of(scenes: list[Scene]) -> Recorder:
    made, image = Recorder(), np.zeros((4, 4, 3), np.float32)
    for step, scene in enumerate(scenes):
        now = Snapshot(functools.partial(replace, scene), lambda: image)
        made(Progress(step, len(scenes), 20.0, 0.0, 0.0, True, len(scene), now))
    return made


def test_gradients_have_unique_ids(recorded: Recorded, tmp_path: Path) -> None:
    """A run on a reduced image fills the picture."""
    scene = with_gradients(FLAT)
    small = replace(enlarged(scene, 1, 24, 18), points=scene.points / 2, frames=scene.frames / 2)
    recorder_of([small, scene, scene]).save(tmp_path / "a.svg", replace(recorded[1], scene=scene))
    text = (tmp_path / "a.svg").read_text()
    names = re.findall(r'\bid="([^"]*)"', text)
    assert len(names) > 3 and len(names) == len(set(names))
    assert set(re.findall(r"url\(#([^)]*)\)", text)) == set(names)
    scales = [float(scale) for scale in re.findall(r"scale\(([\d.]+)\)", text)]
    assert scales[1:] == [1] * (len(scales) - 1)


def test_default_subject(recorded: Recorded, tmp_path: Path) -> None:
    made, result = recorded
    assert made.shows(result) == "training"
    assert made.shows(replace(result, subject="line")) == "drawing"
    empty = Recorder()
    empty(result.history[0])  # a report without shapes
    assert not empty.scenes and empty.shows(result) == "drawing"
    with pytest.raises(UsageError, match="there is no training to show"):
        empty.save(tmp_path / "a.gif", result, what="training")


@pytest.mark.parametrize("size", [(40_000, 2), (2, 40_000), (10, 1000), (1, 1), (640, 480)])
@pytest.mark.parametrize("width", [None, 16, 2048])
def test_sides_of_films(size: tuple[int, int], width: int | None) -> None:
    """The shorter one keeps a pixel, unless the longer one would be longer than films can be."""
    zoom = films.zoom_of(Path("a.webp"), size, width)
    picture = Image.new("RGB", (max(1, int(size[0] * zoom)), max(1, int(size[1] * zoom))))
    assert films.encoded(Path("a.webp"), [(picture, 1.0)])[:4] == b"RIFF"
    assert max(size) == 40_000 or min(size) * zoom >= 1 - 1e-9
    assert size != (640, 480) or not width or zoom == width / 640


@pytest.mark.parametrize("renderer", ["exact", "splat", "gaussian", "none"])
@pytest.mark.parametrize("scene", [FLAT, with_gradients(FLAT), CLEAR], ids=["flat", "gradients", "clear"])
def test_frames_look_as_a_viewer_shows_the_file(
    renderer: str, scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The viewer draws what the renderer cannot, as too many shapes."""

    def refuses(*_: object) -> None:
        raise CapacityError("too many")

    if renderer == "none":
        monkeypatch.setattr(Renderer, "grow", refuses)
    settings = Settings(renderer="exact" if renderer == "none" else renderer)
    painted = Painter(Backend.on("cpu", 1), settings, (96, 72)).paint(scene, 2.0)
    seen = render_svg(export(scene, settings, GRIDS[-1]), zoom=2.0)
    assert painted.size == (96, 72)
    least = 45 if renderer == "none" else 36
    assert psnr(premultiplied(painted), premultiplied(seen)) > least, "39.9 to 42.8 dB over five scenes"


def test_recorded_scenes_are_limited_in_number_and_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first and the last scene are kept."""
    scene = mixed_scene()
    scenes = [replace(scene, widths=np.full_like(scene.widths, i)) for i in range(250)]
    monkeypatch.setattr(recorder, "MAX_SCENES", 60)
    made = recorder_of(scenes)
    assert 30 < len(made.scenes) <= 60
    assert [int(scene.widths[0]) for scene in made.scenes] == made.moments
    assert (made.moments[0], made.moments[-1]) == (0, 249)
    monkeypatch.setattr(recorder, "MAX_BYTES", 10 * recorder._bytes_of(scene))
    assert 5 <= len(recorder_of(scenes[:100]).scenes) <= 10


def test_a_missing_video_package_is_named(
    recorded: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(films, "VIDEO_PACKAGE", "no_such_package")
    with pytest.raises(UsageError, match="pip install no_such_package, or warpsplat with its extra"):
        recorded[0].save(tmp_path / "a.mp4", recorded[1])
    assert not list(tmp_path.iterdir())
