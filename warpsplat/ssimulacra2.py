"""SSIMULACRA2 (Sneyers, Cloudinary 2022): a figure of quality that agrees well with human judgement."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float32]

SCALES = 6

SIGMA, RADIUS = 1.5, 5
"""Gaussian window [px]."""

C2 = np.float32(0.0009)
"""Constant of the structural term, which keeps it finite where nothing varies."""

OPSIN = np.array(
    [
        [0.30, 0.622, 0.078],
        [0.23, 0.692, 0.078],
        [0.24342268924547819, 0.20476744424496821, 0.5518098665095536],
    ]
)
"""Matrix from linear sRGB to the responses of the eye's cones, as in JPEG XL."""

XYB = np.array([[7.0, -7.0, 0.0], [0.5, 0.5, 0.0], [-0.5, -0.5, 1.0]])
XYB_OFFSET = np.array([0.42, 0.01, 0.55])
"""From the cube roots of the responses to opponent colours that are positive."""

WEIGHTS = {
    1: 0.0007376606707406586, 4: 0.0007793481682867309, 7: 0.0004371155730107379, 9: 1.1041726426657346,
    10: 0.00066284834129271, 11: 0.00015231632783718752, 13: 0.0016406437456599754, 15: 1.8422455520539298,
    16: 11.441172603757666, 18: 0.0007989109436015163, 19: 0.000176816438078653, 21: 1.8787594979546387,
    22: 10.94906990605142, 24: 0.0007289346991508072, 25: 0.9677937080626833, 27: 0.00014003424285435884,
    28: 0.9981766977854967, 29: 0.00031949755934435053, 30: 0.0004550992113792063, 33: 0.0013648766163243398,
    39: 7.466890328078848, 41: 17.445833984131262, 42: 0.0006235601634041466, 45: 6.683678146179332,
    46: 0.00037724407979611296, 47: 1.027889937768264, 48: 225.20515300849274, 51: 19.213238186143016,
    52: 0.0011401524586618361, 53: 0.001237755635509985, 54: 176.39317598450694, 57: 24.43300999870476,
    58: 0.28520802612117757, 59: 0.0004485436923833408, 63: 34.77906344483772, 64: 44.835625328877896,
    73: 0.0008680556573291698, 79: 0.0005313191874358747, 81: 0.00016533814161379112,
    87: 0.0004179171803251336, 88: 0.0017290828234722833, 90: 0.0020827005846636437, 93: 8.826982764996862,
    94: 23.19243343998926, 96: 95.1080498811086, 97: 0.9863978034400682, 98: 0.9834382792465353,
    99: 0.0012286405048278493, 100: 171.2667255897307, 101: 0.9807858872435379, 105: 0.0005130064588990679,
    107: 0.00010854057858411537,
}  # fmt: skip
"""Those that are not 0: by channel, scale, norm (mean, fourth power), map (structure, added edges, lost)."""

LINEAR_SHARE, CUBE = 0.9562382616834844, (2.326765642916932, -0.020884521182843837, 6.248496625763138e-05)
POWER = 0.6276336467831387
"""From the weighted sum to a figure of at most 100."""


def ssimulacra2(a: npt.NDArray[np.uint8], b: npt.NDArray[np.uint8]) -> float | None:
    """Return SSIMULACRA2 of ``b`` against ``a``, sRGB of shape (height, width, 3).

    100: equal; 90: no visible difference; 50: an obvious one; below 0: a caricature. None: too small.
    """
    linear = [_linear_table()[image] for image in (a, b)]
    scales: list[npt.NDArray[np.float64]] = []
    smallest_side = 8  # smallest side of a scale [px]
    while len(scales) < SCALES and min(linear[0].shape[:2]) >= smallest_side:
        scales.append(_differences(*map(_opponent_colors, linear)))
        linear = [_halved(image) for image in linear]
    if not scales:
        return None
    # With fewer scales the weights are taken in the same order, as the reference does.
    terms = np.stack(scales, axis=1).reshape(-1)
    total = LINEAR_SHARE * sum(weight * terms[i] for i, weight in WEIGHTS.items() if i < len(terms))
    total = total * (CUBE[0] + total * (CUBE[1] + total * CUBE[2]))
    return float(100 - 10 * total**POWER) if total > 0 else 100.0


def _linear_table() -> Floats:
    """Return linear light for each level of sRGB."""
    levels = np.arange(256) / 255
    return np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _opponent_colors(linear: Floats) -> Floats:
    """Return an image in positive XYB, shape (height, width, 3)."""
    opsin_bias = 0.0037930732552754493
    cones = cv2.transform(linear, np.column_stack([OPSIN, np.full(3, opsin_bias)]))
    roots = np.cbrt(np.maximum(cones, 0))
    offset = XYB_OFFSET - XYB.sum(axis=1) * np.cbrt(opsin_bias)
    return np.asarray(cv2.transform(roots, np.column_stack([XYB, offset])), np.float32)


def _halved(image: Floats) -> Floats:
    """Return an image at half the size, by means of blocks; those of odd sides are smaller at the border."""
    height, width = image.shape[:2]
    even = cv2.copyMakeBorder(image, 0, height % 2, 0, width % 2, cv2.BORDER_REPLICATE)
    return np.asarray(cv2.resize(even, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.float32)


def _blurred(image: Floats) -> Floats:
    """Return the Gaussian blur; 0 lies beyond the left and right borders, reflections beyond the others."""
    wide = cv2.copyMakeBorder(image, 0, 0, RADIUS, RADIUS, cv2.BORDER_CONSTANT)
    soft = cv2.GaussianBlur(wide, (2 * RADIUS + 1,) * 2, SIGMA, borderType=cv2.BORDER_REFLECT)
    return np.asarray(soft[:, RADIUS:-RADIUS], np.float32)


def _differences(a: Floats, b: Floats) -> npt.NDArray[np.float64]:
    """Return mean and fourth-power mean of three maps of differences, shape (channel, norm, map)."""
    mean_a, mean_b = _blurred(a), _blurred(b)
    # In brackets as they are, so that equal images differ by exactly 0.
    variances = _blurred(a * a + b * b) - (mean_a * mean_a + mean_b * mean_b)
    covariance = _blurred(a * b) - mean_a * mean_b
    luminance = 1 - np.square(mean_a - mean_b)
    structure = 1 - luminance * (2 * covariance + C2) / (variances + C2)
    edges = (1 + np.abs(b - mean_b)) / (1 + np.abs(a - mean_a)) - 1
    norms = []
    for values in (structure, edges, -edges):
        positive = np.maximum(values, 0)
        power = np.square(np.square(positive))
        means = [np.reshape(cv2.mean(image)[:3], 3) for image in (positive, power)]
        norms.append([means[0], means[1] ** 0.25])
    return np.array(norms).transpose(2, 1, 0)
