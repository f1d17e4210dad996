"""Numbers and elements as short texts."""

from __future__ import annotations

from collections.abc import Iterable


def text_of(number: float) -> str:
    """Return a number with up to two decimals."""
    text = f"{number:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text.replace("0.", ".", 1) if text.startswith(("0.", "-0.")) else text


def element_of(tag: str, attributes: Iterable[tuple[str, float]], degrees: float = 0.0) -> str:
    """Return an element, turned by ``degrees``; attributes that are 0, the default, are left out."""
    words = [tag, *(f'{name}="{text_of(value)}"' for name, value in attributes if text_of(value) != "0")]
    return " ".join([*words, f'transform="rotate({text_of(degrees)})"'] if text_of(degrees) != "0" else words)
