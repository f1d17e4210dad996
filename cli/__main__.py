"""``python -m warpsplat.cli``."""

from warpsplat.__main__ import main

main()
