from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from warpsplat.errors import UsageError
from warpsplat.fit.options import parse_bytes, parse_duration
from warpsplat.fit.settings import FILL_POINT_RATE, PRESETS, Settings, make_settings, solid_color
from warpsplat.scene import Basis, Kind

FINGERPRINTS: list[tuple[dict[str, Any], str]] = [
    ({}, "2f649fb73bb547b2"),
    ({"quality": "draft", "curves": 64, "seed": 7}, "ef9ace94506bedd5"),
    ({"renderer": "gaussian", "rates": {"points": 1.5}}, "ad62618edddbc6ad"),
    ({"density": {"interval": 400, "opacity-start": 0.3}, "basis": "cubic"}, "08df43ab5b6426d1"),
]


@pytest.mark.parametrize(("given", "wanted"), FINGERPRINTS)
def test_fingerprints_stay(given: dict[str, Any], wanted: str) -> None:
    """Files, manifests and checkpoints are known by them."""
    assert make_settings(**given).fingerprint() == wanted


@pytest.mark.parametrize("quality", PRESETS)
def test_presets_differ_from_the_defaults_only_where_they_say(quality: Any) -> None:
    rates = {**Settings().rates, "points": FILL_POINT_RATE}
    wanted = replace(Settings(), simplify=True, rates=rates, **PRESETS[quality])
    assert make_settings(quality) == make_settings(quality, seed=None) == wanted


def test_what_options_imply() -> None:
    plain = make_settings()
    splat, gaussian = make_settings(renderer="splat"), make_settings(renderer="gaussian")
    assert plain.rates["points"] == FILL_POINT_RATE > Settings().rates["points"]
    assert make_settings(open=True).rates == splat.rates == Settings().rates
    assert make_settings(rates={"points": 1.0}).rates == {**plain.rates, "points": 1}
    assert splat.iterations < plain.iterations
    assert make_settings(renderer="splat", iterations=77).iterations == 77
    assert (gaussian.basis, gaussian.order, gaussian.viewer) == (Basis.CUBIC, "area", False)
    assert make_settings(renderer="gaussian", order="age").order == "age"
    assert plain.simplify and not make_settings(curves=512).simplify
    assert make_settings(open=True).kind == make_settings(closed=False).kind == Kind.STROKE
    assert make_settings(open=False) == make_settings(closed=True) == plain


def test_density_may_be_given_in_part() -> None:
    settings = make_settings(density={"interval": 400, "opacity-start": 0.3})
    assert settings.density == replace(make_settings().density, interval=400, opacity_start=0.3)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        *(({"curves": bad}, "curves must be a whole number from 1 to ") for bad in (0, 1.5, "many", True)),
        ({"precision": 9}, "precision must be a whole number from 0 to 6, not 9"),
        ({"coarse": 1.5}, "coarse must be a number from 0 to 1, not 1.5"),
        ({"softness": float("nan")}, "softness must be a number from 0 to 100, not nan"),
        *(({"target_psnr": bad}, "target-psnr must be a positive") for bad in (0, float("inf"), True)),
        ({"closed": "yes"}, "closed must be true or false"),
        ({"kind": "round"}, "kind must be a Kind, not 'round'"),
        *(({"basis": bad}, "basis must be one of cubic, spline, not") for bad in ("quartic", 7)),
        ({"quality": "best"}, "quality must be one of draft, balanced, high, not 'best'"),
        (
            {"background": "rad"},
            "background must be auto, none or a colour such as white or '#fff' (in quotes, ",
        ),
        ({"title": "x" * 1001}, "title must be a text of at most 1000 characters"),
        ({"rates": 3}, "rates must be a mapping"),
        ({"rates": {"points": -1}}, "rates points must be a number from 0 to"),
        ({"rates": {"point": 1.0}}, "unknown setting 'point' in rates; did you mean 'points'?"),
        ({"density": {"stop": 2}}, "density stop must be a number from 0 to 1, not 2"),
        ({"density": {"intervall": 3}}, "unknown setting 'intervall' in density; did you mean 'interval'?"),
        ({"colour": 3}, "unknown setting 'colour'; did you mean 'colors'?"),
        ({"closed": True, "open": True}, "closed and open cannot be combined"),
        ({"renderer": "splat", "basis": "spline"}, "renderer splat needs the basis cubic"),
        ({"renderer": "gaussian", "paint": "auto"}, "renderer gaussian needs the paint flat"),
        ({"renderer": "gaussian", "colors": 4}, "opaque fills and the renderer gaussian cannot be combined"),
        ({"paint": "auto", "colors": 4}, "paint auto and colors cannot be combined"),
        ({"paint": "auto", "palette": "#fff"}, "paint auto and palette cannot be combined"),
        ({"mixed": True, "open": True}, "mixed and open cannot be combined"),
        ({"mixed": True, "renderer": "splat"}, "mixed and the renderer splat cannot be combined"),
        ({"subject": "drawing", "open": True}, "subject drawing and open cannot be combined"),
        (
            {"subject": "drawing", "loss": "edges"},
            "subject drawing and loss edges cannot be combined; loss edges",
        ),
        ({"subject": "line", "max_bytes": 900}, "subject line and max-bytes cannot be combined"),
        ({"levels": "5,x"}, "levels must be numbers of shapes"),
        ({"levels": "5,5"}, "levels must be ascending numbers of shapes"),
        ({"levels": "4,8", "curves": 9}, "curves 9 and the last of the levels"),
        ({"levels": "4,8", "max_bytes": "4KB"}, "levels and max-bytes"),
        ({"subject": "photo", "bridges": "2"}, "subject photo and bridges 2 cannot be combined"),
        ({"size": "9x9mm", "page": "a4"}, "size and page cannot be combined"),
    ],
)
def test_what_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        make_settings(**given)
    assert str(caught.value).startswith(message)


def test_goals_may_be_as_large_as_anyone_likes() -> None:
    assert make_settings(max_bytes=999_999_999_999_999).max_bytes == 999_999_999_999_999
    assert make_settings(subject="drawing", max_bytes="10GB").max_bytes == 10**10


def test_times_and_sizes() -> None:
    assert [parse_duration(x) for x in ("60s", "2m", 90, "1.5h", "250ms")] == [60, 120, 90, 5400, 0.25]
    assert [parse_bytes(x) for x in ("10GB", "1.5g", "2GiB")] == [10**10, 1_500_000_000, 2**31]
    assert [parse_bytes(x) for x in ("100KB", "1MiB", 500, "2k")] == [100_000, 1_048_576, 500, 2000]
    for bad in ("soon", "-3s", "", True):
        for parse in (parse_duration, parse_bytes):
            with pytest.raises(UsageError):
                parse(bad)


@pytest.mark.parametrize("color", ["#fff", "#FFF", "#FFFFFF", " #ffffff", "White"])
def test_one_reading_of_colours(color: str) -> None:
    assert make_settings(background=color).background == "#ffffff"
    assert make_settings(palette=color).palette == ("#ffffff",)
    assert make_settings(palette=[color.strip()]).palette == ("#ffffff",)


def test_a_short_colour_of_settings() -> None:
    color = solid_color(Settings(background="#F80").background)
    assert color is not None
    assert (255 * color).round().tolist() == [255, 136, 0]
