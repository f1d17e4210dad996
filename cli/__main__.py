"""``python -m warpsplat.cli``."""

from warpsplat.cli.main import main

main()
