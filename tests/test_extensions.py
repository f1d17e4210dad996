"""The registry of extensions, the core without one, and what a wheel is made of."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from tests import ROOT
from tests.cli.helpers import Cli
from tests.needs import WORDS
from warpsplat import extensions
from warpsplat.cli.hooks import RunHook
from warpsplat.errors import UsageError
from warpsplat.extensions import Extension, load, load_renderer, renderer_names
from warpsplat.fit.renderers import FitRenderer


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> dict[str, Extension]:
    """The extensions that the registry finds, to change."""
    known = dict(extensions.extensions())
    monkeypatch.setattr(extensions, "extensions", lambda: known)
    monkeypatch.setattr("warpsplat.cli.hooks.extensions", lambda: known)
    return known


def test_all_are_found() -> None:
    folders = {path.parent.name for path in ROOT.glob("warpsplat/*/extension.py")}
    assert extensions.extensions().keys() <= folders <= WORDS.keys()


@pytest.mark.parametrize("name", extensions.extensions())
def test_all_targets_of_an_extension_exist(name: str) -> None:
    one = extensions.extensions()[name]
    for command in one.commands.values():
        assert isinstance(load(command.target), click.Command)
    assert all(isinstance(load(target), FitRenderer) for target in one.renderers.values())
    assert all(issubclass(load(target), RunHook) for target in one.run_hooks)
    assert all(callable(load(target)) for target in one.provides.values())
    assert all(callable(load(f"{module}:{public}")) for public, module in one.api.items())
    assert {*one.requires, *one.uses} <= WORDS.keys()


def test_one_whose_requirement_is_missing_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Extensions that require it are left out, too."""
    for name, requires in (("a", ()), ("b", ("none",)), ("c", ("b",))):
        (tmp_path / name).mkdir()
        text = f"from warpsplat.extensions import Extension\nEXTENSION = Extension(requires={requires})\n"
        (tmp_path / name / "extension.py").write_text(text)
    monkeypatch.setattr(extensions, "__file__", str(tmp_path / "extensions.py"))
    monkeypatch.setattr(extensions, "folders", extensions.folders.__wrapped__)
    assert list(extensions.extensions.__wrapped__()) == ["a"]


def test_an_unknown_renderer() -> None:
    assert load_renderer("exact").exact
    for name in ("none", "", ["exact"]):
        with pytest.raises(UsageError, match=f"must be one of {', '.join(renderer_names())}, not"):
            load_renderer(name)


def test_several_images_without_batches(found: dict[str, Extension], image: Path, cli: Cli) -> None:
    found.pop("batch", None)
    assert "several images need" in cli("vectorize", image, image, code=2).line
