"""Renderers as a fit uses them: the exact one, and those that extensions register."""

from __future__ import annotations

from warpsplat.extensions import load_renderer
from warpsplat.fit.settings import Settings
from warpsplat.rendering.models import EXACT as EXACT_MODEL
from warpsplat.rendering.models import ExactModel, Model
from warpsplat.scene import FloatArray, IndexArray, Scene


class FitRenderer:
    """The exact renderer. Others override what differs."""

    exact: bool = True
    """Whether it shows a scene as a viewer shows the scene's file."""
    soft: bool = False
    """Whether shapes reach beyond their outlines: a file only approximates such a render, whose figures are
    therefore given as well, and shapes cannot be sorted by where their outlines overlap."""
    opacity_scale: float = 1.0
    """Opacity of a path in the file over that of its shape."""
    default_model: Model = EXACT_MODEL
    """The model for rendering only."""
    cannot_draw_files: str = ""
    """Why it cannot draw the scene of a file; empty if it can."""

    def preset(self, preset: Settings) -> Settings:
        """Return a preset with what changes in it for this renderer."""
        return preset

    def check(self, settings: Settings) -> None:
        """Raise ``UsageError`` if the settings cannot be combined with this renderer."""

    def model(self, settings: Settings, step: int, slack: float) -> Model:
        """Return the model of coverage after ``step`` steps; ``slack``: see ``ExactModel``."""
        return ExactModel(slack=slack)

    def to_paths(self, scene: Scene, settings: Settings) -> Scene:
        """Return the scene that the file holds, ``opacity_scale`` aside."""
        return scene

    def drawable(self, scene: Scene) -> Scene:
        """Return any scene in a form that this renderer can draw; ``ValueError`` names what it cannot."""
        return scene

    def weights(self, scene: Scene) -> list[FloatArray]:
        """Return, by shape, the weights of its points in the points of ``drawable``: shape (new, old).

        Empty: it draws the scene as it is. Raises ``ValueError`` as ``drawable``.
        """
        return []

    def split(self, scene: Scene, keep: IndexArray, most: int) -> tuple[IndexArray, Scene]:
        """Replace up to ``most`` of the shapes ``keep`` by two each; return those left, and the new ones."""
        return keep, scene.take(keep[:0])


EXACT = FitRenderer()


def renderer_of(name: str) -> FitRenderer:
    """Return a renderer by its name; raise ``UsageError`` if there is none."""
    found: FitRenderer = load_renderer(name)
    return found
