"""``warpsplat info``."""

from __future__ import annotations

import json
from typing import Any

import click

from warpsplat.cli.say import say


@click.command("info", context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(as_json: bool) -> None:
    """Show the version, the devices and where compiled kernels are kept."""
    import platform

    import warp as wp

    from warpsplat._version import __version__
    from warpsplat.rendering.backend import available_cores
    from warpsplat.rendering.device import choose_device, start_warp

    start_warp()
    values: dict[str, Any] = {
        "warpsplat": __version__,
        "warp": wp.__version__,
        "python": platform.python_version(),
        "cpu_threads": available_cores(),
        "devices": [{"name": str(d), "description": d.name} for d in wp.get_devices()],
        "default_device": str(choose_device("auto")),
        "kernel_cache": str(wp.config.kernel_cache_dir),
    }
    if as_json:
        say(json.dumps(values))
        return
    say(f"warpsplat {values['warpsplat']}, Warp {values['warp']}, Python {values['python']}")
    for found in values["devices"]:
        mark = "  (default)" if found["name"] == values["default_device"] else ""
        say(f"  {found['name']:8} {found['description']}{mark}")
    say(f"  {values['cpu_threads']} CPU threads; compiled kernels in {values['kernel_cache']}")
