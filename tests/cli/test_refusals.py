"""Commands that are refused: the exit code, one line that names the cause, and no file changed or left."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from tests import make_image
from tests.cli.helpers import Cli, one_line
from tests.fuzz.corpus import own_svg
from warpsplat.cli.main import COMMANDS

WITHOUT_JSON = ("render", "serve")
"""Commands without ``--json``."""

VALID = {
    "vectorize": "vectorize photo.png",
    "refine": "refine drawing.svg photo.png -o a.svg",
    "render": "render drawing.svg -o a.png",
    "eval": "eval photo.png drawing.svg",
    "batch": "batch good.yaml",
    "compare": "compare photo.png --against vtracer",
    **{name: name for name in ("bench", "info", "inkscape", "doctor", "serve")},
}
WITH_DEVICE = ("vectorize", "refine", "batch", "bench", "serve")
OPTIMISING = ("vectorize photo.png", "refine drawing.svg photo.png")

USAGE = [
    *[
        (f"vectorize photo.png {option}", "quotes, as an unquoted # begins a comment")
        for option in ("--background ''", "--palette ''", "--palette '#ff'")
    ],
    ("folder.svg", "folder.svg: is a folder; warpsplat batch folder.svg vectorizes its images"),
    ("nonsense", "no such command or file: nonsense; commands are vectorize, "),
    ("vectorise photo.png", "no such command or file: vectorise; did you mean 'vectorize'?"),
    ("drawing.svg", "drawing.svg: with which command? warpsplat render FILE.svg"),
    ("good.yaml", "good.yaml: with which command? warpsplat batch FILE.yaml"),
    ("--curves 5 photo.png", "(options follow a command: warpsplat vectorize IMAGE ...)"),
    ("vectorize photo.png --colours 5", "no such option: --colours; did you mean '--colors'?"),
    *[(f"{line} --nonsense", "--nonsense") for line in VALID.values()],
    *[(f"{VALID[name]} --device cuda:99", "cuda:99") for name in WITH_DEVICE],
    *[(line, "issing") for line in ("compare", "vectorize", "refine drawing.svg")],
    ("vectorize photo.png --device tpu", "tpu"),
    # Values
    ("vectorize photo.png --curves 0", "curves"),
    ("vectorize photo.png --curves many", "--curves"),
    ("vectorize photo.png --quality best", "--quality"),
    ("vectorize photo.png --subject foto", "did you mean 'photo'?"),
    ("vectorize photo.png --shape rectangel", "did you mean 'rectangle'?"),
    ("vectorize photo.png --threads 0", "'--threads': 0 is less than 1"),
    ("serve --port 99999", "99999 is not between 0 and 65535"),
    ("vectorize photo.png --time-budget soon", "not a time"),
    ("vectorize photo.png --max-bytes -1", "not a size"),
    (f"vectorize photo.png --max-bytes {400 * '9'}", "not a size"),
    ("vectorize photo.png --target-psnr -3", "target-psnr"),
    ("vectorize photo.png --target-psnr nan", "target-psnr"),
    ("vectorize missing.png --size mm", "not a size: 'mm'"),
    *[
        (f"{line} --open --closed", "closed")
        for line in ("vectorize missing.png", "batch photo.png", "compare photo.png --against vtracer")
    ],
    ("vectorize missing.png --page b5", "page must be one of"),
    ("vectorize missing.png --units ell", "units must be one of"),
    ("refine drawing.svg photo.png -o a.svg --iterations 0", "iterations"),
    ("refine drawing.svg photo.png -o a.svg --background yelow", "did you mean 'yellow'?"),
    ("vectorize ''", "the name of the file is empty"),
    ("vectorize drawing.svg", "drawing.svg: is an SVG, not an image; refine improves SVGs"),
    ("refine photo.png drawing.svg", "refine takes the SVG first, then the image"),
    ("eval drawing.svg photo.png", "eval takes the image first, then the SVG"),
    *[(f"vectorize photo.png {option} many", "is not a whole number") for option in ("--threads", "--seed")],
    *[(f"{VALID['render']} --scale {scale}", "scale") for scale in ("0", "-1", "nan", "1e9", "1e308")],
    ("render good.svg -o a.png --scale 1e-9", "scale"),
    ("render many.svg -o a.png --scale 2", "scale 2.0 makes"),
    # Outputs
    *[(f"{line} -o none/a.png", "does not exist") for line in (*OPTIMISING, "render drawing.svg")],
    *[(f"{line} -o photo.png", "is the input itself") for line in OPTIMISING],
    *[(f"{line} -o foreign.svg", "exists and was not written by warpsplat") for line in OPTIMISING],
    *[
        (f"{line} -o {name}", "a result's name ends with ")
        for line in (*OPTIMISING, "render drawing.svg")
        for name in ("a.jpg", "a.txt", "a")
    ],
    ("vectorize photo.png -o a.gz", "a result's name ends with .svg, .svgz, .png, .pdf, .dxf or .eps"),
    ("render drawing.svg -o a.svgz", "a result's name ends with .png, .pdf, .dxf or .eps"),
    ("refine drawing.svg photo.png -o drawing.svg", "is the input itself"),
    ("render drawing.svg -o drawing.svg", ""),
    ("render drawing.svg -o a.pdf --renderer exact", "makes pixels"),
    ("vectorize photo.png -o .", "is a folder"),
    ("vectorize photo.png -o folder.svg", "folder"),
    ("vectorize photo.png -o photo.png/a.svg", "photo.png"),
    ("vectorize photo.png -o /proc/a.svg", "/proc"),
    ("vectorize photo.png -o /dev/null", "is a device"),
    ("vectorize photo.png -o loop.svg", "loop.svg"),
    (f"vectorize photo.png -o {300 * 'x'}.svg", "xxx"),
    ("vectorize - --curves 4", "give -o FILE.svg"),
    ("refine - photo.png", "give -o FILE-refined.svg"),
    ("render -", "give -o FILE.png"),
    *[
        (f"vectorize photo.png {flags}", "-q and -v cannot be combined")
        for flags in ("-q -v", "-v -q", "-vvq")
    ],
    ("batch photo.png -q -v", "-q and -v cannot be combined"),
    ("render foreign-9.svg", "foreign-9.png: exists and was not written"),
    ("vectorize - -o a.svg --importance -", "image and mask"),
    ("vectorize photo.png -o - --data-uri", ""),
    ("refine - - -o b.svg", ""),
    ("eval - -", ""),
    # Checkpoints
    ("vectorize photo.png --resume", "needs a checkpoint"),
    ("vectorize photo.png --checkpoint photo.png --overwrite", "is the input itself"),
    ("vectorize photo.png -o a.svg --checkpoint a.svg", "another name"),
    ("vectorize photo.png --checkpoint -", "not the standard output"),
    ("vectorize photo.png --checkpoint a --checkpoint-every often", "not a time"),
    # Several numbers of shapes
    ("vectorize photo.png --curves 5,5", "5 is given twice"),
    ("vectorize photo.png --curves 0,5", "curves must be a whole number from 1"),
    ("vectorize photo.png --curves 5,x", "neither a whole number nor a list"),
    ("vectorize photo.png --curves 5,9 -o -", "several files: give -o 'NAME-{curves}.svg'"),
    ("vectorize photo.png --curves 5,9 -o same-{stem}.svg", "2 results would be same-photo.svg"),
    ("vectorize photo.png --curves 5,9 -o new/{curves}-{x}.svg", "'{x}' is not a field"),
    ("vectorize photo.png --curves 5,9 -o new/{curves}.svg --report no/a.html", "no does not exist"),
    ("vectorize photo.png --curves 5,9 -o photo.png/{curves}.svg", "photo.png is a file, not a folder"),
    ("vectorize photo.png --curves 3,9 -o foreign-{curves}.svg", "foreign-9.svg: exists and was not written"),
    *[
        (f"vectorize photo.png --curves 8,9 --{option}", f"and {option.split()[0]} cannot be combined")
        for option in ("target-psnr 20", "max-bytes 2KB", "time-budget 9s")
    ],
    ("vectorize photo.png --curves 8,9 --layered", "and levels cannot be combined"),
    ("vectorize photo.png --curves 5,9 --checkpoint a.ckpt", "and --checkpoint cannot be combined"),
    ("vectorize photo.png --curves 5,9 --data-uri", "and --data-uri cannot be combined"),
    ("vectorize photo.png --curves 5,9 --animate a.gif", "--animate takes one number of shapes"),
    (
        "vectorize photo.png --curves 5,9 --subject pixel -o new/",
        "how many shapes a piece of pixel art has",
    ),
    ("vectorize photo.png --curves 5,9 photo.png", "matrix: {curves: [5, 9]}"),
    ("vectorize photo.png --suggest --curves 5", "--suggest and --curves cannot be combined"),
    ("vectorize photo.png --suggest --max-bytes 5KB", "suggest and max-bytes both"),
    ("vectorize photo.png --suggest -o a.svg", "writes nothing"),
    # Batches
    ("batch photo.png --curves 5,9", "matrix: {curves: [5, 9]}"),
    ("batch list.yaml", "matrix: {curves: [...]}"),
    ("batch text.yaml", "matrix: {curves: [5, 9]}"),
    ("batch foreign.yaml", "foreign.svg"),
    ("batch none.yaml", "none.yaml"),
    ("batch wrong.yaml", "curves"),
]

INPUT = [
    ("render photo.png", "photo.png: not an SVG"),
    *[
        (line.replace("photo.png", name), name)
        for line in map(VALID.__getitem__, ("vectorize", "refine", "eval", "compare"))
        for name in ("none.png", "broken.png")
        if "compare" not in line or name == "none.png"
    ],
    *[
        (line.replace("drawing.svg", name), name)
        for line in map(VALID.__getitem__, ("refine", "render", "eval"))
        for name in ("none.svg", "broken.png", "binary.svg")
    ],
    ("eval photo.png photo.png", "warpsplat: photo.png: not an SVG"),
    ("none.png", "none.png: no such file"),
    ("none.svg", "none.svg: no such file"),
    ("none/photo", "none/photo: no such file"),
    ("vectorize .", "is a folder, not an image; warpsplat batch takes folders"),
    ("vectorize folder.svg", "folder.svg"),
    ("render . -o a.png", ""),
    ("render many.svg -o a.png", "many.svg: has more than 200 million pixels"),
    ("render /dev/zero -o a.png", "device"),
    ("render text.svg -o a.png --renderer exact --device cpu", "text.svg: "),
    ("render text.svg -o a.png --renderer exact --device cpu", "<text>"),
    ("render contours.svg -o a.png --renderer splat --device cpu", "several contours"),
    ("render caps.svg -o a.png --renderer splat --device cpu", "caps"),
    ("eval photo.png square.svg", ""),
    ("refine square.svg photo.png -o b.svg", ""),
    ("refine pattern.svg photo.png -o b.svg", ""),
    ("refine clip.svg photo.png -o b.svg", ""),
    ("refine opacity.svg photo.png -o b.svg", ""),
    ("refine filter.svg photo.png -o b.svg", "filter"),
]

HEAD, SIZE, PATH = (
    '<svg xmlns="http://www.w3.org/2000/svg" ',
    'width="32" height="24">',
    '<path d="M0 0H9V9Z" ',
)
SVGS = {
    "good": 'width="5in" height="4in" viewBox="0 0 50 40"/>',
    "many": 'width="1e9" height="1e-9" viewBox="0 0 4 2"/>',
    "foreign": f"{SIZE}<!-- by hand --></svg>",
    "foreign-9": f"{SIZE}<!-- by hand --></svg>",
    "square": f'width="24" height="24">{PATH}/></svg>',
    "pattern": f'{SIZE}<pattern id="g"/>{PATH}fill="url(#g)"/></svg>',
    "clip": f'{SIZE}<g clip-path="url(#c)">{PATH}/></g></svg>',
    "opacity": f'{SIZE}{PATH}stroke="red" opacity=".5"/></svg>',
    "filter": f'{SIZE}<filter id="f"/>{PATH}filter="url(#f)"/></svg>',
    "text": f"{SIZE}<text>a</text></svg>",
    "contours": f'{SIZE}<path d="M1 1h9v9zM3 3v4h4z"/></svg>',
    "caps": f'{SIZE}<path d="M1 1h9v9" fill="none" stroke="red"/></svg>',
}
QUICK = "iterations: 4, device: cpu"
FILES = {
    **{f"{name}.svg": (HEAD + text).encode() for name, text in SVGS.items()},
    "drawing.svg": own_svg("fill"),
    "binary.svg": bytes(range(256)),
    "broken.png": b"no image",
    "good.yaml": f"jobs: [{{images: photo.png, curves: 4, {QUICK}}}]".encode(),
    "foreign.yaml": f"jobs: [{{images: foreign.png, curves: 4, {QUICK}}}]".encode(),
    "wrong.yaml": b"jobs: [{images: photo.png, curvs: 4}]",
    "list.yaml": b"jobs: [{images: photo.png, curves: [5, 9]}]",
    "text.yaml": b"jobs:\n  - images: photo.png\n    curves: 5,9\n",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("inputs")
    for name in ("photo.png", "foreign.png", "foreign-9.png"):
        make_image(path / name)
    for name, data in FILES.items():
        (path / name).write_bytes(data)
    (path / "folder.svg").mkdir()
    (path / "loop.svg").symlink_to("loop.svg")
    return path


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() if path.is_file() else b"" for path in folder.iterdir()}


@pytest.mark.parametrize(
    ("code", "line", "words"), [*((2, *row) for row in USAGE), *((3, *row) for row in INPUT)]
)
def test_refusals(
    folder: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli, code: int, line: str, words: str
) -> None:
    monkeypatch.chdir(folder)
    before, arguments = contents(folder), shlex.split(line)
    shown = cli(*arguments, code=code)
    said = one_line(shown.err)
    assert said.startswith("warpsplat: ") and words in said
    assert shown.out == ""
    if arguments[0] not in WITHOUT_JSON and " -o -" not in line and "data-uri" not in line:
        shown = cli(*arguments, "--json", code=code)
        assert one_line(shown.err) == said
        assert json.loads(shown.out) == {"error": said.removeprefix("warpsplat: "), "exit_code": code}
    assert contents(folder) == before


def test_every_command_is_refused_something() -> None:
    assert {*COMMANDS} <= {line.split()[0] for line, _ in USAGE}


@pytest.mark.parametrize("option", ["--curves", "--seed", "--quality", "--background", "--levels", "--size"])
def test_a_refused_value_is_shown_by_its_beginning(option: str, cli: Cli) -> None:
    said = cli("vectorize", "a.png", option, 5000 * "9", code=2).line
    assert 70 * "9" in said and 90 * "9" not in said


@pytest.mark.parametrize("option", ["--background", "--palette"])
def test_a_colour_that_the_shell_took_for_a_comment(option: str, cli: Cli) -> None:
    said = cli("vectorize", "a.png", option, code=2).line
    assert f"'{option}' requires an argument; write it in quotes" in said
