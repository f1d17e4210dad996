from __future__ import annotations

from dataclasses import replace

import pytest

from warpsplat.errors import UsageError
from warpsplat.fit.settings import (
    FILL_POINT_RATE,
    PRESETS,
    Settings,
    make_settings,
)
from warpsplat.fit.texts import parse_bytes, parse_duration
from warpsplat.scene import Kind


def test_presets_differ_from_the_defaults_only_where_they_say() -> None:
    for name, changes in PRESETS.items():
        settings = make_settings(name)
        rates = {**Settings().rates, "points": FILL_POINT_RATE}
        assert settings == replace(Settings(), simplify=True, rates=rates, **changes)


def test_splined_fills_take_larger_steps() -> None:
    """Strokes do not; nor does anything else differ; rates that are given stay."""
    plain = Settings().rates
    assert (
        make_settings().rates == make_settings(kind=Kind.FILL).rates == {**plain, "points": FILL_POINT_RATE}
    )
    assert plain["points"] < FILL_POINT_RATE
    assert make_settings(kind=Kind.STROKE).rates == plain
    assert make_settings(rates={**plain, "points": 1.0}).rates["points"] == 1


def test_rates_and_density_may_be_given_in_part() -> None:
    settings = make_settings(rates={"points": 1.5}, density={"interval": 400, "opacity-start": 0.3})
    plain = make_settings()
    assert settings.rates == {**plain.rates, "points": 1.5}
    assert settings.density == replace(plain.density, interval=400, opacity_start=0.3)
    for bad in ({"rates": {"point": 1.0}}, {"density": {"intervall": 3}}):
        with pytest.raises(UsageError, match=r"unknown setting .(point|intervall)"):
            make_settings(**bad)


def test_overrides_win_and_none_is_left_out() -> None:
    settings = make_settings("draft", curves=7, seed=None)
    assert (settings.curves, settings.seed) == (7, Settings().seed)


@pytest.mark.parametrize(
    ("name", "value"),
    [("curves", 0), ("curves", -3), ("curves", 1.5), ("curves", "many"), ("curves", True), ("seed", -1)]
    + [("iterations", 0), ("precision", 9), ("kind", "round"), ("colour", 3)]
    + [("coarse", 1.5), ("xing", -1), ("texture", "no"), ("viewer", 1), ("basis", "quartic"), ("basis", 7)]
    + [("order", "size"), ("softness", float("nan")), ("density", {"stop": 2}), ("rates", {"points": -1})],
)
def test_bad_values(name: str, value: object) -> None:
    with pytest.raises(UsageError, match=name):
        make_settings(**{name: value})


def test_times_and_sizes() -> None:
    assert [parse_duration(x) for x in ("60s", "2m", 90, "1.5h", "250ms")] == [60, 120, 90, 5400, 0.25]
    assert [parse_bytes(x) for x in ("10GB", "1.5g", "2GiB")] == [10**10, 1_500_000_000, 2**31]
    assert [parse_bytes(x) for x in ("100KB", "1MiB", 500, "2k")] == [100_000, 1_048_576, 500, 2000]
    for bad in ("soon", "-3s", "", True):
        with pytest.raises(UsageError):
            parse_duration(bad)
        with pytest.raises(UsageError):
            parse_bytes(bad)


def test_bad_quality() -> None:
    with pytest.raises(UsageError, match="draft, balanced, high"):
        make_settings("best")


def test_fingerprint_sees_every_setting() -> None:
    base = Settings()
    assert base.fingerprint() == Settings().fingerprint()
    others = [
        replace(base, seed=1),
        replace(base, rates={**base.rates, "points": 7.0}),
        replace(base, kind=Kind.STROKE),
    ]
    assert len({s.fingerprint() for s in (base, *others)}) == 4


def test_goals_may_be_as_large_as_anyone_likes() -> None:
    assert make_settings(max_bytes=999_999_999_999_999).max_bytes == 999_999_999_999_999
    assert make_settings(max_bytes="10GB").max_bytes == 10**10
    for bad in (0, float("inf"), float("nan"), True):
        with pytest.raises(UsageError, match="target-psnr must be a positive number"):
            make_settings(target_psnr=bad)


def test_curves_that_are_given_stay() -> None:
    assert make_settings().simplify
    assert not make_settings(curves=512).simplify
    assert not make_settings(curves=9).simplify
