"""A new attribute takes two edits of the package, which are tried on a copy."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT

ROW = """
    Attribute(
        "glows", "shape", 3, 0.05, Unit.ONE, (0.0, Unit.ONE), (1.0, Unit.ONE), (Kind.FILL,)
    ),
)
"""
FIELD = '''
    glows: FloatArray = None
    """Of fills, in [0, 1], shape (shape, 3)."""
'''


@pytest.mark.slow
def test_a_row_and_a_field_are_enough(tmp_path: Path) -> None:
    """For arrays, gradients, moments, Adam, bounds, surgery, whole runs: see ``new_attribute.py``."""
    copy = tmp_path / "warpsplat"
    shutil.copytree(ROOT / "warpsplat", copy)
    table, scene = copy / "scene" / "attributes.py", copy / "scene" / "scene.py"
    text = table.read_text("utf-8")
    assert text.endswith("\n)\n"), "the table is the last of the file"
    table.write_text(text.removesuffix("\n)\n") + ROW, "utf-8")
    before, last, after = scene.read_text("utf-8").partition('0 for fills."""\n')
    assert last and after.lstrip().startswith("starts:"), "widths are the last attribute"
    scene.write_text(before + last + FIELD.removeprefix("\n") + after, "utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-m", "tests.scene.new_attribute"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
