"""Example job files for ``warpsplat batch``."""
