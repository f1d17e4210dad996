"""``bench``, ``doctor``, ``info`` and ``--version``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
import warp as wp

from tests import ROOT, fake_cuda
from tests.cli.helpers import Cli, one_line
from warpsplat import __version__
from warpsplat.rendering.renderer import Renderer
from warpsplat.tools import doctor


def test_bench(cli: Cli) -> None:
    options = ("--curves", 6, "--size", "48x32", "--repeats", 2, "--threads", 2, "--device", "cpu")
    values = cli("bench", *options, "--json").values
    assert values["threads"] == 2
    assert values["pairs"] > 6
    assert set(values["stages"]) == {"outline", "bins", "forward", "loss", "backward", "update"}
    step = values["step"]
    assert 0 < step["low"] <= step["median"] <= step["high"]


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("renderer", ["exact", "splat"])
def test_bench_table(kind: str, renderer: str, cli: Cli) -> None:
    options = ("--curves", 4, "--size", "32x32", "--repeats", 1, "--kind", kind, "--renderer", renderer)
    shown = cli("bench", *options, "-v").out
    assert "megapixels/s" in shown
    assert "composite_backward" in shown


@pytest.mark.needs("torch")
def test_bench_through_torch(cli: Cli) -> None:
    options = ("--curves", 4, "--size", "32x32", "--repeats", 1, "--threads", 1, "--device", "cpu", "--torch")
    shown = cli("bench", *options).out
    assert "alternately, torch" in shown
    assert "through PyTorch" in shown


@pytest.mark.slow
@pytest.mark.needs("torch")
def test_bench_through_a_torch_without_cuda(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is said before anything is timed."""
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "")  # the test device knows nothing of that
    done = fake_cuda.run("-m", "warpsplat", "bench", "--size", "32x32", "--device", "cuda:0", "--torch")
    assert done.returncode == 2
    assert not done.stdout
    assert "cannot use cuda:0" in one_line(done.stderr)


@pytest.mark.parametrize("size", ["0x10", "1x1", "10", "16x", "99999x99999", "axb"])
def test_bench_refuses_odd_sizes(size: str, cli: Cli) -> None:
    assert "not a size" in cli("bench", "--size", size, code=2).line


def folder_with_a_copy(folder: Path) -> Path:
    """Return a folder from which warpsplat is imported as another copy."""
    (folder / "warpsplat").symlink_to(ROOT / "warpsplat")
    return folder


SMALL = ("--curves", 3, "--size", "32x32", "--repeats", 1, "--rounds", 2, "--threads", 1, "--device", "cpu")


def test_bench_against_another_copy(tmp_path: Path, cli: Cli) -> None:
    folder = folder_with_a_copy(tmp_path)
    lines = cli("bench", *SMALL, "--against", folder).out.splitlines()
    assert lines[2].startswith("other: warpsplat ") and lines[4].split()[0] == "step"
    assert lines[-1].startswith("a step of the other takes ")
    values = cli("bench", *SMALL, "--against", folder, "--json").values
    this, other = values["sides"]
    assert other["folder"] == str(folder)
    assert this["folder"] != other["folder"]
    assert this["versions"] == other["versions"]
    assert values["processor"]
    for name in ("step", "forward_backward", "backward"):
        ratio = values["ratios"][name]
        assert 0 < ratio["low"] <= ratio["median"] <= ratio["high"]
        times = [side["times"][name] for side in (this, other)]
        assert times[1]["low"] / times[0]["high"] <= ratio["high"] * 1.01


@pytest.mark.parametrize(
    ("other", "message"),
    [("nothing/like/it", "is no device"), (".", "no folder with a warpsplat"), ("cuda:77", "cuda:77")],
)
def test_bench_against_a_missing_copy_or_device(
    other: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    monkeypatch.chdir(tmp_path)
    assert message in cli("bench", *SMALL, "--against", other, code=2).line


def checked(cli: Cli, code: int) -> dict[str, dict[str, Any]]:
    """Run the command and return its checks by name."""
    found = cli("doctor", "--device", "cpu", "--json", code=code).values
    assert found["ok"] is (code == 0)
    return {check["name"]: check for check in found["checks"]}


@pytest.mark.usual_seed  # whose figure the self-test knows
def test_all_is_well(cli: Cli) -> None:
    found = checked(cli, 0)
    assert "broken" not in {check["status"] for check in found.values()}
    assert found["packages"]["versions"].keys() >= {"numpy", "warp-lang", "pillow"}
    assert "cpu" in [device["name"] for device in found["devices"]["devices"]]
    assert found["self-test"]["psnr"] == pytest.approx(doctor.KNOWN_PSNR, abs=doctor.PSNR_TOLERANCE)
    assert 0 < found["adjoint"]["difference"] < doctor.MAX_DIFFERENCE


def test_a_broken_package_and_wrong_kernels(monkeypatch: pytest.MonkeyPatch, cli: Cli) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    monkeypatch.setattr(Renderer, "backward", lambda self: None)
    monkeypatch.setattr(doctor, "check_run", lambda device: 1 / 0)
    lines = cli("doctor", "--device", "cpu", code=7).out.splitlines()
    broken = [line.split(":")[0] for line in lines if line.startswith("BROKEN")]
    assert broken == ["BROKEN  packages", "BROKEN  self-test", "BROKEN  adjoint"]
    assert next(line for line in lines if "pyyaml (" in line)
    assert lines[-1] == "broken: packages, self-test, adjoint"
    assert sum("-> " in line for line in lines) >= 2


def test_a_figure_that_is_wrong(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "KNOWN_PSNR", 40.0)
    assert doctor.check_run("cpu").status == "broken"


def test_a_kernel_cache_of_no_use(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path / "file" / "kernels"))
    found = doctor.check_cache()
    assert found.status == "broken"
    assert "WARP_CACHE_PATH" in found.hint
    (tmp_path / "wp_one").mkdir()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    found = doctor.check_cache()
    assert (found.status, found.values["modules"]) == ("ok", 1)


def test_an_unknown_device_is_found(cli: Cli) -> None:
    assert "BROKEN  self-test: unknown device 'cuda:99'" in cli("doctor", "--device", "cuda:99", code=7).out


def test_version(cli: Cli) -> None:
    assert __version__ in cli("--version").out


def test_info(cli: Cli) -> None:
    values = cli("info", "--json").values
    assert values["warpsplat"] == __version__
    assert "cpu" in [d["name"] for d in values["devices"]]
    assert "(default)" in cli("info").out
