"""``warpsplat doctor``."""

from __future__ import annotations

import json
import sys

import click

from warpsplat.cli.echo import echo
from warpsplat.errors import ExitCode

MARKS = {"ok": "ok", "note": "note", "broken": "BROKEN"}


@click.command("doctor", context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--device", default="auto", show_default=True, help="Where the self-test runs: auto, cpu, or cuda:N."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
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
            echo(f"{MARKS[check.status]:7} {check.name}: {check.text}")
            if check.hint:
                echo(f"{'':7} -> {check.hint}")
    broken = [check.name for check in found if check.status == "broken"]
    if as_json:
        echo(json.dumps({"ok": not broken, "checks": [check.as_dict() for check in found]}))
    else:
        echo("broken: " + ", ".join(broken) if broken else "everything needed is installed and works")
    if broken:
        sys.exit(ExitCode.RESOURCES)
