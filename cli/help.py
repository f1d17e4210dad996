"""Help in groups: ``--help`` explains common options and names the others; ``--help-all`` explains all."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import click
from click.shell_completion import CompletionItem

from warpsplat.fit.options import GROUPS, Group

SHOWS_ALL = "warpsplat.cli.help.shows_all"
"""Key of ``click.Context.meta``: whether the help is to explain all options."""

Values = Sequence[str] | Callable[[], Sequence[str]]
"""Values that shells complete, or a function that finds them."""


class Flag(click.Option):
    """An option of a command that has many."""

    def __init__(
        self,
        *declared: Any,
        group: Group = "Run",
        common: bool = False,
        values: Values = (),
        files: bool = False,
        **others: Any,
    ) -> None:
        """``common``: whether ``--help`` explains it; ``values``, ``files``: what shells complete."""
        if values or files:
            others["shell_complete"] = functools.partial(_complete, values, files)
        super().__init__(*declared, **others)
        self.group, self.common = group, common

    def get_help_extra(self, ctx: click.Context) -> Any:
        """Return what is added to the help, without a range in the notation of click."""
        return {name: value for name, value in super().get_help_extra(ctx).items() if name != "range"}


def option_in(group: Group, *words: str, **declared: Any) -> Callable[[Any], Any]:
    """Return a decorator that adds a ``Flag`` to a group."""
    return click.option(*words, cls=Flag, group=group, **declared)


def _complete(
    values: Values, files: bool, ctx: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """Return the values that begin as what is typed; ``files``: files as well."""
    # The files come first: bash forgets what came before them.
    paths = [CompletionItem(incomplete, type="file")] if files else []
    found = values() if callable(values) else values
    return paths + [CompletionItem(value) for value in found if value.startswith(incomplete)]


class GroupedCommand(click.Command):
    """A command whose ``--help`` explains some options and names the others, in groups."""

    def __init__(self, *declared: Any, **others: Any) -> None:
        super().__init__(*declared, **others)
        self.params.append(
            Flag(
                ["--help-all"],
                is_flag=True,
                is_eager=True,
                expose_value=False,
                callback=_show_all,
                help="Explain all options and exit.",
            )
        )

    def groups(self, ctx: click.Context) -> dict[str, list[click.Parameter]]:
        """Return the options by groups."""
        found: dict[str, list[click.Parameter]] = {group: [] for group in GROUPS}
        for parameter in self.get_params(ctx):
            if isinstance(parameter, click.Option) and not parameter.hidden:
                found[getattr(parameter, "group", "Run")].append(parameter)
        return {group: options for group, options in found.items() if options}

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options: all of them, or those that are common and the names of the others."""
        groups = self.groups(ctx)
        if ctx.meta.get(SHOWS_ALL):
            for group, options in groups.items():
                with formatter.section(group):
                    _write_rows(formatter, _records(ctx, options))
            return
        common = [each for each in self.get_params(ctx) if getattr(each, "common", False)]
        with formatter.section("Common options"):
            _write_rows(formatter, _records(ctx, common))
        names = {
            g: ", ".join(o.opts[-1] for o in options if o not in common) for g, options in groups.items()
        }
        with formatter.section("More options"):
            _write_rows(formatter, ((group, left) for group, left in names.items() if left))
        formatter.write_paragraph()
        formatter.write_text(f"{ctx.command_path} --help-all explains all options.")


def _show_all(ctx: click.Context, parameter: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        ctx.meta[SHOWS_ALL] = True
        click.echo(ctx.get_help())
        ctx.exit()


def _records(ctx: click.Context, options: Iterable[click.Parameter]) -> list[tuple[str, str]]:
    """Return how options are written, and their explanations."""
    return [record for each in options if (record := each.get_help_record(ctx))]


def _write_rows(formatter: click.HelpFormatter, rows: Iterable[tuple[str, str]]) -> None:
    """Write rows of two columns; the same in all groups, and not broken at hyphens."""
    column = 26  # column where explanations begin
    for term, words in rows:
        first = f"{'':{formatter.current_indent}}{term}"
        lines = textwrap.wrap(words, formatter.width - column, break_on_hyphens=False) or [""]
        start = [] if len(first) > column - 2 else [f"{first:{column}}{lines.pop(0)}"]
        for line in start or [first]:
            formatter.write(f"{line}\n")
        for line in lines:
            formatter.write(f"{'':{column}}{line}\n")
