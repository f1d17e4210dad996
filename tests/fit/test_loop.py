"""The events between steps."""

from __future__ import annotations

import pytest

from tests import ROOT
from tests.fit.pictures import picture
from warpsplat.fit import loop
from warpsplat.fit.loop import AFTER_A_STEP, BEFORE_A_STEP, Event, fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import Density, make_settings
from warpsplat.fit.training import Training
from warpsplat.rendering.backend import Backend


def test_the_architecture_lists_the_events() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = text.split("| event | when |")[1].split("\n\n")[0].splitlines()[2:]
    names = [row.split(" | ")[0].removeprefix("| ") for row in rows]
    before, after = ([event.name for event in events] for events in (BEFORE_A_STEP, AFTER_A_STEP))
    assert names == ["**before a step**", *before, "**after a step**", *after]


def test_the_steps_at_which_events_happen(monkeypatch: pytest.MonkeyPatch) -> None:
    happened = dict[str, list[int]]()

    def watched(event: Event) -> Event:
        def act(training: Training) -> None:
            happened.setdefault(event.name, []).append(training.done)
            event.act(training)

        return Event(event.name, event.due, act)

    for name in ("BEFORE_A_STEP", "AFTER_A_STEP"):
        monkeypatch.setattr(loop, name, tuple(watched(event) for event in getattr(loop, name)))
    settings = make_settings(
        curves=12,
        iterations=200,
        coarse_pixels=1000,
        coarse=0.5,
        colors=3,
        density=Density(interval=20),
        subject="photo",
    )
    fit(Problem(picture(), settings), Run(Backend.on("cpu", 1), lambda now: None))
    tens, stages = [*range(10, 201, 10)], [191, 194, 197]
    assert happened == {
        "round points": stages,
        "freeze opacities": [171],
        "evaluate the file": [150],
        "densify": [*range(20, 170, 20)],
        "read the shapes back": [50],
        "change the target": [100],
        "choose colours": [*range(5, 191, 5)],
        "reset broken shapes": sorted({*tens, *stages}),
        "enlarge arrays": tens,
        "report progress": tens,
    }
