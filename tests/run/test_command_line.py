"""Options are declared once, and the command that makes a result again has all of its settings."""

from __future__ import annotations

import inspect
import runpy
import shlex
from pathlib import Path
from typing import Any

import click
import pytest

import warpsplat
from tests import ROOT
from warpsplat.cli.main import cli
from warpsplat.cli.vectorize import command
from warpsplat.errors import UsageError
from warpsplat.fit.options import Option
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.run import options
from warpsplat.run.command_line import refine_command, several_command, vectorize_command
from warpsplat.run.options import OPTIONS, RESEARCH_KEYS, preset_names, settings_from, with_preset
from warpsplat.scene import Kind

CASES: list[dict[str, Any]] = [
    {},
    {"curves": 512},
    {"quality": "draft", "kind": Kind.STROKE, "curves": 9, "seed": 4},
    {"quality": "high", "iterations": 70, "renderer": "splat"},
    {"renderer": "gaussian", "curves": 40},
    {"layered": True, "curves": 512},
    {"levels": "8,32", "title": "it's <b>; rm -rf /", "background": "#aabbcc"},
    {"palette": "#ff0000,#00ff00", "mixed": True},
    {"colors": 4, "subject": "drawing", "minify": True, "ids": True},
    {"time_budget": "90s", "max_bytes": "20KB", "paint": "auto", "precision": 1, "opaque": True},
    {"subject": "line", "page": "a4", "units": "cm", "title": "-dash"},
]


NAMES = {"kind", *(option.keyword for option in OPTIONS)}


def settings_of(line: str) -> Settings:
    """Return the settings that the program would run with."""
    words = shlex.split(line, comments=True)
    assert words[:2] == ["warpsplat", "vectorize"]
    import click

    command = cli.get_command(click.Context(cli), "vectorize")
    assert command
    given = command.make_context("vectorize", words[2:]).params
    return settings_from(
        with_preset(given["preset"], {key: value for key, value in given.items() if key in NAMES})
    )


@pytest.mark.parametrize("given", CASES, ids=lambda given: "-".join(given) or "nothing")
def test_the_line_gives_the_settings(given: dict[str, Any]) -> None:
    settings = make_settings(**given)
    line = vectorize_command(settings, "-odd; name.png", "out.svg")
    assert "#" not in shlex.split(line)
    assert settings_of(line.replace("'-odd; name.png'", "x.png")) == settings


def test_defaults_are_left_out_of_the_command() -> None:
    assert vectorize_command(make_settings(), "a.png", "a.svg") == "warpsplat vectorize a.png -o a.svg"
    line = vectorize_command(make_settings("draft", curves=9), "a b.png", "a.svg")
    assert line == "warpsplat vectorize 'a b.png' --quality draft --curves 9 -o a.svg"


def test_settings_without_a_flag_are_mentioned() -> None:
    assert vectorize_command(make_settings(bending=0.1), "a.png", "a.svg").endswith(
        "# and settings without a flag"
    )


@pytest.mark.parametrize("further", [{}, {"quality": "draft", "detail": 0.2}, {"curves": 9}, {"open": True}])
@pytest.mark.parametrize("preset", preset_names())
def test_a_preset_is_named(preset: str, further: dict[str, Any]) -> None:
    try:
        settings = make_settings(**with_preset(preset, dict(further)))
    except UsageError:
        return  # not every form is a stroke
    line = vectorize_command(settings, "x.png", "out.svg", preset=preset)
    assert settings_of(line) == settings
    assert f"--preset {preset}" in line and len(shlex.split(line)) <= 7 + 2 * len(further)


def test_a_preset_that_no_flag_can_undo_is_not_named() -> None:
    """The preset is not named then."""
    settings = make_settings(shape="triangle", curves=250, opaque=False)
    line = vectorize_command(settings, "x.png", "out.svg", preset="low-poly")
    assert settings_of(line) == settings and "preset" not in line


def test_refine() -> None:
    settings = make_settings(iterations=30, title="x y")
    line = refine_command(settings, "a.svg", "a.png", "b.svg", "--keep")
    assert line == "warpsplat refine a.svg a.png --iterations 30 --title 'x y' --keep -o b.svg"


def test_names_that_begin_as_flags_do_are_paths() -> None:
    settings = make_settings()
    assert " ./-a.png " in vectorize_command(settings, "-a.png", "a.svg")
    assert " ./-a.png " in several_command(settings, (8, 16), "-a.png", None) + " "
    assert " ./-a.svg ./-a.png " in refine_command(settings, "-a.svg", "-a.png", "b.svg")
    assert " - " in vectorize_command(settings, "-", "a.svg")


MADE = runpy.run_path(str(ROOT / "docs" / "option_tables.py"))


@pytest.mark.parametrize("option", OPTIONS, ids=lambda o: o.name)
def test_flags_keys_keywords_and_rows(option: Option) -> None:
    flags = {name: p for p in command.params if isinstance(p, click.Option) for name in p.opts}
    flag = flags[f"--{option.name}"]
    assert option.value is not None or command.make_context("vectorize", ["a.png"]).params[flag.name] is None
    assert (flag.help or "").startswith(option.help)
    assert option.keyword in inspect.signature(warpsplat.vectorize).parameters
    assert f"<code>--{option.name}" in MADE["tables"]("options")


def test_generated_files_are_current() -> None:
    assert MADE["TYPED"].read_text("utf-8") == MADE["typed_options"](), "python docs/option_tables.py"
    rows = MADE["tables"]("research")
    assert all(
        f"| <code>{key}</code> |" in rows for key in (*RESEARCH_KEYS, "rates", "density", "density.stop")
    )


def test_a_palette_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "colors.txt"
    path.write_text("#ff0000 " * (options.MOST_BYTES // 8))
    assert len(settings_from({"palette": str(path)}).palette) == 1
    with path.open("a") as file:
        file.write("#00ff00")
    with pytest.raises(UsageError, match=f"has more than {options.MOST_BYTES} bytes"):
        settings_from({"palette": str(path)})


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="the system has no device without an end")
def test_a_palette_without_an_end_is_refused() -> None:
    with pytest.raises(UsageError, match="/dev/zero: has more than"):
        settings_from({"palette": "/dev/zero"})
