"""The text of an SVG: encodings, entities, nodes; hostile ones within bounds."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from tests.cli.helpers import run
from tests.svg.foreign import HEAD, PATH, SMALL
from warpsplat.errors import ImageError
from warpsplat.svg import inspect as inspect_module
from warpsplat.svg.inspect import inspect_svg, read_svg_text

ENCODED = {
    **{"utf-8-sig": "", "utf-16": "UTF-16", "utf-16-le": "UTF-16", "utf-16-be": "UTF-16"},
    **{"latin-1": "ISO-8859-1", "cp1252": "windows-1252"},
}


@pytest.mark.parametrize("codec", ENCODED)
@pytest.mark.parametrize("packed", [False, True])
def test_encodings(codec: str, packed: bool, tmp_path: Path) -> None:
    declaration = f'<?xml version="1.0" encoding="{ENCODED[codec]}"?>' if ENCODED[codec] else ""
    data = f"{declaration}{SMALL}<title>Größe</title>{PATH}</svg>".encode(codec)
    svg = tmp_path / "a.svg"
    svg.write_bytes(gzip.compress(data) if packed else data)
    text = read_svg_text(svg)
    assert "Größe" in text
    assert text.startswith('<?xml version="1.0" encoding="UTF-8"?>' if declaration else "<svg")
    assert run("render", svg, "-o", tmp_path / "a.png") == 0


@pytest.mark.parametrize("encoding", ["hex", "punycode", "none-such", "UTF-16", "unicode_escape"])
def test_unknown_encodings(encoding: str, tmp_path: Path) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(f'<?xml version="1.0" encoding="{encoding}"?>{SMALL}</svg>')
    with pytest.raises(ImageError, match=r"a\.svg: not an SVG"):
        read_svg_text(svg)


def test_a_packed_file_is_unpacked_within_bounds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inspect_module, "MAX_BYTES", 1 << 20)
    svg = tmp_path / "a.svgz"
    svg.write_bytes(gzip.compress(SMALL.encode() + bytes(50 << 20)))
    with pytest.raises(ImageError, match="larger than 1 MiB when unpacked"):
        read_svg_text(svg)


LAUGHS = "".join(f'<!ENTITY l{i} "{10 * f"&l{i - 1};"}">' for i in range(1, 12))


@pytest.mark.parametrize(
    ("entity", "body", "message"),
    [
        (f'l0 "ha">{LAUGHS[:-1]}', "<title>&l11;</title>", "expands to too much"),
        (f'a "{"a" * 50_000}"', f'<g id="{"&a;" * 50_000}"/>', "expands to too much"),
        (f'x SYSTEM "{Path(__file__).as_uri()}"', '<path d="&x;"/>', "cannot be rendered"),
    ],
    ids=["laughs", "square", "external"],
)
def test_entities_that_are_refused(entity: str, body: str, message: str) -> None:
    with pytest.raises(ImageError, match=message):
        inspect_svg(f"<!DOCTYPE svg [<!ENTITY {entity}>]>{SMALL}{body}</svg>")


SHAPES = (
    '<rect x="2" width="9" height="9"/><circle r="3"/><ellipse rx="3" ry="2"/><line x2="3" y2="3"/>'
    '<polyline points="0,0 3,3"/><polygon points="0,0 3,3 3,0"/><path d="M0 0h9v9z"/>'
)
GROUND = '<rect width="40" height="30" fill="red"/>'


@pytest.mark.parametrize(
    ("body", "paths", "nodes"),
    [
        (SHAPES, 7, 9),
        (GROUND + SHAPES, 7, 9),
        ('<rect width="100%" height="100%"/>' + SHAPES, 7, 9),
        (SHAPES + GROUND, 8, 10),
        (2 * GROUND + SHAPES, 8, 10),
        ('<rect width="40" height="29"/>' + SHAPES, 8, 10),
        ('<rect width="40" height="30" rx="5"/>' + SHAPES, 8, 10),
        (GROUND, 1, 1),
        (f'<defs><g id="a">{SHAPES}</g></defs><use href="#a"/><use href="#a" x="9"/>', 7, 9),
        (f'<clipPath id="c">{SHAPES}</clipPath><mask id="m">{SHAPES}</mask><path d="M0 0h9"/>', 1, 2),
        ("<text>a</text>", 0, 0),
        *(
            (f'<path d="{data}"/>', 1, nodes)
            for data, nodes in (
                ("m0 0a1 1 0 012 2 1 1 0 0 0 5 5", 3),
                ("M1e-1 2e-5L3 4", 2),
                ("z", 0),
                ("M0 0c1 1 2 2 3 3 1 1 2 2 3 3z", 3),
                ("M0,0L1-1.5.5,2H3V4Z", 5),
                ("m0 0a1 1 0 0 1 2 2q1 1 2 2t1 1", 4),
            )
        ),
    ],
)
def test_paths_and_nodes(body: str, paths: int, nodes: int) -> None:
    """Each path counts once, except a background, clips and masks."""
    facts = inspect_svg(f'{HEAD}width="40" height="30">{body}</svg>')
    assert (facts.paths, facts.nodes) == (paths, nodes)
    sized = f'{HEAD}width="4in" viewBox="0 0 40 30">{body}</svg>'
    assert (inspect_svg(sized).paths, inspect_svg(sized).nodes) == (paths, nodes)
