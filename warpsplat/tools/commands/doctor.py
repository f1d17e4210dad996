"""``warpsplat doctor`` and ``warpsplat info``."""

from __future__ import annotations

import json
import sys
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.options import device_option, json_option
from warpsplat.errors import ExitCode


@click.command("doctor")
@device_option(default="auto", show_default=True, help="Where the self-test runs: auto, cpu, or cuda:N.")
@json_option
def command(device: str, as_json: bool) -> None:
    """Check that everything a run needs is installed and works.

    Checks versions, devices, memory and the kernel cache, and runs a
    self-test of some seconds (longer if kernels must be compiled). If
    anything is broken, a hint says what to do, and the exit code is 7.
    """
    from warpsplat.tools.doctor import checks

    found = []
    for check in checks(device):
        found.append(check)
        if not as_json:
            echo(f"{check.status.replace('broken', 'BROKEN'):7} {check.name}: {check.text}")
            if check.hint:
                echo(f"{'':7} -> {check.hint}")
    broken = [check.name for check in found if check.status == "broken"]
    if as_json:
        echo(json.dumps({"ok": not broken, "checks": [check.as_dict() for check in found]}))
    else:
        echo("broken: " + ", ".join(broken) if broken else "everything needed is installed and works")
    if broken:
        sys.exit(ExitCode.RESOURCES)


@click.command("info")
@json_option
def info(as_json: bool) -> None:
    """Show the version, the devices and the folder of compiled kernels; doctor checks them."""
    from warpsplat.tools.doctor import check_cache, check_devices, check_machine, check_packages, check_python

    python, packages, found = (check().values for check in (check_python, check_packages, check_devices))
    devices = [{"name": d["name"], "description": d["description"]} for d in found["devices"]]
    values: dict[str, Any] = {
        "warpsplat": python["warpsplat"],
        "warp": packages["versions"]["warp-lang"],
        "python": python["python"],
        "cpu_threads": check_machine().values["cpu_threads"],
        "devices": devices,
        "default_device": found["default_device"],
        "kernel_cache": check_cache().values["folder"],
    }
    if as_json:
        echo(json.dumps(values))
        return
    echo(f"warpsplat {values['warpsplat']}, Warp {values['warp']}, Python {values['python']}")
    for found in values["devices"]:
        mark = "  (default)" if found["name"] == values["default_device"] else ""
        echo(f"  {found['name']:8} {found['description']}{mark}")
    echo(f"  {values['cpu_threads']} CPU threads; compiled kernels in {values['kernel_cache']}")
