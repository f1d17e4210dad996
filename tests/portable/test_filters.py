"""Filters of images: near OpenCV's, right at borders, and pinned to the bit."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import cv2
import numpy as np
import pytest

from warpsplat.portable import filters

RANDOM = np.random.default_rng(2)
SHAPES = [(1, 1), (1, 7), (9, 1), (7, 1, 3), (5, 3, 3), (40, 53), (40, 53, 3), (64, 96, 4)]
IMAGES = {"x".join(map(str, shape)): RANDOM.uniform(size=shape).astype(np.float32) for shape in SHAPES}
# Larger ones are prime or fit OpenCV's rounding of where pixels begin, by which it may be one pixel off.
SIZES = [(1, 1), (3, 2), (20, 10), (32, 16), (17, 13), (53, 40), (90, 77), (107, 131)]
BORDERS = {"reflect101": cv2.BORDER_REFLECT_101, "replicate": cv2.BORDER_REPLICATE}
COLORS = RANDOM.uniform(size=(40, 53, 3)).astype(np.float32)


def assert_near(ours: np.ndarray, theirs: np.ndarray, scale: float = 1.0) -> None:
    assert ours.dtype == np.float32
    assert np.abs(ours - np.reshape(theirs, ours.shape)).max() < 1e-5 * scale


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", IMAGES)
@pytest.mark.parametrize("by", ["linear", "cubic"])
def test_resized_as_by_opencv(name: str, size: tuple[int, int], by: str) -> None:
    theirs = cv2.resize(IMAGES[name], size, interpolation=getattr(cv2, f"INTER_{by.upper()}"))
    assert_near(getattr(filters, f"resize_{by}")(IMAGES[name], size), theirs)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", IMAGES)
def test_areas_as_by_opencv(name: str, size: tuple[int, int]) -> None:
    """One side at a time: where one grows, OpenCV samples the other."""
    image = IMAGES[name]
    down = cv2.resize(image, (image.shape[1], size[1]), interpolation=cv2.INTER_AREA)
    down = down.reshape(size[1], *image.shape[1:])
    theirs = cv2.resize(down, size, interpolation=cv2.INTER_AREA)
    assert_near(filters.resize_area(image, size), theirs)


@pytest.mark.parametrize("name", IMAGES)
@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("sigma", [0.5, 0.8, 1.0, 1.5, 8.0])
def test_blurred_as_by_opencv(name: str, border: filters.Border, sigma: float) -> None:
    theirs = cv2.GaussianBlur(IMAGES[name], (0, 0), sigma, borderType=BORDERS[border])
    assert_near(filters.gaussian_blur(IMAGES[name], sigma, border), theirs)


def test_a_masked_blur_skips_far_tiles_with_the_same_bits() -> None:
    image, ring = RANDOM.uniform(size=(250, 311, 4)).astype(np.float32), np.zeros((250, 311), np.bool_)
    ring[3:, :300] = True
    ring[9:240, 8:290] = False
    soft = filters.blurred_within(image, ring, 1.5)
    weight = filters.gaussian_blur(ring, 1.5)
    every = filters.gaussian_blur(image * ring[..., None], 1.5) / np.maximum(weight, 1e-3)[..., None]
    assert (soft[ring] == every[ring]).all()
    assert not soft[96:160, 96:160].any()
    assert (filters.blurred_within(image[..., 0], ring, 1.5) == soft[..., 0]).all()


@pytest.mark.parametrize("name", IMAGES)
@pytest.mark.parametrize("size", [1, 3, 4, 9, 15])
def test_boxes_as_by_opencv(name: str, size: int) -> None:
    image = IMAGES[name]
    theirs = cv2.boxFilter(image, -1, (size, size), normalize=False)
    assert_near(filters.box_sum(image, size), theirs, scale=size * size)
    assert_near(filters.box_blur(image, size), cv2.blur(image, (size, size)))


@pytest.mark.parametrize("name", ["1x1", "1x7", "9x1", "40x53"])
def test_slopes_as_by_opencv(name: str) -> None:
    along, down = filters.sobel(IMAGES[name])
    assert_near(along, cv2.Sobel(IMAGES[name], cv2.CV_32F, 1, 0))
    assert_near(down, cv2.Sobel(IMAGES[name], cv2.CV_32F, 0, 1))


@pytest.mark.parametrize("name", [name for name in IMAGES if not name.endswith("x4")])
def test_bilateral_as_by_opencv(name: str) -> None:
    image = IMAGES[name]
    assert_near(filters.bilateral(image, 7, 0.3, 2.5), cv2.bilateralFilter(image, 7, 0.3, 2.5))


def test_distances() -> None:
    mask = RANDOM.uniform(size=(60, 80)) < 0.99
    rows, columns = np.nonzero(~mask)
    away = np.hypot(np.arange(60)[:, None, None] - rows, np.arange(80)[:, None] - columns).min(axis=2)
    found = filters.distance(mask)
    assert np.array_equal(found == 0, ~mask)
    assert np.all(np.abs(found - away) <= 0.03 * away)
    assert np.abs(found - cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)).max() < 1e-3


def test_luma_as_by_opencv() -> None:
    assert_near(filters.grey(COLORS), cv2.cvtColor(COLORS, cv2.COLOR_RGB2GRAY))


def test_lab() -> None:
    """OpenCV interpolates in a table of all colours, by which it is off by up to 0.6."""
    assert_near(filters.lab(COLORS), cv2.cvtColor(COLORS, cv2.COLOR_RGB2LAB), scale=1e5)
    known = filters.lab(np.eye(3))
    # The primaries, as they are usually given to two places.
    expected = [[53.24, 80.09, 67.20], [87.73, -86.18, 83.18], [32.30, 79.19, -107.86]]
    assert np.abs(known - expected).max() < 0.01
    assert np.abs(filters.lab(np.ones(3)) - [100, 0, 0]).max() < 1e-3
    assert np.abs(filters.lab(np.zeros(3))).max() < 1e-12


@pytest.mark.parametrize(
    "apply",
    [
        lambda image: filters.resize_area(image, (7, 30)),
        lambda image: filters.resize_cubic(image, (90, 30)),
        lambda image: filters.gaussian_blur(image, 2.0),
        lambda image: filters.bilateral(image, 5, 0.2, 2.0),
        filters.grey,
        filters.lab,
    ],
)
def test_float64_stays_and_arguments_are_not_changed(apply: Callable[[np.ndarray], np.ndarray]) -> None:
    given = COLORS.astype(np.float64)
    exact = apply(given)
    assert exact.dtype == np.float64
    assert np.array_equal(given, COLORS)
    assert np.abs(apply(COLORS) - exact).max() < 1e-5 * max(1.0, float(np.abs(exact).max()))


def test_bands_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    def made() -> list[np.ndarray]:
        return [
            filters.resize_area(COLORS, (17, 13)),
            filters.resize_area(COLORS, (53, 10)),
            filters.resize_linear(COLORS, (99, 77)),
            filters.gaussian_blur(COLORS, 3.0),
            filters.bilateral(COLORS, 7, 0.2, 2.5),
        ]

    whole = made()
    monkeypatch.setattr(filters, "BAND", 500)
    assert all(np.array_equal(a, b) for a, b in zip(whole, made(), strict=True))


def test_pinned_bits() -> None:
    image = IMAGES["40x53x3"]
    made = [
        filters.resize_area(image, (17, 13)),
        filters.resize_area(image, (53, 10)),
        filters.resize_linear(image, (90, 77)),
        filters.resize_cubic(image, (106, 80)),
        filters.gaussian_blur(image, 1.0),
        filters.gaussian_blur(image, 8.0, "replicate"),
        filters.box_blur(image, 9),
        *filters.sobel(IMAGES["40x53"]),
        filters.bilateral(image, 7, 0.2, 2.5),
        filters.distance(image[..., 0] > 0.05),
        filters.grey(image),
        filters.lab(image),
    ]
    digest = hashlib.sha256(b"".join(np.asarray(each, "<f4").tobytes() for each in made)).hexdigest()
    assert digest[:16] == "d191c4433bf01efa"
