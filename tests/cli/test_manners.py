"""What a user meant but did not say, and errors for scripts."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.helpers import QUICK, one_line, run
from warpsplat.cli.main import json_stream


def test_an_image_without_a_command_is_vectorized(
    image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(image.name, *QUICK) == 0
    captured = capsys.readouterr()
    assert captured.out.startswith("photo.svg: ")
    assert "no command given, so it is vectorized (warpsplat vectorize photo.png)" in captured.err
    assert (tmp_path / "photo.svg").exists()


MEANT = [
    (["vectorise", "a.png"], "no such command or file: vectorise; did you mean vectorize?"),
    (["missing.png"], "no such command or file: missing.png; commands are vectorize, "),
    (["a.svg"], "a.svg: with which command? warpsplat render FILE.svg"),
    (["jobs.yml"], "jobs.yml: with which command? warpsplat batch FILE.yaml"),
    (["vectorize", "a.png", "--curve", "5"], "--curves"),
    (["--curves", "5", "a.png"], "(options follow a command: warpsplat vectorize IMAGE ...)"),
]


@pytest.mark.parametrize(("arguments", "words"), MEANT)
def test_what_is_not_understood_is_answered_with_what_may_be_meant(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.svg", "jobs.yml"):
        (tmp_path / name).write_text("")
    assert run(*arguments) == 2
    assert words in one_line(capsys.readouterr().err)


FAILING = [
    (["vectorize", "missing.png"], 3),
    (["vectorize", "missing.png", "--curves", "many"], 2),
    (["vectorize"], 2),
    (["refine", "missing.svg", "photo.png", "-o", "a.svg"], 3),
    (["eval", "photo.png", "missing.svg"], 3),
    (["batch", "missing.yaml"], 2),
    (["compare", "missing.png"], 2),
    (["bench", "--size", "1x1"], 2),
    (["info", "--frobnicate"], 2),
    (["doctor", "--frobnicate"], 2),
    (["nonsense"], 2),
]


@pytest.mark.parametrize(("arguments", "code"), FAILING)
def test_errors_are_json_where_it_is_asked_for(
    arguments: list[str],
    code: int,
    image: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(image.parent)
    assert run(*arguments, "--json") == code
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    assert found.keys() == {"error", "exit_code"}
    assert found["exit_code"] == code
    assert one_line(captured.err) == f"warpsplat: {found['error']}"


def test_an_interruption_is_one_as_well(
    image: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("warpsplat.run.strategies.fit", stop)
    assert run("vectorize", image, "-o", image.parent / "a.svg", "--json", *QUICK) == 130
    assert json.loads(capsys.readouterr().out) == {"error": "interrupted", "exit_code": 130}


def test_objects_keep_out_of_the_way_of_a_file(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("vectorize", "missing.png", "-o", "-", "--json") == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    line, found = captured.err.splitlines()
    assert line == f"warpsplat: {json.loads(found)['error']}"
    assert json_stream(["vectorize", "-", "--output=-", "--json"]) == "stderr"
    assert json_stream(["vectorize", "--", "--json"]) is None
    assert json_stream(["vectorize", "a", "--json", "--", "-o", "-"]) == "stdout"


@pytest.mark.parametrize(
    ("shell", "words"), [("bash", "plain,--quality"), ("zsh", "--quality"), ("fish", "--quality")]
)
def test_completion(
    shell: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_WARPSPLAT_COMPLETE", f"{shell}_source")
    if shell != "bash":  # whose version click asks for
        assert run() == 0
        assert "_warpsplat_completion" in capsys.readouterr().out
    last = "--qual" if shell == "fish" else "2"
    for name, value in {"COMPLETE": f"{shell}_complete"}.items():
        monkeypatch.setenv(f"_WARPSPLAT_{name}", value)
    monkeypatch.setenv("COMP_WORDS", "warpsplat vectorize --qual")
    monkeypatch.setenv("COMP_CWORD", last)
    assert run() == 0
    assert words in capsys.readouterr().out


def test_completion_imports_nothing_heavy() -> None:
    code = (
        "import sys; from warpsplat.cli.main import main\n"
        "try: main([])\n"
        "except SystemExit as e: assert not e.code\n"
        "heavy = {'warp', 'torch', 'cv2', 'PIL', 'resvg_py'} & set(sys.modules); assert not heavy, heavy"
    )
    asked = {
        "_WARPSPLAT_COMPLETE": "bash_complete",
        "COMP_WORDS": "warpsplat vectorize --qu",
        "COMP_CWORD": "2",
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | asked, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.decode().split() == ["plain,--quality", "plain,--quiet"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--size", "3"], "not a size: '3'"),
        (["--page", "b5"], "page must be one of"),
        (["--units", "ell"], "units must be one of"),
    ],
)
def test_a_size_that_is_none_is_found_before_any_work(
    options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("vectorize", "missing.png", *options) == 2
    assert words in one_line(capsys.readouterr().err)


def test_names_are_said_once(image: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("eval", image, image) == 3
    assert one_line(capsys.readouterr().err) == f"warpsplat: {image}: not an SVG"
