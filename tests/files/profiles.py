"""Colour profiles made by hand (ICC.1:2001-04)."""

from __future__ import annotations

import itertools
import struct

import numpy as np

D50 = (0.9642, 1.0, 0.8249)
DISPLAY_P3 = ((0.5151, 0.2412, -0.0011), (0.2920, 0.6922, 0.0419), (0.1571, 0.0666, 0.7841))
SRGB = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7139))
"""Red, green and blue in XYZ relative to D50."""


def _fixed(*values: float) -> bytes:
    return b"".join(struct.pack(">i", round(65536 * value)) for value in values)


def _xyz(values: tuple[float, float, float]) -> bytes:
    return b"XYZ \0\0\0\0" + _fixed(*values)


def _curve(samples: np.ndarray) -> bytes:
    levels = np.round(65535 * samples).astype(">u2")
    return b"curv\0\0\0\0" + struct.pack(">I", len(levels)) + levels.tobytes()


def _profile(kind: bytes, space: bytes, between: bytes, tags: dict[bytes, bytes]) -> bytes:
    text = b"made by hand\0"
    described = b"desc\0\0\0\0" + struct.pack(">I", len(text)) + text + bytes(78)
    tags = {b"desc": described, b"cprt": b"text\0\0\0\0none\0", b"wtpt": _xyz(D50), **tags}
    table, data = struct.pack(">I", len(tags)), b""
    start = 128 + 4 + 12 * len(tags)
    for name, content in tags.items():
        table += name + struct.pack(">II", start + len(data), len(content))
        data += content + bytes(-len(content) % 4)
    head = struct.pack(">I4sI4s4s4s", start + len(data), b"lcms", 0x02100000, kind, space, between)
    head += bytes(12) + b"acsp" + bytes(28) + _fixed(*D50)
    return head.ljust(128, b"\0") + table + data


def linear(encoded: np.ndarray) -> np.ndarray:
    """Return linear light of sRGB values."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def encoded(light: np.ndarray) -> np.ndarray:
    """Return sRGB values of linear light."""
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def rgb_profile(primaries: tuple[tuple[float, float, float], ...], curve: np.ndarray | None = None) -> bytes:
    """Return a screen's profile with sRGB's curve, or another one."""
    shape = _curve(linear(np.linspace(0, 1, 1024)) if curve is None else curve)
    tags = {name + b"XYZ": _xyz(xyz) for name, xyz in zip((b"r", b"g", b"b"), primaries, strict=True)}
    return _profile(b"mntr", b"RGB ", b"XYZ ", tags | {name + b"TRC": shape for name in (b"r", b"g", b"b")})


def grey_profile(gamma: float) -> bytes:
    """Return a profile of grey levels."""
    tags = {b"kTRC": _curve(np.linspace(0, 1, 1024) ** gamma)}
    return _profile(b"mntr", b"GRAY", b"XYZ ", tags)


def cmyk_profile() -> bytes:
    """Return the profile of a printer whose inks, all or nothing, are dark red (Lab: 30, 40, 20) or black."""
    lab = []
    for *inks, black in itertools.product((0, 1), repeat=4):
        wet = (30, 40, 20) if any(inks) else (100, 0, 0)
        lightness, a, b = (0, 0, 0) if black else wet
        lab += [round(255 * lightness / 100), 128 + a, 128 + b]
    ramp = bytes(range(256))
    table = b"mft1\0\0\0\0" + bytes((4, 3, 2, 0)) + _fixed(1, 0, 0, 0, 1, 0, 0, 0, 1)
    table += 4 * ramp + bytes(lab) + 3 * ramp
    return _profile(b"prtr", b"CMYK", b"Lab ", {name: table for name in (b"A2B0", b"A2B1")})
