"""What is made from the table of options: ``warpsplat/run/typed.py`` and the tables of docs/settings.md.

python docs/option_tables.py      # writes the former, after a change in fit/settings.py
"""

from __future__ import annotations

from pathlib import Path

from warpsplat.fit.options import GROUPS, Option, options_of
from warpsplat.fit.settings import Density, Settings, make_settings
from warpsplat.run.options import OPTIONS

TYPED = Path(__file__).parents[1] / "warpsplat" / "run" / "typed.py"

HEAD = '''"""Keywords of ``vectorize`` and others; made by ``python docs/option_tables.py``, not by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict

from warpsplat.fit.custom_loss import CustomLoss, LossFunction
from warpsplat.fit.settings import (
    DxfCurves,
    LossName,
    Painting,
    Quality,
    Removal,
    Stack,
    Subject,
)


class RefineOptions(TypedDict, total=False):
    """Options that ``refine`` shares with ``vectorize``. One that is None counts as not given."""

%s

class Options(RefineOptions, total=False):
    """The options of the command line, with ``_`` for ``-``: these, and those of ``RefineOptions``.

    The documentation's table explains them.
    """

    preset: str | None
%s'''


def typed_options() -> str:
    """Return the source of both: all but the number of shapes, which functions take by itself."""
    shared, others = (
        "".join(f"    {o.keyword}: {annotation(o)} | None\n" for o in OPTIONS[1:] if o.refine == refine)
        for refine in (True, False)
    )
    return HEAD % (shared, others)


def annotation(option: Option) -> str:
    """Return the type of an option's values as users write them."""
    if option.name == "optics":  # or those of a report
        return "Mapping[str, object] | str"
    if option.name == "loss":  # or a function
        return "LossName | LossFunction | CustomLoss"
    written = {**Settings.__annotations__, **make_settings.__annotations__}.get(option.keyword, "bool")
    written = written.removesuffix(" | None").replace("tuple[", "Sequence[").replace(", ...]", "]")
    return f"{written} | str" if option.parse and written != "str" else written


def tables(name: str) -> str:
    """Return tables in Markdown: of the ``options``, in groups, or of what is for ``research``."""
    if name == "options":
        flags = [(f"--{each.name} {each.metavar}".strip(), each) for each in OPTIONS]
        grouped = [(group, [one for one in flags if one[1].group == group]) for group in GROUPS]
        return "\n\n".join(f"### {group}\n\n{table(named)}" for group, named in grouped if named)
    named = [(each.name, each) for each in options_of(Settings) if each.research]
    return table([*named, *((f"density.{each.name}", each) for each in options_of(Density))])


def table(named: list[tuple[str, Option]]) -> str:
    """Return a table of options and what they are called."""
    lines = ["| option | values | meaning | default |", "|---|---|---|---|"]
    for called, each in named:
        values = each.accepts if each.choices or each.limits or each.wanted else ""
        default = f"{each.default:g}" if isinstance(each.default, float) else each.default_text
        lines.append(f"| <code>{called}</code> | {values} | {each.help} | {default} |")
    return "\n".join(lines)


if __name__ == "__main__":
    TYPED.write_text(typed_options(), encoding="utf-8")
