"""Laid out as the source is; ``ROOT`` is the checkout."""

from pathlib import Path

ROOT = Path(__file__).parents[1]
