"""What a wheel is made of: nothing in the package's folders is left out of it."""

from __future__ import annotations

import os
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
from setuptools import find_packages

from tests import ROOT

tomllib = pytest.importorskip("tomllib", reason="Python 3.11 reads TOML")


@pytest.fixture(scope="module")
def build() -> dict[str, Any]:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    found: dict[str, Any] = tomllib.loads(text)["tool"]["setuptools"]
    return found


def files() -> list[Path]:
    """Of the package, relative to the folder that it lies in."""
    found = []
    for folder, _, names in os.walk(ROOT / "warpsplat", followlinks=True):
        found += [Path(folder, name).relative_to(ROOT) for name in names if "__pycache__" not in folder]
    return found


def test_every_package_is_found(build: dict[str, Any]) -> None:
    """Modules in a folder without ``__init__.py`` would be missing from the wheel."""
    found = find_packages(str(ROOT), include=build["packages"]["find"]["include"])
    assert sorted({".".join(path.parent.parts) for path in files() if path.suffix == ".py"}) == sorted(found)


def test_every_file_of_data_is_listed(build: dict[str, Any]) -> None:
    def listed(path: Path) -> bool:
        return any(
            fnmatch(str(path), str(Path(*package.split("."), pattern)))
            for package, patterns in build["package-data"].items()
            for pattern in patterns
        )

    data = [path for path in files() if path.suffix != ".py"]
    assert len(data) > 10
    assert not [path for path in data if not listed(path)]
