"""The events between steps."""

from __future__ import annotations

from tests import ROOT
from warpsplat.fit.loop import AFTER_A_STEP, BEFORE_A_STEP


def test_the_architecture_lists_the_events() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = text.split("| event | when |")[1].split("\n\n")[0].splitlines()[2:]
    names = [row.split(" | ")[0].removeprefix("| ") for row in rows]
    before, after = ([event.name for event in events] for events in (BEFORE_A_STEP, AFTER_A_STEP))
    assert names == ["**before a step**", *before, "**after a step**", *after]
