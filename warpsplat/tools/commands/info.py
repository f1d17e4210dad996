"""``warpsplat info``."""

from __future__ import annotations

import json
from typing import Any

import click

from warpsplat.cli.echo import echo


@click.command("info", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(as_json: bool) -> None:
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
