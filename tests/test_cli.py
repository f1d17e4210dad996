"""The command line as a user meets it: exit codes, messages, files."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.test_image import bad_files
from warpsplat import __version__
from warpsplat.cli.main import main
from warpsplat.cli.run import _quality, time_left
from warpsplat.errors import CapacityError
from warpsplat.fit.loop import Progress
from warpsplat.fit.settings import make_settings
from warpsplat.jobs.vectorize import vectorize
from warpsplat.metrics import psnr
from warpsplat.render.backend import THREADS_PER_CORE, Backend, available_cores
from warpsplat.svg.viewer import on_white, render_svg

QUICK = ["--curves", "8", "--iterations", "12", "--device", "cpu"]


@pytest.fixture
def image(tmp_path: Path) -> Path:
    path = tmp_path / "photo.png"
    y, x = np.mgrid[:40, :60]
    Image.fromarray(np.stack([4 * x, 6 * y, 0 * x + 90], axis=2).astype(np.uint8)).save(path)
    return path


def run(*arguments: object) -> int:
    """Exit code of the command line in this process."""
    with pytest.raises(SystemExit) as caught:
        main([str(a) for a in arguments])
    return int(caught.value.code or 0)


def one_line(text: str) -> str:
    lines = text.strip().splitlines()
    assert len(lines) == 1, text
    assert "Traceback" not in text
    return lines[0]


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


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    assert __version__ in capsys.readouterr().out


def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert values["warpsplat"] == __version__
    assert "cpu" in [d["name"] for d in values["devices"]]
    assert run("info") == 0
    assert "(default)" in capsys.readouterr().out


@pytest.mark.parametrize("kind", ["--closed", "--open"])
def test_vectorize(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str) -> None:
    output = tmp_path / "out.svg"
    assert run("vectorize", image, "-o", output, kind, "--json", *QUICK) == 0
    values = json.loads(capsys.readouterr().out)
    assert values["paths"] == 8
    assert values["bytes"] == output.stat().st_size
    shown = on_white(render_svg(output.read_text()))
    assert values["psnr"] == pytest.approx(psnr(shown, on_white(Image.open(image))), abs=0.01)


def test_summary_and_default_output(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run("vectorize", image, *QUICK) == 0
    assert (tmp_path / "photo.svg").exists()
    captured = capsys.readouterr()
    assert re.fullmatch(r"photo\.svg: \d+\.\d\d dB, SSIM 0\.\d{3}, 8 paths, .* s\n", captured.out)
    assert captured.err == "", "no progress bar where stderr is no terminal"


def test_bad_images(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, path in bad_files(tmp_path).items():
        before = set(os.listdir(tmp_path))
        assert run("vectorize", path, "-o", tmp_path / "out.svg", *QUICK) == 3, name
        captured = capsys.readouterr()
        assert captured.out == ""
        assert str(path) in one_line(captured.err)
        assert set(os.listdir(tmp_path)) == before


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


def test_the_image_is_not_overwritten(image: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = image.read_bytes()
    assert run("vectorize", image, "-o", image, *QUICK) == 2
    assert "is the input itself" in one_line(capsys.readouterr().err)
    assert image.read_bytes() == before


def test_a_full_disk_is_one_line(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", fail)
    assert run("vectorize", image, "-o", tmp_path / "a.svg", *QUICK) == 4
    assert "No space left on device" in one_line(capsys.readouterr().err)
    assert os.listdir(tmp_path) == ["photo.png"]


def test_ctrl_c_writes_the_best_so_far(image: Path, tmp_path: Path) -> None:
    """In a terminal: the progress bar shows, Ctrl-C ends the run, the file is there and valid."""
    output = tmp_path / "a.svg"
    command = [sys.executable, "-m", "warpsplat", "vectorize", str(image), "-o", str(output)]
    primary, secondary = pty.openpty()
    process = subprocess.Popen(
        [*command, "--curves", "8", "--iterations", "900000", "--device", "cpu"],
        stdout=subprocess.PIPE,
        stderr=secondary,
        text=True,
    )
    os.close(secondary)
    shown = b""
    deadline = time.monotonic() + 120
    while b"dB" not in shown and time.monotonic() < deadline:
        shown += os.read(primary, 1000)
    assert b"photo.png" in shown
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    os.close(primary)
    assert process.returncode == 130
    assert "stopped after" in out
    render_svg(output.read_text())


def test_missed_goals_are_said_and_the_file_is_written(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "a.svg"
    assert run("vectorize", image, "-o", output, *QUICK, "--target-psnr", "90") == 6
    captured = capsys.readouterr()
    assert "a.svg: " in captured.out
    assert "goal missed: target-psnr 90 dB" in one_line(captured.err)
    render_svg(output.read_text())
    for option, value in (("--time-budget", "soon"), ("--max-bytes", "-1"), ("--target-psnr", "-3")):
        assert run("vectorize", image, "-o", output, option, value) == 2
        assert "Traceback" not in capsys.readouterr().err


def test_eval(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "a.svg"
    assert run("vectorize", image, "-o", output, "--json", *QUICK) == 0
    made = json.loads(capsys.readouterr().out)
    assert run("eval", image, output, "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert all(
        values[k] == made[k] for k in ("psnr", "ssim", "ms_ssim", "paths", "nodes", "bytes", "gzip_bytes")
    )
    assert run("eval", image, output) == 0
    assert f"{made['psnr']} dB" in capsys.readouterr().out
    for bad in (image, tmp_path / "none.svg"):
        assert run("eval", image, bad) == 3
        assert bad.name in one_line(capsys.readouterr().err)


def test_render(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, png = tmp_path / "a.svg", tmp_path / "a.png"
    assert run("vectorize", image, "-o", svg, "-q", *QUICK) == 0
    assert run("render", svg, "-o", png, "--scale", "2.5") == 0
    with Image.open(png) as picture:
        assert picture.size == (150, 100)
    assert capsys.readouterr() == ("", "")


def test_render_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = tmp_path / "good.svg"
    good.write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 4 2"/>')
    (tmp_path / "binary.svg").write_bytes(bytes(range(256)))
    (tmp_path / "text.svg").write_text("hello")
    for name in ("binary.svg", "text.svg", "missing.svg", "."):
        assert run("render", tmp_path / name, "-o", tmp_path / "a.png") == 3
        assert name.strip(".") in one_line(capsys.readouterr().err)
    for scale in ("0", "-1", "nan", "1e9"):
        assert run("render", good, "-o", tmp_path / "a.png", "--scale", scale) == 2
        assert "scale" in one_line(capsys.readouterr().err)
    assert not (tmp_path / "a.png").exists()


def test_render_takes_any_svg(tmp_path: Path) -> None:
    foreign = tmp_path / "a.svg"
    foreign.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 5">'
        '<circle cx="5" cy="2" r="2" fill="red"/></svg>'
    )
    assert run("render", foreign, "-o", tmp_path / "a.png", "--scale", "4") == 0
    picture = Image.open(io.BytesIO((tmp_path / "a.png").read_bytes())).convert("RGBA")
    assert picture.size == (40, 20)
    assert picture.getpixel((20, 8)) == (255, 0, 0, 255)


def test_inputs_are_never_outputs(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg = tmp_path / "a.svg"
    assert run("vectorize", image, "-o", svg, "-q", *QUICK) == 0
    kept = {p: p.read_bytes() for p in (image, svg)}
    assert run("render", svg, "-o", svg) == 2
    assert run("refine", svg, image, "-o", image, "--iterations", "5") == 2
    assert run("vectorize", image, "-o", os.devnull, *QUICK) == 2
    assert "is a device" in capsys.readouterr().err
    assert kept == {p: p.read_bytes() for p in (image, svg)}


def test_a_link_stays_a_link(image: Path, tmp_path: Path) -> None:
    real, link = tmp_path / "real.svg", tmp_path / "link.svg"
    link.symlink_to(real)
    assert run("vectorize", image, "-o", link, "-q", *QUICK) == 0
    assert link.is_symlink()
    assert real.read_text().startswith("<svg")


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
    (["refine", "gradient.svg", "photo.png", "-o", "b.svg"], 3),
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
        "gradient.svg": f'width="60" height="40">{path}fill="url(#g)"/></svg>',
        "clip.svg": f'width="60" height="40"><g clip-path="url(#c)">{path}/></g></svg>',
        "opacity.svg": f'width="60" height="40">{path}opacity=".5em"/></svg>',
    }
    for name, text in files.items():
        (image.parent / name).write_text(head + text)
    monkeypatch.chdir(image.parent)
    before = set(os.listdir())
    assert run(*arguments) == code
    one_line(capsys.readouterr().err)
    assert set(os.listdir()) == before


def test_physical_units(tmp_path: Path) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="1in" height="48px"/>')
    assert run("render", svg, "-o", tmp_path / "a.png") == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (96, 48)


def test_bench(capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--curves", 6, "--size", "48x32", "--repeats", 2, "--threads", 2, "--device", "cpu")
    assert run("bench", *options, "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert values["threads"] == 2
    assert values["pairs"] > 6
    assert set(values["stages"]) == {"outline", "bins", "forward", "loss", "backward", "update"}
    step = values["step"]
    assert 0 < step["low"] <= step["median"] <= step["high"]


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("renderer", ["exact", "splat"])
def test_bench_for_people(kind: str, renderer: str, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--curves", 4, "--size", "32x32", "--repeats", 1, "--kind", kind, "--renderer", renderer)
    assert run("bench", *options, "-v") == 0
    shown = capsys.readouterr().out
    assert "megapixels/s" in shown
    assert "composite_backward" in shown


@pytest.mark.parametrize("size", ["0x10", "10", "16x", "99999x99999", "axb"])
def test_bench_refuses_odd_sizes(size: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("bench", "--size", size) == 2
    assert "not a size" in one_line(capsys.readouterr().err)


def test_the_number_of_threads_changes_nothing(image: Path, tmp_path: Path) -> None:
    made = []
    for threads in (1, 3):
        output = tmp_path / f"{threads}.svg"
        assert run("vectorize", image, "-o", output, *QUICK, "--iterations", 60, "--threads", threads) == 0
        made.append(output.read_bytes())
    assert made[0] == made[1]


def test_threads_must_be_positive(image: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("vectorize", image, "--threads", 0) == 2
    assert "--threads" in one_line(capsys.readouterr().err)


def test_a_file_of_others_is_replaced_with_overwrite_only(
    image: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(image.parent)
    drawn = Path("photo.svg")
    drawn.write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    before = drawn.read_bytes()
    assert run("vectorize", image, *QUICK) == 2
    assert "photo.svg: exists and was not written by warpsplat" in one_line(capsys.readouterr().err)
    assert drawn.read_bytes() == before
    assert run("vectorize", image, "--overwrite", *QUICK) == 0
    assert run("vectorize", image, *QUICK) == 0


@pytest.mark.parametrize("name", ["a.png", "a.txt", "a", "a.svgz"])
def test_an_output_is_what_its_name_says(image: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert run("vectorize", image, "-o", image.parent / name, *QUICK) == 2
    assert ".svg" in one_line(capsys.readouterr().err)
    assert os.listdir(image.parent) == ["photo.png"]


def shell(
    script: str, *arguments: object, given: bytes = b"", **environment: str
) -> subprocess.CompletedProcess[bytes]:
    """Run ``warpsplat`` as a shell does; ``$W`` is the program with the arguments."""
    command = shlex.join([sys.executable, "-m", "warpsplat", *map(str, arguments)])
    return subprocess.run(
        ["sh", "-c", script.replace("$W", command)],
        input=given,
        capture_output=True,
        timeout=120,
        check=False,
        env=os.environ | environment,
    )


def test_standard_input_and_output(image: Path, capsys: pytest.CaptureFixture[str]) -> None:
    direct = image.parent / "a.svg"
    assert run("vectorize", image, "-o", direct, "-q", *QUICK) == 0
    piped = shell("cd / && $W", "vectorize", "-", "-o", "-", "--json", *QUICK, given=image.read_bytes())
    assert piped.returncode == 0
    assert piped.stdout == direct.read_bytes()
    assert json.loads(piped.stderr)["bytes"] == len(piped.stdout)
    assert run("vectorize", "-", *QUICK) == 2
    assert "give -o" in one_line(capsys.readouterr().err)
    assert not os.path.exists("-")


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
    render_svg(output.read_text())


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


@pytest.mark.skipif(os.name != "posix", reason="limits of POSIX")
def test_a_limit_of_file_size_is_a_failure_to_write(image: Path) -> None:
    run_it = ("vectorize", image, "-o", image.parent / "a.svg", "--curves", 200, "--iterations", 2)
    done = shell("ulimit -f 1; $W", *run_it, "--device", "cpu")
    assert done.returncode == 4
    assert b"File too large" in done.stderr
    assert done.stderr.count(b"\n") == 1


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

    monkeypatch.setattr("warpsplat.jobs.vectorize.fit", fail)
    assert run("vectorize", image, "-o", image.parent / "a.svg", *QUICK) == code
    assert words in one_line(capsys.readouterr().err)
    monkeypatch.setenv("WARPSPLAT_TRACEBACK", "1")
    assert run("vectorize", image, "-o", image.parent / "a.svg", *QUICK) == code
    assert "Traceback" in capsys.readouterr().err


def test_many_threads_are_bounded(image: Path) -> None:
    assert run("vectorize", image, "-o", image.parent / "a.svg", "--threads", 10**6, *QUICK) == 0
    assert threading.active_count() <= 1 + 2 * THREADS_PER_CORE * available_cores()


def test_the_bar_weighs_steps_and_shows_no_decibels_that_fall(image: Path) -> None:
    """Coarse steps are cheap and their decibels are a reduced image's."""
    settings = make_settings(curves=6, iterations=100, coarse=0.5, coarse_pixels=600)
    seen: list[Progress] = []
    target = np.full((40, 60, 3), 0.5, np.float32)
    vectorize(target, settings, Backend.on("cpu"), report=seen.append)
    assert [p.fine for p in seen] == [False] * 5 + [True] * 5
    coarse, fine = 600, 2400
    assert seen[4].work == pytest.approx(coarse / (coarse + fine), abs=0.01)
    assert seen[-1].work == 1
    first = replace(seen[0], seconds=30.0)  # kernels were compiled before
    said = time_left(first, replace(seen[4], seconds=30.0 + 4))
    assert said == 20, (
        "four blocks of coarse steps took 4 s, each of the five fine ones costs four times as much"
    )
    assert time_left(first, first) is None
    assert "dB" not in _quality(seen[4])
    assert "dB" in _quality(seen[5])


def test_compiling_is_said_on_a_terminal_or_with_v(image: Path, tmp_path: Path) -> None:
    options = ("vectorize", image, "-o", image.parent / "a.svg", *QUICK, "--iterations", 1)
    code = "import warp; warp.load_module = lambda *_, **__: exit(9)\n"
    code += f"from warpsplat.cli.main import main; main({[str(o) for o in options]!r} + ARGS)"
    for arguments, said in (([], False), (["-v"], True)):
        done = subprocess.run(
            [sys.executable, "-c", code.replace("ARGS", repr(arguments))],
            env=os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 9
        assert ("compiling kernels" in done.stderr) is said
