"""What is made from the table of options: ``warpsplat/run/typed.py`` and the tables of docs/settings.md.

python docs/option_tables.py      # writes the former, after a change in fit/settings.py
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from warpsplat.fit.options import Option, options_of
from warpsplat.fit.settings import Density, Settings, make_settings
from warpsplat.run.options import OPTIONS

TYPED = Path(__file__).parents[1] / "warpsplat" / "run" / "typed.py"

HEAD = '''"""Keywords of ``vectorize`` and others; made by ``python docs/option_tables.py``, not by hand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypedDict

from warpsplat.fit.settings import Painting, Quality, Subject


class RefineOptions(TypedDict, total=False):
    """Options that ``refine`` shares with ``vectorize``. One that is None counts as not given."""

%s

class Options(RefineOptions, total=False):
    """The options of the command line, with ``_`` for ``-``: these, and those of ``RefineOptions``."""

%s'''


def typed_options() -> str:
    """Return the source of both: all but the number of shapes, which functions take by itself."""
    shared, others = (
        "".join(
            f'    {option.keyword}: {annotation(option)} | None\n    """{option.help}"""\n'
            for option in OPTIONS[1:]
            if option.refine == refine
        )
        for refine in (True, False)
    )
    return HEAD % (shared, others)


def annotation(option: Option) -> str:
    """Return the type of an option's values as users write them."""
    written = {**Settings.__annotations__, **make_settings.__annotations__}.get(option.keyword, "bool")
    written = written.removesuffix(" | None").replace("tuple[", "Sequence[").replace(", ...]", "]")
    return f"{written} | str" if option.parse else written


def table(name: str) -> str:
    """Return a table in Markdown: of the ``options``, or of what is for ``research``."""
    return "\n".join(option_rows() if name == "options" else research_rows())


def option_rows() -> Iterator[str]:
    """Yield the lines of the table of options."""
    yield from ("| option | meaning | default |", "|---|---|---|")
    for option in OPTIONS:
        choices = f' <code class="choices">{", ".join(option.choices)}</code>' if option.choices else ""
        name = f"<code>{f'--{option.name} {option.metavar}'.strip()}</code>{choices}"
        limits = (
            f"From {option.limits[0]:,} to {option.limits[1]:,}."
            if option.type is int and option.limits
            else ""
        )
        yield f"| {name} | {option.help} {limits} {option.details} | {option.default_text} |"


def research_rows() -> Iterator[str]:
    """Yield the lines of the table of keys for researchers, those of mappings last."""
    yield from ("| key | values | meaning | default |", "|---|---|---|---|")
    rows = [("", option) for option in options_of(Settings) if option.research]
    for prefix, option in [*rows, *(("density.", option) for option in options_of(Density))]:
        default = f"{option.default:g}" if option.type is float else option.default_text.lower()
        yield f"| `{prefix}{option.name}` | {option.accepts} | {option.help} | {default} |"


if __name__ == "__main__":
    TYPED.write_text(typed_options(), encoding="utf-8")
