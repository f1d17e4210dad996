"""The command line as a whole: a light start, usage errors, streams, whatever is raised."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import QUICK, one_line, run, shell
from tests.forks import CLOSED, Forks
from warpsplat.cli.main import COMMANDS
from warpsplat.errors import CapacityError, ExitCode
from warpsplat.svg.viewer import render_own

FULL = "/dev/full"


def test_help_is_quick_and_heavy_libraries_stay_out() -> None:
    code = (
        "import sys; from warpsplat.cli.main import main\n"
        "try: main(['--help'])\n"
        "except SystemExit as e: assert not e.code\n"
        "heavy = {'warp', 'numpy', 'torch', 'cv2', 'PIL'} & set(sys.modules); assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in COMMANDS:
        assert name in done.stdout
    assert "\\b" not in done.stdout


WRONG = [
    (["--curves", "0"], "curves"),
    (["--curves", "many"], "--curves"),
    (["--quality", "best"], "--quality"),
    (["--device", "cuda:99"], "cuda:99"),
    (["--device", "tpu"], "tpu"),
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
    ("stdout", "stderr", "code"),
    [("out", CLOSED, 0), (CLOSED, "err", 0), ("out", FULL, 0), (FULL, "err", 4)],
)
def test_standard_streams_that_are_full_or_closed(
    forks: Forks, image: Path, stdout: str, stderr: str, code: int
) -> None:
    if FULL in (stdout, stderr) and not os.path.exists(FULL):
        pytest.skip("a device of Linux")
    output = image.parent / "a.svg"
    arguments = ["vectorize", str(image), "-o", str(output), "-vv", *QUICK]
    streams = [n if n in (CLOSED, FULL) else str(image.parent / n) for n in (stdout, stderr)]
    done, out, err = forks.run(arguments, image.parent, stdout=streams[0], stderr=streams[1])
    assert done == code
    assert "Traceback" not in err
    assert ("a.svg: " in out) == (stdout == "out")
    render_own(output.read_text())


@pytest.mark.slow
def test_all_standard_streams_are_closed(image: Path) -> None:
    """From the start of Python, which has none of them then."""
    output = image.parent / "a.svg"
    assert shell("$W <&- >&- 2>&-", "vectorize", image, "-o", output, "-vv", *QUICK).returncode == 0
    render_own(output.read_text())


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="names of bytes")
def test_control_characters_of_names_are_escaped(forks: Forks, tmp_path: Path) -> None:
    path = tmp_path / os.fsdecode(b"a\x1b[31m\n\xff.png")
    path.write_bytes(b"no image")
    code, _, err = forks.run(["vectorize", path.name, *QUICK], tmp_path)
    assert code == 3
    assert err.count("\n") == 1
    assert "a\\x1b[31m\\n\\udcff.png" in err
    Image.new("RGB", (9, 9)).save(path, "PNG")
    code, out, _ = forks.run(["vectorize", path.name, "-o", path.with_suffix(".svg").name, *QUICK], tmp_path)
    assert code == 0
    assert "\x1b" not in out
    assert "\\x1b[31m" in out


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

    monkeypatch.setattr("warpsplat.run.strategies.fit", fail)
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
