"""What a wheel is made of: nothing in the package's folders is left out of it."""

from __future__ import annotations

import os
from fnmatch import fnmatch
from pathlib import Path

import pytest
from setuptools import find_packages

from tests import ROOT

tomllib = pytest.importorskip("tomllib", reason="Python 3.11 reads TOML")


def test_every_package_and_every_file_of_data_is_found() -> None:
    """Modules in a folder without ``__init__.py`` would be missing from the wheel."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    build = tomllib.loads(text)["tool"]["setuptools"]
    files = [
        Path(folder, name).relative_to(ROOT)
        for folder, _, names in os.walk(ROOT / "warpsplat", followlinks=True)
        for name in names
        if "__pycache__" not in folder
    ]
    rules = build["packages"]["find"]
    found = find_packages(str(ROOT), include=rules["include"], exclude=rules["exclude"])
    folders = {".".join(path.parent.parts) for path in files if path.suffix == ".py"}
    assert sorted(folders - set(rules["exclude"])) == sorted(found)
    listed = [
        str(Path(*package.split("."), pattern))
        for package, patterns in build["package-data"].items()
        for pattern in patterns
    ]
    data = [str(path) for path in files if path.suffix != ".py"]
    assert len(data) > 10
    assert not [path for path in data if not any(fnmatch(path, pattern) for pattern in listed)]
