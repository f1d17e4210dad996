"""The packages of a wheel; all else is in pyproject.toml.

kernels/, cli/ and configs/ are packages of warpsplat, which has links to them. They are found where they lie:
a clone on Windows may have no links.
"""

from setuptools import find_packages, setup

setup(
    packages=sorted(
        {
            *find_packages(include=["warpsplat*"], exclude=["warpsplat.compare"]),  # which is for developers
            *(f"warpsplat.{name}" for name in find_packages(include=["kernels*", "cli*", "configs*"])),
        }
    )
)
