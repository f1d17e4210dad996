"""Render scenes of a run with our own renderer: a viewer takes seven times as long."""

from __future__ import annotations

from PIL import Image

from warpsplat.errors import CapacityError
from warpsplat.fit.export import export, shown_paths
from warpsplat.fit.settings import Settings
from warpsplat.motion.shown import Size, picture
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.run.render import to_pillow
from warpsplat.scene import Scene
from warpsplat.svg.write import GRIDS, resized


class Painter:
    """Renders scenes as their files look; the capacity for one is the first guess for the next."""

    def __init__(self, backend: Backend, settings: Settings, size: Size) -> None:
        """``settings``: of the run; ``size``: of the images [px]."""
        self._backend, self._settings, self._size = backend, settings, size
        self._capacity: Capacity | None = None

    def paint(self, scene: Scene, scale: float) -> Image.Image:
        """Render a scene with ``scale`` px a canvas unit, cropped; RGBA if not all is opaque."""
        if scene.pictures or not len(scene):
            return self._seen(scene, scale)
        try:
            return self._rendered(scene, scale)
        except CapacityError:
            return self._seen(scene, scale)

    def _rendered(self, scene: Scene, scale: float) -> Image.Image:
        parameters = Parameters(shown_paths(scene, self._settings), self._backend)
        renderer = Renderer(parameters, Viewport(*self._size, scale), capacity=self._capacity)
        renderer.forward_complete()
        self._capacity = renderer.capacity
        return to_pillow(renderer.read_image())

    def _seen(self, scene: Scene, scale: float) -> Image.Image:
        """Render a scene with resvg: one with kept elements, or one too large for our renderer."""
        text = export(scene, self._settings, GRIDS[-1])
        if scene.pictures:
            return picture(text, self._size, scale)
        return picture(resized(text, *self._size, scale), self._size)
