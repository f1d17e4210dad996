"""The command line as a whole: a light start, streams, exceptions, completion."""

from __future__ import annotations

import json
import logging
import os
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import QUICK, Cli, one_line, python
from tests.forks import CLOSED, Forks
from warpsplat.cli.echo import notices
from warpsplat.cli.main import COMMANDS, json_stream, report_error
from warpsplat.errors import CapacityError
from warpsplat.native import messages_hidden
from warpsplat.svg.viewer import render_own

FULL = "/dev/full"
HEAVY = {"warp", "torch", "cv2", "PIL", "resvg_py"}


COMPLETION = {
    "_WARPSPLAT_COMPLETE": "bash_complete",
    "COMP_WORDS": "warpsplat vectorize --qu",
    "COMP_CWORD": "2",
}


@pytest.mark.parametrize(
    ("arguments", "heavy", "environment", "words"),
    [
        (["--help"], {"numpy", *HEAVY}, {}, COMMANDS),
        ([], HEAVY, COMPLETION, ("plain,--quality", "plain,--quiet")),
    ],
)
def test_help_is_quick_and_heavy_libraries_stay_out(
    arguments: list[str], heavy: set[str], environment: dict[str, str], words: Iterable[str]
) -> None:
    """So does the completion of an option's name."""
    code = (
        f"import sys; from warpsplat.cli.main import main\ntry: main({arguments})\n"
        f"except SystemExit as e: assert not e.code\nassert not {heavy} & set(sys.modules)"
    )
    done = python("-c", code, **environment)
    assert done.returncode == 0, done.stderr
    shown = done.stdout.decode()
    assert all(word in shown for word in words) and "\\b" not in shown


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stdout", "stderr", "code"),
    [("out", CLOSED, 0), (CLOSED, "err", 0), (CLOSED, CLOSED, 0), ("out", FULL, 0), (FULL, "err", 4)],
)
def test_standard_streams_that_are_full_or_closed(
    forks: Forks, image: Path, stdout: str, stderr: str, code: int
) -> None:
    if FULL in (stdout, stderr) and not os.path.exists(FULL):
        pytest.skip("a device of Linux")
    output = image.parent / "a.svg"
    streams = [n if n in (CLOSED, FULL) else str(image.parent / n) for n in (stdout, stderr)]
    how = {"stdout": streams[0], "stderr": streams[1], "stdin": stdout if stdout == stderr else os.devnull}
    done, out, err = forks.run(
        ["vectorize", str(image), "-o", str(output), "-vv", *QUICK], image.parent, **how
    )
    assert done == code
    assert "Traceback" not in err
    assert ("a.svg: " in out) == (stdout == "out")
    render_own(output.read_text())
    assert forks.run(["eval", "none.png", str(output)], image.parent, **how)[0] == 3
    done, _, err = forks.run(["eval", str(image), str(output)], image.parent, **how)
    assert done == code
    assert len(err.splitlines()) == (code == 4)


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
def test_any_exception_is_one_line_and_an_exit_code(
    error: BaseException,
    code: int,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(type(error)):
        raise error  # which gives it a traceback
    assert report_error(error) == code
    assert words in one_line(capfd.readouterr().err)
    monkeypatch.setenv("WARPSPLAT_TRACEBACK", "1")
    assert report_error(error) == code
    assert "Traceback" in capfd.readouterr().err


def test_a_reader_that_has_gone(monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    def write(text: str, *, err: bool) -> None:
        if not err:
            raise BrokenPipeError
        print(text, file=sys.stderr)

    monkeypatch.setattr("warpsplat.cli.echo.click.echo", write)
    assert "standard output: closed by its reader" in cli("info", code=4).line


def test_an_image_without_a_command_is_vectorized(
    image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    monkeypatch.chdir(tmp_path)
    captured = cli(image.name, *QUICK)
    assert captured.out.startswith("photo.svg: ")
    assert "no command given, so it is vectorized (warpsplat vectorize photo.png)" in captured.err
    assert (tmp_path / "photo.svg").exists()


def test_json_and_a_file_use_different_streams(monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    captured = cli("vectorize", "missing.png", "-o", "-", "--json", code=3)
    assert captured.out == ""
    line, found = captured.err.splitlines()
    assert line == f"warpsplat: {json.loads(found)['error']}"
    assert json_stream(["vectorize", "-", "--output=-", "--json"]) == "stderr"
    assert json_stream(["vectorize", "--", "--json"]) is None
    assert json_stream(["vectorize", "a", "--json", "--", "-o", "-"]) == "stdout"


@pytest.mark.parametrize(
    ("terminal", "shown"), [(False, ""), (True, "\r\x1b[2Kwarpsplat: compiling: 3 s\r\x1b[2K")]
)
def test_temporary_messages_are_for_terminals(
    terminal: bool, shown: str, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Native code's messages are hidden meanwhile."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: terminal)
    with notices(), messages_hidden():
        for text in ("compiling: 3 s", ""):
            logging.getLogger("warpsplat").info(text, extra={"passing": True})
    assert capfd.readouterr().err == shown
