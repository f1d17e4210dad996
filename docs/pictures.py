"""Pictures and figures of the README, the tutorial and the presets: ``python docs/pictures.py [NAME ...]``.

Draws what the tutorial starts from, then runs the commands of these names, or of all that are out of date.
"""

from __future__ import annotations

import json
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import records
from PIL import Image, ImageFilter

import warpsplat
from warpsplat.svg.viewer import render_own

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "images" / "sources"

LOGO = """<svg xmlns="http://www.w3.org/2000/svg" width="240" height="240" viewBox="0 0 240 240">
<rect x="12" y="12" width="216" height="216" rx="52" fill="#20304f"/>
<circle cx="160" cy="84" r="34" fill="#ffc44d"/>
<path fill="#2f8f83" d="M36 186 96 84l60 102z"/>
<path fill="#f4f1e8" d="M96 84l21.2 36-12.2 10-10-9-10 12-10.2-13z"/>
<path fill="#53b8a6" d="M104 186l44-66 56 66z"/>
<path fill="none" stroke="#f4f1e8" stroke-width="9" stroke-linecap="round"
 d="M52 204c28-14 44 8 70 0s40-12 66 0"/>
</svg>"""
"""A badge on nothing: four regions, a line, an edge that is transparent outside."""

SKETCH = """<svg xmlns="http://www.w3.org/2000/svg" width="480" height="320" viewBox="0 0 480 320">
<rect width="480" height="320" fill="#f3ead8"/>
<g fill="none" stroke="#26282e" stroke-width="4" stroke-linecap="round" stroke-linejoin="round">
<path d="M96 214c70 14 190 16 286-4-14 32-34 50-62 58-60 10-118 8-164-2-30-8-50-26-60-52z"/>
<path d="M232 222C231 160 232 92 236 34"/>
<path d="M236 40c52 44 88 94 104 152-36 8-70 12-104 12"/>
<path d="M224 62c-24 50-54 92-90 124 30 10 60 14 92 14"/>
<path d="M236 34c12-10 26-8 38-2-12 4-24 10-38 10"/>
<path d="M30 262c24-12 40-12 58 0s34 12 52 2"/>
<path d="M340 268c20-12 38-12 56 0s34 12 54 0"/>
<path d="M46 296c26-12 44-10 62 0s40 10 60 0 40-10 60 0 40 10 62 0 40-10 60 0 34 8 52 0"/>
<path d="M372 74c10-12 20-14 30-2 10-12 22-12 32 0"/>
<path d="M70 96c8-10 16-10 24 0 8-10 18-10 26 0"/>
</g></svg>"""
"""A boat in ink; noise and blur make a scan of it."""

BY_HAND = """<svg xmlns="http://www.w3.org/2000/svg" width="451" height="300">
<rect width="451" height="300" fill="#b5a39c"/>
<path fill="#e0cdc0" d="M330 150h130v160H290z"/>
<path fill="#9a7350" d="M40 0C20 120 30 210 60 310h250c70-40 80-120 60-180L330 0z"/>
<path fill="#c08f62" d="M150 40h150l20 120-30 80h-60l-50-80z"/>
<path fill="#d9c2a6" d="M40 140c60 0 90 40 160 80l60 60-30 40H40z"/>
<path fill="#d9aa9a" d="M320 0h80l-30 60z"/>
<path fill="#7d5b3e" d="M40 100c60-20 90-30 110 0l50 20-40 40c-40 10-90-20-120-20z"/>
<circle cx="170" cy="115" r="32" fill="#a3a352"/>
<circle cx="318" cy="136" r="25" fill="#a3a352"/>
<circle cx="174" cy="110" r="12" fill="#141a1c"/>
<circle cx="316" cy="132" r="10" fill="#141a1c"/>
<path fill="#b4532f" d="M240 232h50l-25 30z"/>
<path fill="#8a5f3e" d="M215 150h40l10 70-30 10z"/>
<path fill="#f0e2d4" d="M200 240c30 20 60 30 90 0l20 40-60 30-60-20z"/>
</svg>"""
"""The cat in 13 shapes, drawn in a few minutes."""

SPRITE = """
......##........##......
.....#oo#......#oo#.....
.....#opo######opo#.....
.....#oooooooooooo#.....
....#oooo-oooo-oooo#....
....#oooooooooooooo#....
....#ooowwoooowwooo#....
....#oowkwoooowkwoo#....
....#oowwwoooowwwoo#....
....#ooooooppoooooo#....
....#ooowwwkkwwwooo#....
.....#oowwwwwwwwoo#.....
......#oooowwoooo#...##.
.......##########...#oo#
......#oooowwoooo#..#oo#
.....#ooooowwooooo#.#oo#
.....#oo-oowwoo-oo##oo#.
.....#oooowwwwooooooo#..
.....#oooowwwwoooooo#...
......#oo#wwww#oo###....
......#ww#....#ww#......
.......##......##.......
"""
COLORS = {"#": "#3b2a2a", "o": "#e2873b", "-": "#b9602a", "p": "#f2a7a0", "w": "#fbf3e4", "k": "#201b22"}

CAT = "docs/images/cat.jpg"
SOURCES = "docs/images/sources"
PHOTOGRAPHS = "docs/gallery/images/photo"
STYLES = ("low-poly", "poster", "stained-glass", "brush", "ink", "placeholder")

COMMANDS = {
    "start/cat": f"vectorize {CAT} --curves 512 --closed",
    "tutorial/16": f"vectorize {CAT} --curves 16",
    "tutorial/64": f"vectorize {CAT} --curves 64",
    "tutorial/256": f"vectorize {CAT} --curves 256",
    "tutorial/strokes": f"vectorize {CAT} --curves 256 --open",
    "tutorial/poster": f"vectorize {CAT} --curves 128 --palette {SOURCES}/inks.txt",
    "tutorial/face": f"vectorize {CAT} --curves 64 --importance {SOURCES}/mask.png",
    "tutorial/refined": f"refine {SOURCES}/by-hand.svg {CAT}",
    "tutorial/logo": f"vectorize {SOURCES}/logo.png",
    "tutorial/sketch": f"vectorize {SOURCES}/sketch.jpg --subject line",
    "tutorial/sprite": f"vectorize {SOURCES}/sprite.png",
    **{
        f"styles/{name}-{style}": f"vectorize {PHOTOGRAPHS}/{name}.jpg --preset {style}"
        for name in ("coffee", "dahlia", "peaks")
        for style in STYLES
    },
}
"""By the names of the records (``records.py``): the README's, the tutorial's, those of the presets."""

SUGGESTION = f"vectorize {CAT} --suggest"
"""Whose lines the tutorial shows."""

KEPT = ("psnr", "ssim", "ssimulacra2", "bytes", "gzip_bytes", "shapes", "paths", "nodes", "psnr_before")
"""Figures of a run that records keep."""


def sprite() -> Image.Image:
    """The cat as pixel art, transparent around it."""
    rows = SPRITE.split()
    image = Image.new("RGBA", (len(rows[0]), len(rows)))
    for y, row in enumerate(rows):
        for x, letter in enumerate(row):
            if letter in COLORS:
                image.putpixel((x, y), (*bytes.fromhex(COLORS[letter][1:]), 255))
    return image


def sketch() -> Image.Image:
    """The drawing as a scanner would see it."""
    paper = render_own(SKETCH).convert("RGB").filter(ImageFilter.GaussianBlur(0.7))
    noise = np.random.default_rng(0).normal(0, 4, (paper.height, paper.width, 1))
    shade = np.linspace(0, -14, paper.width)[None, :, None]
    return Image.fromarray(np.clip(np.asarray(paper) + noise + shade, 0, 255).astype(np.uint8))


def mask() -> Image.Image:
    """White over the eyes and the nose of the cat, soft at the edges."""
    image = Image.open(ROOT / CAT).convert("L")
    y, x = np.mgrid[: image.height, : image.width]
    spots = ((170, 115, 42), (318, 136, 34), (264, 244, 34))
    inside = np.any([np.hypot(x - column, y - row) < radius for column, row, radius in spots], axis=0)
    return Image.fromarray(np.uint8(255) * inside).filter(ImageFilter.GaussianBlur(6))


def sources() -> None:
    """Write what the commands start from."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    (FOLDER / "by-hand.svg").write_text(BY_HAND, "utf-8")
    render_own(LOGO).save(FOLDER / "logo.png", optimize=True)
    sketch().save(FOLDER / "sketch.jpg", quality=88)
    sprite().save(FOLDER / "sprite.png", optimize=True)
    mask().save(FOLDER / "mask.png", optimize=True)


def own_loss() -> None:
    """Run the Python of gradient.md, and write what it starts from and what it makes."""
    page = (ROOT / "docs" / "gradient.md").read_text("utf-8")
    code = "".join(re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE))
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(ROOT / CAT, folder)
        subprocess.run([sys.executable, "-c", code], check=True, cwd=folder)
        shutil.copy(Path(folder, "own.svg"), picture("tutorial/own"))
    warpsplat.save_svg(warpsplat.starting_scene(ROOT / CAT, 64), picture("tutorial/own-start"))


def picture(name: str) -> Path:
    """Return where the SVG of a record is."""
    return ROOT / "docs" / "images" / f"{name.removeprefix('start/')}.svg"


def run(line: str, *more: str) -> tuple[str, float]:
    """Return what a command of warpsplat prints, and the CPU seconds that it takes, from start to end."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "warpsplat", *shlex.split(line), "--device", "cpu", *more]
    made = subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return made.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def made_of(name: str) -> dict[str, str]:
    """Return what tells whether an SVG is that of its record's command."""
    line = COMMANDS[name]
    files = [ROOT / word for word in shlex.split(line) if word.startswith("docs/")]
    return {
        "command": line,
        "files": records.digest(b"".join(path.read_bytes() for path in files)),
        "svg": records.digest(picture(name).read_bytes()),
    }


def is_current(name: str) -> bool:
    """Return whether a picture and its figures are what its command makes today."""
    group, _, rest = name.partition("/")
    record = records.read(group).get(rest)
    return bool(record and records.is_current(record) and record["made_of"] == made_of(name))


def make(name: str) -> dict[str, Any]:
    """Run a command; write its SVG and its record, and return this."""
    group, _, rest = name.partition("/")
    printed, seconds = run(COMMANDS[name], "-o", str(picture(name)), "--overwrite", "--quiet", "--json")
    figures = json.loads(printed)
    subject = "refined" if COMMANDS[name].startswith("refine") else figures["subject"]
    kept = {key: round(figures[key], 4) for key in KEPT if figures.get(key) is not None}
    record = {**records.stamp(subject), "made_of": made_of(name), "cpu": round(seconds, 1), **kept}
    records.write(group, rest, record)
    return record


def suggest() -> None:
    """Record the lines of a suggestion."""
    printed, seconds = run(SUGGESTION, "--quiet")
    lines = printed.replace(CAT, "cat.jpg").rstrip()
    record = {**records.stamp("photo"), "cpu": round(seconds, 1), "printed": lines}
    records.write("tutorial", "suggest", record)


def main(names: Sequence[str] = ()) -> None:
    """Draw the sources, and make what is out of date, or what is named."""
    sources()
    for name in names or [name for name in COMMANDS if not is_current(name)]:
        record = make(name)
        psnr = record.get("psnr", "exact")
        print(f"{name}: {psnr} dB, {record['bytes']} bytes, {record['cpu']} s", flush=True)
    known = records.read("tutorial").get("suggest")
    if not (names or (known and records.is_current(known))):
        suggest()
        own_loss()


if __name__ == "__main__":
    main(sys.argv[1:])
    records.fill_pages()
