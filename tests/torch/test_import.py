"""PyTorch is imported by ``warpsplat.torch`` alone."""

from __future__ import annotations

import subprocess
import sys

from tests import ROOT
from warpsplat.extensions import extensions

MODULES = (
    "warpsplat",
    *(f"warpsplat.run.{name}" for name in ("vectorize", "several", "suggest", "refine", "render")),
    "warpsplat.cli.main",
    *(
        f"warpsplat.{name}"
        for name in ("batch.command", "motion.recorder", "pages.report", "paper.renderers", "tools.bench")
        if name.partition(".")[0] in extensions()
    ),
)


def run(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)


def test_nothing_else_imports_torch() -> None:
    done = run(f"import sys, {', '.join(MODULES)}; print('torch' in sys.modules)")
    assert done.stdout.split()[-1] == "False"


def test_without_torch_one_line_says_what_to_do() -> None:
    done = run("import sys; sys.modules['torch'] = None; import warpsplat.torch")
    message = "ImportError: warpsplat.torch needs PyTorch: pip install warpsplat[torch]"
    assert done.stderr.splitlines()[-1] == message
