"""Pages made from text that lives elsewhere: ARCHITECTURE.md and others, the commands' help, the options."""

from __future__ import annotations

import html
import inspect
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import click
import gallery_pages
import gallery_reports
import notebooks
import option_tables
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from warpsplat.cli.help import GroupedCommand
from warpsplat.cli.main import COMMANDS, cli

ROOT = Path(__file__).parents[1]
PAGES = {
    "architecture.md": "ARCHITECTURE.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
}
"""Pages that are files of the repository's top."""

REPOSITORY = "https://github.com/warpsplat/warpsplat/blob/main/"

COMMANDS_INTRODUCTION = """# Commands

What `warpsplat COMMAND --help` says. [Options and settings](settings.md) says more about what decides the
result.
"""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made."""
    for page, source in PAGES.items():
        text = (ROOT / source).read_text(encoding="utf-8")
        files.append(File.generated(config, page, content=linked(text)))
    reference = "\n".join(
        [COMMANDS_INTRODUCTION, *(line for name in COMMANDS for line in command_help(name))]
    )
    files.append(File.generated(config, "commands.md", content=reference))
    for path in notebooks.paths():
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=notebooks.page(path)))
    for page, text in {**gallery_pages.pages(), **gallery_reports.reports()}.items():
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Put tables of options where a page says ``<!-- options: NAME -->``."""
    return re.sub(
        r"^<!-- options: (\w+) -->$", lambda m: option_tables.tables(m[1]), markdown, flags=re.MULTILINE
    )


def on_page_content(text: str, **_: Any) -> str:
    """Mark code that is short enough for one line: ``--curves N`` is not to break at its hyphens."""
    return re.sub(r"<code>(?=[^<]{1,24}</code>)", '<code class="short">', text)


def linked(text: str) -> str:
    """Markdown with links among the repository's files as links among the site's pages, with their titles."""
    for page, source in PAGES.items():
        text = re.sub(rf"\]\(({re.escape(REPOSITORY)})?{source}", f"]({page}", text)
    text = re.sub(r"\[(docs/\w+\.md)\]", lambda m: f"[{title(m[1])}]", text)
    return re.sub(rf"\]\(({re.escape(REPOSITORY)})?docs/", "](", text)


def title(page: str) -> str:
    """The first heading of a page of the repository."""
    found = re.search(r"^# (.*)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    return found[1] if found else page


def command_help(name: str) -> Iterator[str]:
    """Lines of Markdown on a command."""
    command = cli.get_command(click.Context(cli), name)
    assert command
    context = click.Context(command, info_name=f"warpsplat {name}", **command.context_settings)
    yield f"## {name}\n"
    yield from paragraphs(inspect.cleandoc(command.help or ""))
    yield f"```text\n{command.get_usage(context).removeprefix('Usage: ')}\n```\n"
    if isinstance(command, GroupedCommand):
        for group, options in command.groups(context).items():
            yield f"### {group}\n"
            yield from option_table(context, options)
    else:
        yield from option_table(context, command.get_params(context))


def option_table(context: click.Context, parameters: Iterable[click.Parameter]) -> Iterator[str]:
    """Lines of a table of the options among the parameters of a command."""
    yield "| option | meaning | default |\n|---|---|---|"
    for parameter in parameters:
        record = parameter.get_help_record(context)
        if record and isinstance(parameter, click.Option):
            yield option_row(*record)
    yield ""


def option_row(flags: str, meaning: str) -> str:
    """A row of a table of options; what click adds in brackets is the default, or known from the rest."""
    default = re.search(r"\[default(?:: (.*?))?\]", meaning)
    words = re.sub(r"\[(default|x[<>]|\d).*$", "", meaning)
    name, _, choices = flags.partition("[")
    choices = f' <code class="choices">{choices.strip("]").replace("|", ", ")}</code>' if choices else ""
    cells = (
        f"<code>{name.strip()}</code>{choices}",
        html.escape(words),
        (default[1] or "yes") if default else "",
    )
    return "| " + " | ".join(" ".join(text.split()) for text in cells) + " |"


def paragraphs(text: str) -> Iterator[str]:
    r"""Markdown of a command's help, whose paragraphs after a ``\b`` keep their lines."""
    for paragraph in text.split("\n\n"):
        lines = paragraph.split("\n")
        if lines[0].strip() == "\b":
            lines = ["```yaml", *lines[1:], "```"]
        yield "\n".join(lines) + "\n"
