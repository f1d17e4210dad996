"""Animations play in a browser, and end with the file."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from tests.motion.helpers import recording
from tests.scenes import mixed_scene
from warpsplat import Recorder, Result
from warpsplat.scene import Basis, Kind
from warpsplat.scene.geometry import bounds

if TYPE_CHECKING:
    from playwright.sync_api import Page

SECONDS = 1.5
"""Duration of the animation."""

TRIES = 10
"""Attempts to take a picture before an animation is over: the machine may be busy."""

LONGEST_WAIT = 15.0
"""Longest wait for a picture [s]."""


@pytest.fixture(scope="module")
def recorded() -> tuple[Recorder, Result]:
    return recording(iterations=50)


def shot(tab: Page, element: str = "#shown") -> np.ndarray:
    data = tab.locator(element).first.screenshot()
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)


def comes(tab: Page, right: Callable[[np.ndarray], bool]) -> bool:
    """Wait for a picture that is ``right``, and return whether there was one."""
    end = time.monotonic() + LONGEST_WAIT
    while not (found := right(shot(tab))) and time.monotonic() < end:
        tab.wait_for_timeout(50)
    return found


def page_with(tab: Page, folder: Path, element: str) -> None:
    page = folder / "page.html"
    page.write_text(f'<!doctype html><title>a</title><body style="margin:0;background:#fff">{element}')
    tab.goto(page.as_uri())


def begins_otherwise(tab: Page, folder: Path, file: np.ndarray) -> bool:
    """Return whether the animation ``a.svg`` begins with another picture than ``file``."""
    for attempt in range(TRIES):
        page_with(tab, folder, f'<img id="shown" src="a.svg?{attempt}" width="48">')
        if np.abs(shot(tab) - file).mean() > 2:
            return True
    return False


@pytest.mark.parametrize("what", ["training", "drawing"])
def test_an_svg_plays_in_an_image(
    tab: Page, recorded: tuple[Recorder, Result], tmp_path: Path, what: str
) -> None:
    """It ends as the file, and begins so for users that prefer reduced motion."""
    made, result = recorded
    made.save(tmp_path / "a.svg", result, what=what, seconds=SECONDS)
    result.save(tmp_path / "file.svg")
    page_with(tab, tmp_path, '<img id="shown" src="file.svg" width="48">')
    file = shot(tab)
    assert begins_otherwise(tab, tmp_path, file)
    assert comes(tab, lambda picture: np.array_equal(picture, file))
    tab.wait_for_timeout(300)
    assert np.array_equal(shot(tab), file), "and stays"
    tab.emulate_media(reduced_motion="reduce")
    tab.goto((tmp_path / "a.svg").as_uri())
    assert np.array_equal(shot(tab, "svg"), file)


def at(tab: Page, seconds: float) -> np.ndarray:
    """Return the picture of an SVG at a time."""
    tab.evaluate(
        """time => {
            const svg = document.documentElement;
            svg.pauseAnimations();
            svg.setCurrentTime(time);
            for (const play of document.getAnimations()) {
                play.pause();
                play.currentTime = 1000 * time;
            }
        }""",
        seconds,
    )
    return shot(tab, "svg")


def test_a_shape_is_between_its_places(tab: Page, recorded: tuple[Recorder, Result], tmp_path: Path) -> None:
    """So are its colours, and a new shape is half opaque."""
    scene = replace(mixed_scene(48, 36), opacities=np.ones(len(mixed_scene()), np.float32))
    one = scene.take(np.flatnonzero((scene.kind == Kind.FILL) & (scene.basis == Basis.SPLINE))[:1])
    box = bounds(one)[0]
    centre, size = (box[:2] + box[2:]) / 2, (box[2:] - box[:2]).min()
    disc = replace(one, points=(one.points - centre) * 8 / size + np.float32(18), colors=one.colors * 0)
    moved = replace(
        disc,
        points=disc.points + np.array([3, 0], np.float32),
        colors=disc.colors + np.array([0.2, 0, 0], np.float32),
    )
    comes = moved.append(replace(disc, points=disc.points + np.array([20, 0], np.float32)))
    white = replace(disc.canvas, background=np.ones(3, np.float32))
    made = Recorder()
    made.scenes = [replace(made, canvas=white) for made in (disc, moved, comes, comes)]
    made.moments = list(range(4))
    made.save(tmp_path / "a.svg", replace(recorded[1], scene=made.scenes[-1]), what="training", seconds=3)
    tab.goto((tmp_path / "a.svg").as_uri())
    dark = [(at(tab, time) < 200)[..., 1].nonzero()[1].mean() for time in (0.01, 0.5, 0.99)]
    assert np.diff(dark) == pytest.approx(1.5, abs=0.4)
    assert at(tab, 0.5)[18, 19] == pytest.approx([25, 0, 0], abs=8)
    assert at(tab, 1.5)[18, 38] == pytest.approx(128, abs=20)
    assert at(tab, 2.5)[18, 38] == pytest.approx(0, abs=8)


@pytest.mark.parametrize("ending", ["webp", "gif"])
def test_a_film_plays_in_an_image(
    tab: Page, recorded: tuple[Recorder, Result], tmp_path: Path, ending: str
) -> None:
    recorded[0].save(tmp_path / f"a.{ending}", recorded[1], seconds=SECONDS, width=48)
    page_with(tab, tmp_path, f'<img id="shown" src="a.{ending}" width="48">')
    first = shot(tab)
    assert comes(tab, lambda picture: bool(np.abs(picture - first).mean() > 2))
