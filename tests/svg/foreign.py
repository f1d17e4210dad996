"""SVGs that others might have drawn, and how tests read them."""

from __future__ import annotations

from warpsplat.scene import Scene
from warpsplat.svg.read import load_kept

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" '


SMALL = HEAD + 'width="40" height="30">'
PATH = '<path d="M10 10H70V40Z"/>'
ROUND = 'fill="none" stroke="red" stroke-linecap="round" stroke-linejoin="round"'
FOREIGN = {
    "lines": 'width="40" height="30"><path d="M5 5H35V25L5 20Z" fill="#f00"/></svg>',
    "transform": 'width="40" height="30"><g transform="translate(4,2) scale(2)">'
    '<path d="M0 0l10 0q4 5 0 10z" style="fill:#0a0;fill-opacity:.5"/></g></svg>',
    "shapes": 'viewBox="0 0 80 60"><rect width="80" height="60" fill="#ddd"/>'
    '<circle cx="30" cy="30" r="20" fill="rgb(200,10,60)"/><ellipse cx="60" cy="20" rx="9" ry="5"/></svg>',
    "arc": 'width="40" height="30"><path d="M10 15A8 8 0 0 1 26 15zM3 3h5v5h-5" fill="#123456"/></svg>',
    "place": 'width="80" height="60" viewBox="10 0 20 30" preserveAspectRatio="xMinYMax">'
    '<circle cx="50%" cy="1e1" r="9"/></svg>',
}


def load_scene(text: str, width: int, height: int, name: str) -> tuple[Scene, bool]:
    """Return the scene of an SVG, in which nothing is kept as a picture, and whether it has a background."""
    read = load_kept(text, width, height, name, keep=False)
    return read.scene, read.has_background
