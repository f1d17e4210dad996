"""The adjoint for opacities up to 1 is that of the others where both hold."""

from __future__ import annotations

import pytest

from tests.helpers import adjoint, relative_error, renderer_for
from tests.rendering.test_division import PAINTED
from tests.scenes import mixed_scene
from warpsplat.scene import Scene


@pytest.mark.parametrize("scene", [mixed_scene(seed=1), PAINTED], ids=["plain", "painted"])
def test_it_is_the_usual_one_of_translucent_shapes(device: str, scene: Scene) -> None:
    usual, opaque = (adjoint(renderer_for(scene, device, opaque=opaque), 0.7) for opaque in (False, True))
    for name, found in opaque.items():
        assert relative_error(found, usual[name]) < 1e-4, name
