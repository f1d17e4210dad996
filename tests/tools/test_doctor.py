"""``doctor`` finds and names what is broken; no failure stops the other checks."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
import warp as wp

from tests.cli.helpers import Cli
from warpsplat.rendering.renderer import Renderer
from warpsplat.tools import doctor


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
