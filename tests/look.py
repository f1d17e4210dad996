"""The scenes of the tests to look at: ``python -m tests.look [FOLDER]`` writes ``scenes.png`` and their SVGs.

A row a scene: by the exact model, by splats, by soft Gaussians, and its file by resvg.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from tests.scenes import disc, mixed_scene, random_scene
from warpsplat.paper.models import GaussianModel, SplatModel
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.models import EXACT, Model
from warpsplat.rendering.renderer import render
from warpsplat.scene import Kind, Scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

SCENES: dict[str, Scene] = {
    "fills": random_scene(Kind.FILL),
    "strokes": random_scene(Kind.STROKE),
    "crowd": random_scene(Kind.FILL, count=12, width=96, height=80, seed=3),
    "mixed": mixed_scene(splines=False),
    "mixed-wide": mixed_scene(64, 48, seed=2, splines=False),
    "disc": disc(10, 30, 15),
}
ZOOM = 4
GAP = 8
"""Between two pictures [px]."""


def row(scene: Scene, text: str) -> np.ndarray:
    """The scene by each renderer, side by side, every pixel as a square of ZOOM x ZOOM."""
    models: tuple[Model, ...] = (EXACT, SplatModel(), GaussianModel())
    ours = [255.0 * render(scene, model=model, backend=Backend.on("cpu")) for model in models]
    shown = [np.round(pixels).astype(np.uint8) for pixels in (*ours, on_white(render_svg(text)))]
    large = [pixels.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1) for pixels in shown]
    return np.hstack([np.pad(p, ((GAP, 0), (GAP, 0), (0, 0)), constant_values=255) for p in large])


def main(folder: Path) -> None:
    """Write all."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {name: write_svg(scene) for name, scene in SCENES.items()}
    for name, text in texts.items():
        (folder / f"{name}.svg").write_text(text, "utf-8")
    rows = [row(scene, texts[name]) for name, scene in SCENES.items()]
    width = max(r.shape[1] for r in rows)
    sheet = [np.pad(r, ((0, 0), (0, width - r.shape[1]), (0, 0)), constant_values=255) for r in rows]
    Image.fromarray(np.vstack(sheet)).save(folder / "scenes.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "look"))
