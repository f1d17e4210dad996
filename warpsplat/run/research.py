"""What a batch file may set besides the options: the other fields of ``Settings``, for those who try things.

Their names are the fields' with dashes. ``rates`` and ``density`` are mappings; what they leave out stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from warpsplat.fit.settings import Density, Settings
from warpsplat.run.options import OPTIONS
from warpsplat.scene import ATTRIBUTES

NESTED: Mapping[str, tuple[str, ...]] = {
    "rates": tuple(a.name for a in ATTRIBUTES),
    "density": tuple(f.name.replace("_", "-") for f in fields(Density)),
}
"""Keys whose values are mappings, and the keys in these."""

UNSET = ("simplify",)
"""Fields that follow from others: an image gets fewer shapes where no number is given."""

_options = {option.setting for option in OPTIONS}

RESEARCH_KEYS: tuple[str, ...] = tuple(
    f.name.replace("_", "-")
    for f in fields(Settings)
    if f.name not in _options and f.name not in NESTED and f.name not in UNSET
)
"""Keys of single values."""
