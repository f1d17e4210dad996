"""``python -m warpsplat``."""

from warpsplat.cli.main import main

main()
