"""PyTorch is imported by ``warpsplat.torch`` alone."""

from __future__ import annotations

import subprocess
import sys

from tests import ROOT
from warpsplat.extensions import extensions

MODULES = (
    "warpsplat",
    *(f"warpsplat.api.{name}" for name in ("vectorize", "several", "suggest", "refine", "render")),
    "warpsplat.cli.main",
    "warpsplat.run.vectorize",
    *(
        f"warpsplat.{name}"
        for name in ("batch.command", "motion.recorder", "pages.report", "paper.renderers", "tools.bench")
        if name.partition(".")[0] in extensions()
    ),
)


def test_nothing_else_imports_torch() -> None:
    code = f"import sys, {', '.join(MODULES)}; print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.split()[-1] == "False"


def test_without_torch_one_line_says_what_to_do() -> None:
    code = "import sys; sys.modules['torch'] = None; import warpsplat.torch"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1] == (
        "ImportError: warpsplat.torch needs PyTorch: pip install warpsplat[torch]"
    )
