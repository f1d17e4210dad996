"""``python -m warpsplat``, and the ``warpsplat`` command."""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    # Until ``main`` can answer, Ctrl-C ends the process as it ends any other: without a traceback of imports.
    signal.signal(signal.SIGINT, signal.SIG_DFL)

from warpsplat.cli.main import main

__all__ = ["main"]

if __name__ == "__main__":
    main()
