"""``warpsplat inkscape``: puts the files of the Inkscape extension where Inkscape finds them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.options import OUTPUT
from warpsplat.errors import UsageError

SOURCE = Path(__file__).parent
SCRIPT = "warpsplat_vectorize.py"
FILES = (SCRIPT, "warpsplat_vectorize.inx")

MARK = b"org.warpsplat.vectorize"
"""In each of the files: others of these names are not ours to touch."""

FLATPAK = ".var"
"""Folder of Flatpak's programs, in the path of their settings."""


@click.command("inkscape")
@click.option(
    "--folder",
    type=OUTPUT,
    help="Inkscape's folder of extensions (Edit > Preferences > System: User extensions).  [default: the"
    " one that Inkscape names]",
)
@click.option("--remove", is_flag=True, help="Remove it again.")
def command(folder: Path | None, remove: bool) -> None:
    """Install the Inkscape extension: Extensions > Images > Vectorize with warpsplat.

    It starts this very warpsplat: install it again when that has moved.
    """
    folder = folder or data_folder() / "extensions"
    targets = [folder / name for name in FILES]
    try:
        for target in targets:
            if target.exists() and MARK not in target.read_bytes():
                raise UsageError(f"{target}: not a file of warpsplat")
        if remove:
            for target in targets:
                target.unlink(missing_ok=True)
        else:
            folder.mkdir(parents=True, exist_ok=True)
            for target in targets:
                target.write_bytes(content(target))
    except OSError as error:
        raise UsageError(f"{error.filename}: {error.strerror}") from error
    echo(f"{'removed from' if remove else 'installed in'} {folder}; start Inkscape anew")


def content(target: Path) -> bytes:
    """Return what is installed as a file; the script knows this Python and the folder of this package."""
    text = (SOURCE / target.name).read_text("utf-8")
    if target.name == SCRIPT:
        outside = ["flatpak-spawn", "--host"] if FLATPAK in target.absolute().parts else []
        known = {"COMMAND": [*outside, sys.executable, "-m", "warpsplat"], "FOLDER": str(SOURCE.parents[1])}
        for name, value in known.items():
            before, _, after = text.partition(f"\n{name} = ")
            text = f"{before}\n{name} = {value!a}\n{after.partition(chr(10))[2]}"
    return text.encode()


def data_folder() -> Path:
    """Return the folder of the user's Inkscape: what it says, else the system's usual one."""
    if program := shutil.which("inkscape"):
        asked = subprocess.run(
            [program, "--user-data-directory"], capture_output=True, timeout=60, check=False
        )
        if path := os.fsdecode(asked.stdout).strip():
            return Path(path)
    if sys.platform == "win32":
        return Path(os.environ["APPDATA"], "inkscape")
    if sys.platform == "darwin":
        return Path.home() / "Library/Application Support/org.inkscape.Inkscape/config/inkscape"
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config", "inkscape")
