"""What a wheel is made of: nothing in the package's folders is left out of it."""

from __future__ import annotations

import os
import runpy
from fnmatch import fnmatch
from pathlib import Path

import pytest
import setuptools

from tests import ROOT

tomllib = pytest.importorskip("tomllib", reason="Python 3.11 reads TOML")


def packages(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return what setup.py finds in a folder."""
    given: dict[str, list[str]] = {}
    monkeypatch.setattr(setuptools, "setup", given.update)
    monkeypatch.chdir(folder)
    runpy.run_path(str(ROOT / "setup.py"))
    return given["packages"]


def test_packages_are_found_without_links(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a clone on Windows, where a link is a file that names a folder."""
    for name in ("warpsplat", "kernels", "kernels/loss", "cli", "configs", "tests"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    (tmp_path / "warpsplat" / "kernels").write_text("../kernels")
    found = ["warpsplat", *(f"warpsplat.{name}" for name in ("cli", "configs", "kernels", "kernels.loss"))]
    assert packages(tmp_path, monkeypatch) == found


def test_every_package_and_every_file_of_data_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules in a folder without ``__init__.py`` would be missing from the wheel."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    build = tomllib.loads(text)["tool"]["setuptools"]
    files = [
        Path(folder, name).relative_to(ROOT)
        for folder, _, names in os.walk(ROOT / "warpsplat", followlinks=True)
        for name in names
        if "__pycache__" not in folder
    ]
    folders = {".".join(path.parent.parts) for path in files if path.suffix == ".py"}
    assert sorted(folders - {"warpsplat.compare"}) == packages(ROOT, monkeypatch)
    listed = [
        str(Path(*package.split("."), pattern))
        for package, patterns in build["package-data"].items()
        for pattern in patterns
    ]
    data = [str(path) for path in files if path.suffix != ".py"]
    assert len(data) > 10
    assert not [path for path in data if not any(fnmatch(path, pattern) for pattern in listed)]
