"""Scenes of a run as frames, by warpsplat's own renderer, which is seven times as fast as a viewer."""

from __future__ import annotations

from PIL import Image

from warpsplat.errors import CapacityError
from warpsplat.fit.export import export, shown_paths
from warpsplat.fit.settings import Settings
from warpsplat.motion.films import Size, rasterised
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.run.render import to_pillow
from warpsplat.scene import Scene
from warpsplat.svg.write import GRIDS, resized


class Painter:
    """Draws scenes as their files look; each scene's capacity is the guess for the next."""

    def __init__(self, backend: Backend, settings: Settings, size: Size) -> None:
        """``settings``: of the run; ``size``: of the frames [px]."""
        self._backend, self._settings, self._size = backend, settings, size
        self._capacity: Capacity | None = None

    def paint(self, scene: Scene, scale: float) -> Image.Image:
        """Return a scene with ``scale`` px per canvas unit, cropped to the size; RGBA if not opaque."""
        if len(scene) and not scene.pictures:
            try:
                return self._rendered(scene, scale)
            except CapacityError:
                pass
        text = export(scene, self._settings, GRIDS[-1])
        if scene.pictures:  # content of other files
            return rasterised(text, self._size, scale)
        return rasterised(resized(text, *self._size, scale), self._size)

    def _rendered(self, scene: Scene, scale: float) -> Image.Image:
        parameters = Parameters(shown_paths(scene, self._settings), self._backend)
        renderer = Renderer(parameters, Viewport(*self._size, scale), capacity=self._capacity)
        renderer.forward_complete()
        self._capacity = renderer.capacity
        return to_pillow(renderer.read_image())
