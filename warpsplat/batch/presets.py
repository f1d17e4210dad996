"""Presets: settings by name, in YAML files that users can copy (``configs/presets``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import warpsplat.configs
from warpsplat.batch.file import BatchFile
from warpsplat.batch.layers import Layer, layer_of
from warpsplat.errors import UsageError, shown
from warpsplat.fit.options import nearest
from warpsplat.run.options import BY_NAME, KINDS, NESTED, RESEARCH_KEYS

FOLDER = Path(warpsplat.configs.__file__).parent / "presets"

ENDINGS = (".yaml", ".yml")

KEYS = (*BY_NAME, *RESEARCH_KEYS, *NESTED)
"""Keys of a preset: options that decide the result."""


def preset_names() -> list[str]:
    """Return the names of the presets that warpsplat brings."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def preset_layer(preset: str) -> Layer:
    """Return the settings of a preset: a name, or the path of a YAML file.

    Raises ``UsageError`` for an unknown preset, and for a mistake in its file, with the line.
    """
    path = Path(preset)
    if path.suffix.lower() not in ENDINGS:
        if preset not in preset_names():
            known = preset_names()
            hint = nearest(preset, known) or f"; known are: {', '.join(known)}, or a file.yaml"
            raise UsageError(f"there is no preset {shown(preset)}{hint}")
        path = FOLDER / f"{preset}.yaml"
    file = BatchFile(path)
    return layer_of(file, file.mapping(file.root, "a preset", KEYS))


def load_preset(preset: str) -> dict[str, Any]:
    """Return the settings of a preset as keywords of ``make_settings``; see ``preset_layer``."""
    return {key.replace("-", "_"): item.value for key, item in preset_layer(preset).items()}


def with_preset(preset: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the options ``given``, None being left out, over those of a preset."""
    values = load_preset(preset)
    stronger = {"quality": {"iterations"}, **{kind: {*KINDS} for kind in KINDS}}
    for name in [name for name in stronger if given.get(name) is not None]:
        values = {key: value for key, value in values.items() if key not in stronger[name]}
    return {**given, **{name: value for name, value in values.items() if given.get(name) is None}}
