"""The program on the test device breaks no rule, and its bytes are those of a CPU with a GPU's lanes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from tests import ROOT, fake_cuda, needs
from tests.golden.cases import CASES, digest_of, text_of
from tests.lanes import divide_as_on_gpu

pytestmark = [pytest.mark.slow, needs.WHOLE]

CHOSEN = [*CASES][::4]
"""``python -m tests.fake_cuda -m tests.golden --device cuda:0`` makes all."""

SMALL = ["--curves", "6", "--iterations", "30", "--subject", "photo"]


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo.png"
    with Image.open(ROOT / "docs/images/cat.jpg") as image:
        image.convert("RGB").resize((48, 32)).save(path)
    return path


def warpsplat(*arguments: object, folder: Path, **options: object) -> str:
    """Run the command; return what it prints."""
    done = fake_cuda.run("-m", "warpsplat", *map(str, arguments), cwd=folder, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_golden_files(monkeypatch: pytest.MonkeyPatch) -> None:
    made = fake_cuda.run("-m", "tests.golden", "--device", "cuda:0", *CHOSEN, cwd=ROOT)
    digests = {name: digest for line in made.stdout.splitlines() for name, digest in json.loads(line).items()}
    divide_as_on_gpu(monkeypatch)
    assert digests == {name: digest_of(text_of(name)) for name in CHOSEN}


def test_tensors_of_pytorch() -> None:
    programs = ("-m", "tests.fake_cuda.torch_programs")
    found = {kind: fake_cuda.run(*programs, kind, cwd=ROOT) for kind in ("cpu", "cuda", "side")}
    assert found["cpu"].stdout
    for kind in ("cuda", "side"):
        assert found[kind].stdout == found["cpu"].stdout, found[kind].stderr


STOPPED = """
import sys
from tests import lanes
import pytest, warpsplat
lanes.divide_as_on_gpu(pytest.MonkeyPatch())
image, device, checkpoint, stop = sys.argv[1:]
calls = iter(range(int(stop)))
result = warpsplat.vectorize(
    image, device=device, curves=6, iterations=40, subject="photo", checkpoint=checkpoint, resume=True,
    stop=lambda: next(calls, None) is None,
)
print(result.svg)
"""
"""A program that continues a run, and stops it after some steps; on a CPU as a GPU divides."""


SERVED = """
from tests.pages.serve.helpers import Visitor, picture
with Visitor(device="cuda:0") as visitor:
    settings = {"curves": 4, "subject": "photo", "quality": "draft"}
    run = visitor.over(visitor.begin(visitor.upload(picture()), **settings))
    print(run["state"])
"""


def test_a_run_of_the_page(tmp_path: Path) -> None:
    done = fake_cuda.run("-c", SERVED, cwd=tmp_path)
    assert done.stdout == "done\n", done.stderr


@pytest.mark.parametrize("devices", [("cpu", "cuda:0"), ("cuda:0", "cpu")])
def test_a_checkpoint_goes_from_device_to_device(photo: Path, devices: tuple[str, str]) -> None:
    first, second = devices
    fake_cuda.run("-c", STOPPED, str(photo), first, "run.checkpoint", "15", cwd=photo.parent)
    assert (photo.parent / "run.checkpoint").exists()
    continued = fake_cuda.run("-c", STOPPED, str(photo), second, "run.checkpoint", "9999", cwd=photo.parent)
    whole = fake_cuda.run("-c", STOPPED, str(photo), "cpu", "other.checkpoint", "9999", cwd=photo.parent)
    assert continued.stdout == whole.stdout != ""


def test_a_batch_on_two_devices(photo: Path) -> None:
    folder = photo.parent
    for name in ("a", "b", "c"):
        photo.with_name(f"{name}.png").write_bytes(photo.read_bytes())
    photo.unlink()
    for device in ("cuda:0", "cuda:1"):
        arguments = ("batch", ".", *SMALL, "-o", device[-1], "--device", device, "--workers", 2)
        warpsplat(*arguments, folder=folder, devices=2)
    made = [path.read_bytes() for path in sorted(folder.glob("[01]/*.svg"))]
    assert len(made) == 6
    assert len(set(made)) == 1


def test_commands(photo: Path) -> None:
    """Those that use a device, one after the other in one process."""
    folder, device = photo.parent, ["--device", "cuda:0"]
    commands = [
        ["vectorize", "photo.png", *SMALL, "-o", "photo.svg", *device, "--animate", "photo.gif"],
        ["refine", "photo.svg", "photo.png", "--iterations", "20", "-o", "refined.svg", *device],
        ["render", "refined.svg", "-o", "refined.png"],
        ["eval", "photo.png", "refined.svg"],
        ["bench", "--size", "48x32", "--curves", "6", "--repeats", "2", *device],
        ["doctor"],
    ]
    program = f"""
from warpsplat.cli.main import cli
for arguments in {commands}:
    cli.main(arguments, standalone_mode=False)
"""
    done = fake_cuda.run("-c", program, cwd=folder)
    assert done.returncode == 0, done.stderr
