"""SVGs that hypothesis makes up, of features that ``refine`` holds and of such as it cannot."""

from __future__ import annotations

from hypothesis import strategies as st

from tests.fuzz.vocabulary import CLAIMS_OF_FILLS, CLAIMS_OF_STROKES, GROUPS, HEAD, PAINTS

numbers = st.integers(-4, 36).map(str)
sizes = st.integers(1, 20).map(str)
flags = st.sampled_from("01")
points = st.tuples(numbers, numbers).map(" ".join)


def _command(letter: str, *arguments: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    return st.tuples(*arguments).map(lambda a: letter + " ".join(a))


curves = st.one_of(
    _command("L", points),
    _command("C", points, points, points),
    _command("s", points, points),
    _command("Q", points, points),
    _command("T", points),
    _command("A", sizes, sizes, numbers, flags, flags, points),
    _command("h", numbers),
    _command("z"),
)
outlines = st.tuples(points, st.lists(curves, min_size=1, max_size=5)).map(
    lambda p: f"M{p[0]}" + "".join(p[1])
)
elements = st.one_of(
    st.lists(outlines, min_size=1, max_size=2).map(lambda d: f'<path d="{"".join(d)}"'),
    st.tuples(numbers, numbers, sizes, sizes, sizes).map(
        lambda r: f'<rect x="{r[0]}" y="{r[1]}" width="{r[2]}" height="{r[3]}" rx="{r[4]}"'
    ),
    st.tuples(numbers, numbers, sizes).map(lambda c: f'<circle cx="{c[0]}" cy="{c[1]}" r="{c[2]}"'),
    st.lists(points, min_size=3, max_size=5).map(lambda p: f'<polygon points="{" ".join(p)}"'),
)
paints = st.sampled_from(PAINTS)
filled = st.tuples(elements, paints, st.sampled_from(CLAIMS_OF_FILLS)).map(
    lambda e: f'{e[0]} fill="{e[1]}" {e[2]}/>'
)
stroked = st.tuples(elements, paints, st.sampled_from(CLAIMS_OF_STROKES)).map(
    lambda e: f'{e[0]} fill="none" stroke="{e[1]}" {e[2]}/>'
)


def _drawing(group: str, shapes: list[str]) -> str:
    name = group.strip("<>").split()[0]
    return f"{HEAD}{group}{''.join(shapes)}</{name}></svg>"


drawings = st.builds(
    _drawing,
    st.sampled_from(GROUPS),
    st.lists(filled, min_size=1, max_size=4) | st.lists(stroked, min_size=1, max_size=4),
)
"""A few shapes in one group."""
