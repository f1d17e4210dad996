"""The command line as a whole: a light start, usage errors, streams, whatever is raised."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import QUICK, one_line, run, shell
from warpsplat.errors import CapacityError, ExitCode
from warpsplat.svg.viewer import render_svg


def test_help_is_quick_and_heavy_libraries_stay_out() -> None:
    code = (
        "import sys; from warpsplat.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as e: assert not e.code\n"
        "heavy = {'warp', 'numpy', 'torch', 'cv2', 'PIL'} & set(sys.modules); assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in ("vectorize", "batch", "render", "bench", "info"):
        assert name in done.stdout
    assert "\\b" not in done.stdout


@pytest.mark.slow
def test_a_run_never_imports_torch(image: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from warpsplat.cli.main import main\n"
        f"try: main(['vectorize', {str(image)!r}, '-o', {str(tmp_path / 'a.svg')!r}, '-q', *{QUICK!r}])\n"
        "except SystemExit as e: assert not e.code\n"
        "assert 'torch' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert done.stdout == ""


WRONG = [
    (["--curves", "0"], "curves"),
    (["--curves", "-5"], "curves"),
    (["--curves", "many"], "--curves"),
    (["--quality", "best"], "--quality"),
    (["--device", "cuda:99"], "cuda:99"),
    (["--device", "tpu"], "tpu"),
    (["--iterations", "0"], "iterations"),
    (["--frobnicate"], "--frobnicate"),
    (["-o", "missing/folder/a.svg"], "does not exist"),
    (["-o", "."], "is a folder"),
]


@pytest.mark.parametrize(("arguments", "word"), WRONG)
def test_wrong_usage(
    image: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], word: str
) -> None:
    assert run("vectorize", image, *arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert word in one_line(captured.err)


def test_inputs_are_never_outputs(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg = tmp_path / "a.svg"
    assert run("vectorize", image, "-o", svg, "-q", *QUICK) == 0
    kept = {p: p.read_bytes() for p in (image, svg)}
    assert run("render", svg, "-o", svg) == 2
    assert run("refine", svg, image, "-o", image, "--iterations", "5") == 2
    assert run("vectorize", image, "-o", os.devnull, *QUICK) == 2
    assert "is a device" in capsys.readouterr().err
    assert kept == {p: p.read_bytes() for p in (image, svg)}


ODD = [
    (["vectorize", "."], 3),
    (["vectorize", ""], 3),
    (["vectorize", "photo.png", "-o", "x" * 300 + ".svg"], 2),
    (["vectorize", "photo.png", "--max-bytes", "9" * 400], 2),
    (["vectorize", "photo.png", "--target-psnr", "nan"], 2),
    (["render", "good.svg", "-o", "a.png", "--scale", "1e308"], 2),
    (["render", "good.svg", "-o", "a.png", "--scale", "1e-9"], 2),
    (["eval", "photo.png", "square.svg"], 3),
    (["refine", "square.svg", "photo.png", "-o", "b.svg"], 3),
    (["refine", "pattern.svg", "photo.png", "-o", "b.svg"], 3),
    (["refine", "clip.svg", "photo.png", "-o", "b.svg"], 3),
    (["refine", "opacity.svg", "photo.png", "-o", "b.svg"], 3),
    (["nonsense"], 2),
]


@pytest.mark.parametrize(("arguments", "code"), ODD)
def test_odd_requests_are_one_line(
    image: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    code: int,
) -> None:
    head, path = '<svg xmlns="http://www.w3.org/2000/svg" ', '<path d="M0 0H9V9Z" '
    files = {
        "good.svg": 'width="5in" height="4in" viewBox="0 0 50 40"/>',
        "square.svg": f'width="40" height="40">{path}/></svg>',
        "pattern.svg": f'width="60" height="40"><pattern id="g"/>{path}fill="url(#g)"/></svg>',
        "clip.svg": f'width="60" height="40"><g clip-path="url(#c)">{path}/></g></svg>',
        "opacity.svg": f'width="60" height="40">{path}stroke="red" opacity=".5"/></svg>',
    }
    for name, text in files.items():
        (image.parent / name).write_text(head + text)
    monkeypatch.chdir(image.parent)
    before = set(os.listdir())
    assert run(*arguments) == code
    one_line(capsys.readouterr().err)
    assert set(os.listdir()) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("streams", "code"),
    [
        ("2>&-", 0),
        (">&-", 0),
        ("<&- >&- 2>&-", 0),
        pytest.param(
            "2>/dev/full", 0, marks=pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux")
        ),
        pytest.param(
            ">/dev/full", 4, marks=pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Linux")
        ),
    ],
)
def test_standard_streams_that_are_full_or_closed(image: Path, streams: str, code: int) -> None:
    output = image.parent / "a.svg"
    done = shell(f"$W {streams}", "vectorize", image, "-o", output, "-vv", *QUICK)
    assert done.returncode == code
    assert b"Traceback" not in done.stderr
    assert (b"a.svg: " in done.stdout) == streams.startswith("2>")
    render_svg(output.read_text())


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="names of bytes")
def test_control_characters_of_names_are_escaped(tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"a\x1b[31m\n\xff.png")
    path.write_bytes(b"no image")
    done = shell("$W", "vectorize", path, *QUICK)
    assert done.returncode == 3
    assert done.stderr.count(b"\n") == 1
    assert b"a\\x1b[31m\\n\\udcff.png" in done.stderr
    Image.new("RGB", (9, 9)).save(path, "PNG")
    done = shell("$W", "vectorize", path, "-o", path.with_suffix(".svg"), *QUICK)
    assert done.returncode == 0
    assert b"\x1b" not in done.stdout
    assert b"\\x1b[31m" in done.stdout


RAISED = [
    (MemoryError("Unable to allocate 9 GiB"), 7, "not enough memory: Unable to allocate 9 GiB"),
    (RuntimeError("Failed to allocate 9 bytes on device 'cpu'"), 7, "not enough memory: Failed"),
    (CapacityError("too many slots"), 7, "too many slots"),
    (type("PanicException", (BaseException,), {})("unwrapped\nand more"), 3, "renderer gave up: unwrapped"),
    (OSError(28, "No space left on device", "/x/y"), 4, "/x/y: No space left on device"),
    (KeyboardInterrupt(), 130, "interrupted"),
    (ValueError("x = \x1b[31m"), 1, "internal error: ValueError: x = \\x1b[31m (set WARPSPLAT_TRACEBACK=1"),
]


@pytest.mark.parametrize(("error", "code", "words"), RAISED)
def test_whatever_is_raised_is_one_line_and_a_code(
    image: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: BaseException,
    code: int,
    words: str,
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("warpsplat.jobs.training.fit", fail)
    assert run("vectorize", image, "-o", image.parent / "a.svg", *QUICK) == code
    assert words in one_line(capsys.readouterr().err)
    monkeypatch.setenv("WARPSPLAT_TRACEBACK", "1")
    assert run("vectorize", image, "-o", image.parent / "a.svg", *QUICK) == code
    assert "Traceback" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--curves", "--seed", "--quality", "--background", "--levels", "--size"])
def test_a_refused_value_is_shown_by_its_beginning(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    """By click as well."""
    assert run("vectorize", "a.png", option, 5000 * "9") == ExitCode.USAGE
    said = one_line(capsys.readouterr().err)
    assert 70 * "9" in said and 90 * "9" not in said
