"""The command ``warpsplat serve``."""

from __future__ import annotations

import contextlib
import threading
import webbrowser

import click

from warpsplat.cli.echo import echo, set_verbosity
from warpsplat.cli.options import device_option, threads_option
from warpsplat.cli.signals import Interrupt
from warpsplat.errors import UsageError
from warpsplat.pages.serve.runs import Limits


@click.command("serve")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=8765,
    show_default=True,
    metavar="N",
    help="Port to listen on; 0: any that is free.",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Address to listen on; other machines can reach any but 127.0.0.1 and ::1.",
)
@click.option("--open", "opens", is_flag=True, help="Open the page in a browser.")
@click.option(
    "--max-upload",
    default=f"{Limits.upload // 10**6}MB",
    show_default=True,
    metavar="SIZE",
    help="Largest file that is accepted.",
)
@click.option(
    "--max-memory",
    metavar="SIZE",
    help="Memory limit of a run, such as 4GB: larger images are processed at a smaller size.",
)
@device_option(default="auto", show_default=True)
@threads_option
def command(
    port: int,
    host: str,
    opens: bool,
    max_upload: str,
    max_memory: str | None,
    device: str,
    threads: int | None,
) -> None:
    """Serve a page to vectorize images in a browser, until Ctrl-C.

    Drop an image on it, see a draft at once and the result soon after, choose
    a preset or settings, compare results side by side and save them as SVG,
    PNG, PDF, DXF or EPS. Nothing leaves this machine or is stored: images and
    results are kept in memory only.
    """
    interrupt = Interrupt()
    from warpsplat.fit.options import parse_bytes
    from warpsplat.rendering.device import choose_device, start_warp

    try:
        from warpsplat.pages.serve.server import WarpsplatServer, is_loopback
    except ModuleNotFoundError as error:
        raise UsageError(f'serve: {error}; pip install "warpsplat[serve]" installs it') from error
    from warpsplat.pages.serve.worker import Machine
    from warpsplat.run.options import settings_from

    limits = Limits(upload=parse_bytes(max_upload))
    settings_from({"max_memory": max_memory})  # reports errors now
    start_warp()
    choose_device(device)
    server = WarpsplatServer(host, port, Machine(device, threads, max_memory), limits)
    if not is_loopback(host):
        risk = "others can reach it, and anyone with the address can use it; it is not encrypted"
        echo(f"warpsplat: --host {host}: {risk}", err=True)
    set_verbosity(quiet=False)  # the page shows compilation too

    def ready() -> None:
        echo(f"warpsplat: {server.address()} (Ctrl-C ends it)")
        if opens:
            # Terminal browsers return only when they are closed.
            threading.Thread(target=webbrowser.open, args=[server.ticket()], daemon=True).start()

    with contextlib.closing(server), interrupt.watching():
        server.run(interrupt, ready)
