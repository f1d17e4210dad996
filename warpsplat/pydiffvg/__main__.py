"""``python -m warpsplat.pydiffvg SCRIPT ARGUMENTS``: runs a script written for DiffVG."""

from __future__ import annotations

import importlib
import pkgutil
import runpy
import sys
import traceback
from pathlib import Path

import warpsplat.pydiffvg
from warpsplat.errors import UsageError, WarpsplatError, explain

USAGE = "usage: python -m warpsplat.pydiffvg SCRIPT [ARGUMENTS]"


def install() -> None:
    """Have ``import pydiffvg`` and ``import diffvg`` find the modules of this package."""
    package = warpsplat.pydiffvg
    sys.modules["pydiffvg"] = package
    for found in pkgutil.iter_modules(package.__path__):
        if found.name != "__main__":
            sys.modules[f"pydiffvg.{found.name}"] = importlib.import_module(
                f"{package.__name__}.{found.name}"
            )
    for bare in (
        "diffvg",
        "optimize_svg",
    ):  # the latter from DiffVG's own folder, which scripts add to the path
        sys.modules[bare] = sys.modules[f"pydiffvg.{bare}"]


def main(arguments: list[str]) -> int:
    """Run a script; what of it cannot be rendered is said in one line."""
    if not arguments or arguments[0] in {"-h", "--help"}:
        print(USAGE, file=sys.stderr if not arguments else sys.stdout)
        return 0 if arguments else int(UsageError.exit_code)
    script = Path(arguments[0])
    install()
    sys.argv = arguments
    sys.path[0] = str(script.resolve().parent)
    try:
        if not script.is_file():
            raise UsageError(f"{script}: no such script")
        runpy.run_path(str(script), run_name="__main__")
    except WarpsplatError as error:
        message, code = explain(error)
        frames = traceback.extract_tb(error.__traceback__)
        place = next(
            (f"{f.filename}:{f.lineno}: " for f in reversed(frames) if Path(f.filename) == script), ""
        )
        print(f"error: {place}{message}", file=sys.stderr)
        return int(code)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
