from __future__ import annotations

from typing import Any

import pytest

from warpsplat.errors import UsageError
from warpsplat.fit.options import parse_bytes, parse_duration
from warpsplat.fit.settings import FILL_POINT_RATE, Settings, make_settings
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


def test_options_that_imply_others() -> None:
    plain = make_settings()
    splat, gaussian = make_settings(renderer="splat"), make_settings(renderer="gaussian")
    assert plain.rates["points"] == FILL_POINT_RATE > Settings().rates["points"]
    assert make_settings(open=True).rates == splat.rates == Settings().rates
    assert make_settings(rates={"points": 1.0}).rates == {**plain.rates, "points": 1}
    assert make_settings(colors=4).rates["colors"] == 0 < make_settings(opaque=True).rates["colors"]
    assert splat.iterations < plain.iterations
    assert make_settings(renderer="splat", iterations=77).iterations == 77
    assert (gaussian.basis, gaussian.order, gaussian.viewer) == (Basis.CUBIC, "area", False)
    assert make_settings(renderer="gaussian", order="age").order == "age"
    assert plain.simplify and not make_settings(curves=512).simplify
    assert make_settings(open=True).kind == make_settings(closed=False).kind == Kind.STROKE
    assert make_settings(open=False) == make_settings(closed=True) == plain
    assert make_settings(subject="drawing", max_bytes="10GB").max_bytes == 10**10


@pytest.mark.parametrize(
    ("given", "message"),
    [
        *(({"curves": bad}, "curves must be a whole number from 1 to ") for bad in (0, 1.5, "many", True)),
        ({"coarse": 1.5}, "coarse must be a number from 0 to 1, not 1.5"),
        ({"softness": float("nan")}, "softness must be a number from 0 to 100, not nan"),
        *(({"target_psnr": bad}, "target-psnr must be a positive") for bad in (0, float("inf"), True)),
        ({"closed": "yes"}, "closed must be true or false"),
        *(({"basis": bad}, "basis must be one of cubic, spline, not") for bad in ("quartic", 7)),
        ({"quality": "best"}, "quality must be one of draft, balanced, high, not 'best'"),
        ({"background": "rad"}, "background must be auto, none or a colour such as white or '#fff'"),
        ({"rates": {"point": 1.0}}, "unknown setting 'point' in rates; did you mean 'points'?"),
        ({"density": {"intervall": 3}}, "unknown setting 'intervall' in density; did you mean 'interval'?"),
        ({"colour": 3}, "unknown setting 'colour'; did you mean 'colors'?"),
        ({"closed": True, "open": True}, "closed and open cannot be combined"),
        ({"renderer": "splat", "basis": "spline"}, "renderer splat needs the basis cubic"),
        ({"renderer": "gaussian", "paint": "auto"}, "renderer gaussian needs the paint flat"),
        ({"renderer": "gaussian", "colors": 4}, "opaque fills and the renderer gaussian cannot be combined"),
        ({"paint": "auto", "colors": 4}, "paint auto and colors cannot be combined"),
        ({"mixed": True, "renderer": "splat"}, "mixed and the renderer splat cannot be combined"),
        ({"subject": "drawing", "loss": "edges"}, "subject drawing and loss edges cannot be combined; "),
        ({"subject": "line", "max_bytes": 900}, "subject line and max-bytes cannot be combined"),
        ({"levels": "5,x"}, "levels must be numbers of shapes"),
        ({"levels": "4,8", "curves": 9}, "curves 9 and the last of the levels"),
        ({"subject": "photo", "bridges": "2"}, "subject photo and bridges 2 cannot be combined"),
        ({"size": "9x9mm", "page": "a4"}, "size and page cannot be combined"),
    ],
)
def test_refusals(given: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        make_settings(**given)
    assert str(caught.value).startswith(message)


def test_times_and_sizes() -> None:
    assert [parse_duration(x) for x in ("60s", "2m", 90, "1.5h", "250ms")] == [60, 120, 90, 5400, 0.25]
    sizes = {"10GB": 10**10, "1.5g": 1_500_000_000, "2GiB": 2**31, "100KB": 100_000, "1MiB": 2**20, 500: 500}
    assert [parse_bytes(x) for x in sizes] == [*sizes.values()]
    for bad in ("soon", "-3s", "", True):
        for parse in (parse_duration, parse_bytes):
            with pytest.raises(UsageError):
                parse(bad)


@pytest.mark.parametrize("color", ["#fff", "#FFF", "#FFFFFF", " #ffffff", "White"])
def test_one_reading_of_colours(color: str) -> None:
    assert make_settings(background=color).background == "#ffffff"
    assert make_settings(palette=color).palette == ("#ffffff",)
    assert make_settings(palette=[color.strip()]).palette == ("#ffffff",)
