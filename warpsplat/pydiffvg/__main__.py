"""``python -m warpsplat.pydiffvg SCRIPT ARGUMENTS``: run a script written for DiffVG."""

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
    """Make ``import pydiffvg`` and ``import diffvg`` find the modules of this package."""
    package = warpsplat.pydiffvg
    sys.modules["pydiffvg"] = package
    for found in pkgutil.iter_modules(package.__path__):
        if found.name != "__main__":
            module = importlib.import_module(f"{package.__name__}.{found.name}")
            sys.modules[f"pydiffvg.{found.name}"] = module
    for bare in ("diffvg", "optimize_svg"):  # scripts add the folder of the latter to the path
        sys.modules[bare] = sys.modules[f"pydiffvg.{bare}"]


def main(arguments: list[str]) -> int:
    """Run a script and return the exit status; a ``WarpsplatError`` is printed in one line."""
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
        places = [
            f"{frame.filename}:{frame.lineno}: "
            for frame in traceback.extract_tb(error.__traceback__)
            if Path(frame.filename) == script
        ]
        print(f"error: {places[-1] if places else ''}{message}", file=sys.stderr)
        return int(code)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
