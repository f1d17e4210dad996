"""Check that the program does without an extension: ``python -m tests.without EXTENSION``.

Copies the checkout without the extension's folder and tests, installs the copy over the packages of this
environment, vectorizes an image with it, and runs the tests; further arguments are those of pytest.
"""

from __future__ import annotations

import argparse
import os
import shutil
import site
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from tests import ROOT, make_image
from tests.needs import WORDS


def copy_without(extension: str, target: Path) -> None:
    """Copy what git would keep, but for the extension's folders."""
    listed = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.check_output(listed, cwd=ROOT, text=True).split("\0")
    folders = (f"warpsplat/{extension}/", f"tests/{extension}/")
    for name in names:
        if name and not name.startswith(folders) and os.path.lexists(ROOT / name):
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name, follow_symlinks=False)


def installed(checkout: Path, environment: Path) -> Path:
    """Install a checkout over the packages of this environment; return the folder of its programs."""
    venv.create(environment, with_pip=False, symlinks=os.name != "nt")
    programs = environment / ("Scripts" if os.name == "nt" else "bin")
    python = programs / "python"
    where = [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]
    purelib = Path(subprocess.check_output(where, text=True).strip())
    (purelib / "outer.pth").write_text("\n".join(site.getsitepackages()), encoding="utf-8")
    options = ["--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--ignore-installed"]
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check", "install"]
    subprocess.run([*pip, *options, str(checkout)], check=True)
    return programs


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.without", description=__doc__)
    parser.add_argument("extension", choices=WORDS)
    parser.add_argument("--smoke", action="store_true", help="the smoke tests only")
    given, arguments = parser.parse_known_args()  # the others are pytest's
    os.environ.pop("PYTHONPATH", None)
    with tempfile.TemporaryDirectory(prefix=f"without-{given.extension}-") as name:
        folder, checkout = Path(name), Path(name, "checkout")
        copy_without(given.extension, checkout)
        programs = installed(checkout, folder / "environment")
        make_image(folder / "noise.png")
        vectorize = ["vectorize", "noise.png", "--curves", "4", "--iterations", "10", "--device", "cpu"]
        for command in ([programs / "warpsplat", *vectorize], [programs / "warpsplat", "--help"]):
            subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)
        assert (folder / "noise.svg").stat().st_size
        smoke = ["-m", "smoke"] if given.smoke else []
        pytest = [programs / "python", "-m", "pytest", "-q", "-p", "no:cacheprovider", *smoke, *arguments]
        code = subprocess.run(pytest, cwd=checkout, check=False).returncode
    print(f"without {given.extension}: {'fail' if code else 'pass'}")
    sys.exit(code)


if __name__ == "__main__":
    main()
