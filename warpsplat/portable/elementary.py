"""Elementary functions in float64, elementwise, accurate to a few units in the last place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Values = Any
"""A number or an array; results are float64 of the same shape."""

Result = npt.NDArray[np.float64]

LN2, LN10 = 0.6931471805599453, 2.302585092994046
"""Natural logarithms of 2 and 10."""

LN2_HIGH = float.fromhex("0x1.62e42feep-1")
LN2_LOW = float.fromhex("0x1.a39ef35793c76p-33")
"""The logarithm of 2 as a sum: products of the first part with whole numbers are exact."""

HALF_PI_PARTS = tuple(map(float.fromhex, ("0x1.921fb544p+0", "0x1.0b4611a6p-34", "0x1.3198a2e037073p-69")))
"""Half of pi as such a sum."""

EXP_MIN, EXP_MAX = -746.0, 710.0
"""Beyond these ``exp`` is 0 or infinite."""

EXP_TERMS = tuple(1 / math.factorial(k) for k in range(14, -1, -1))
LOG_TERMS = tuple(2 / (2 * k + 1) for k in range(11, 0, -1))
SIN_TERMS = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(8, 0, -1))
COS_TERMS = tuple((-1) ** k / math.factorial(2 * k) for k in range(9, 1, -1))
ATAN_TERMS = tuple((-1) ** k / (2 * k + 1) for k in range(13, 0, -1))
"""Coefficients of the power series, the highest power first."""

TAN_EIGHTH = float.fromhex("0x1.a827999fcef32p-2")
"""Tangent of an eighth of pi."""

TAN_SIXTEENTH, TAN_THREE_SIXTEENTHS = 0.198912367379658, 0.6681786379192989
"""Tangents at which the centre of the arctangent's series changes."""


def _polynomial(x: Result, terms: tuple[float, ...]) -> Result:
    """Return the value at ``x`` by Horner's rule."""
    value = np.full_like(x, terms[0])
    for term in terms[1:]:
        value = value * x + term
    return value


def exp(x: Values) -> Result:
    """Return e to the power ``x``."""
    x = np.clip(np.asarray(x, np.float64), EXP_MIN, EXP_MAX)
    whole = np.rint(x * (1 / LN2))
    rest = (x - whole * LN2_HIGH) - whole * LN2_LOW
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        return np.ldexp(_polynomial(rest, EXP_TERMS), np.nan_to_num(whole).astype(np.int32))


def log(x: Values) -> Result:
    """Return the natural logarithm of ``x``: -inf of 0, NaN of what is negative."""
    x = np.asarray(x, np.float64)
    mantissa, exponent = np.frexp(x)
    low = mantissa < math.sqrt(0.5)
    mantissa = np.where(low, 2 * mantissa, mantissa)
    power = exponent - low
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = (mantissa - 1) / (mantissa + 1)
    square = ratio * ratio
    rest = 2 * ratio + ratio * (square * _polynomial(square, LOG_TERMS))
    value = power * LN2_HIGH + (rest + power * LN2_LOW)
    return np.where(x > 0, np.where(np.isinf(x), np.inf, value), np.where(x == 0, -np.inf, np.nan))[()]


def log2(x: Values) -> Result:
    """Return the logarithm of ``x`` to base 2; exact for powers of 2."""
    mantissa, exponent = np.frexp(np.asarray(x, np.float64))
    exact = mantissa == 0.5
    with np.errstate(invalid="ignore"):
        return np.where(exact, exponent - 1.0, log(mantissa) * (1 / LN2) + exponent)[()]


def log10(x: Values) -> Result:
    """Return the logarithm of ``x`` to base 10."""
    return log(x) * (1 / LN10)


def power(base: Values, exponent: Values) -> Result:
    """Return ``base`` (0 or more) to the power ``exponent``; 0 to the power 0 is 1."""
    base, exponent = np.asarray(base, np.float64), np.asarray(exponent, np.float64)
    with np.errstate(invalid="ignore"):
        value = exp(exponent * log(base))
    return np.where(exponent == 0, 1.0, np.where(exponent == 1, base, value))[()]


def power_of_ten(exponent: int) -> float:
    """Return the number nearest to 10 to the power ``exponent``."""
    return float(f"1e{exponent}")


def _quarter_turns(x: Values) -> tuple[Result, Result]:
    """Split angles [radians] into whole quarter turns and a rest of at most an eighth of a turn."""
    x = np.asarray(x, np.float64)
    turns = np.rint(x * (2 / math.pi))
    for part in HALF_PI_PARTS:
        x = x - turns * part
    return turns % 4, x


def _sine(x: Result) -> Result:
    """Return the sine of ``x`` between -pi / 4 and pi / 4."""
    square = x * x
    return x + x * (square * _polynomial(square, SIN_TERMS))


def _cosine(x: Result) -> Result:
    """Return the cosine of ``x`` between -pi / 4 and pi / 4."""
    square = x * x
    return (1 - 0.5 * square) + square * square * _polynomial(square, COS_TERMS)


def sin(x: Values) -> Result:
    """Return the sine of ``x`` [radians, up to a million]."""
    quarter, rest = _quarter_turns(x)
    value = np.where(quarter % 2 == 0, _sine(rest), _cosine(rest))
    return np.where(quarter < 2, value, -value)[()]


def cos(x: Values) -> Result:
    """Return the cosine of ``x`` [radians, up to a million]."""
    quarter, rest = _quarter_turns(x)
    value = np.where(quarter % 2 == 0, _cosine(rest), _sine(rest))
    return np.where((quarter == 0) | (quarter == 3), value, -value)[()]


def tan(x: Values) -> Result:
    """Return the tangent of ``x`` [radians, up to a million]."""
    quarter, rest = _quarter_turns(x)
    above, below = _sine(rest), _cosine(rest)
    with np.errstate(divide="ignore"):
        return np.where(quarter % 2 == 0, above / below, -below / above)[()]


def arctan2(y: Values, x: Values) -> Result:
    """Return the angle [radians] of the point (x, y), from -pi to pi."""
    y, x = np.asarray(y, np.float64), np.asarray(x, np.float64)
    short, long = np.minimum(np.abs(x), np.abs(y)), np.maximum(np.abs(x), np.abs(y))
    ratio = short / np.where(long > 0, long, 1.0)
    middle, far = ratio > TAN_SIXTEENTH, ratio > TAN_THREE_SIXTEENTHS
    centre = np.where(far, 1.0, np.where(middle, TAN_EIGHTH, 0.0))
    base = np.where(far, math.pi / 4, np.where(middle, math.pi / 8, 0.0))
    rest = (ratio - centre) / (1 + ratio * centre)
    square = rest * rest
    angle = base + (rest + rest * (square * _polynomial(square, ATAN_TERMS)))
    angle = np.where(np.abs(y) > np.abs(x), math.pi / 2 - angle, angle)
    angle = np.where(np.signbit(x), math.pi - angle, angle)
    return np.copysign(angle, y)


def hypot(x: Values, y: Values) -> Result:
    """Return the length of the vector (x, y), whose square must be finite."""
    x, y = np.asarray(x), np.asarray(y)
    return np.sqrt(x * x + y * y)
