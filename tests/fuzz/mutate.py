"""Changes to bytes and to texts, drawn from a seeded generator: the same seed, the same input."""

from __future__ import annotations

import gzip
import random
import re
import struct
import zlib
from collections.abc import Callable

from tests.fuzz.vocabulary import NUMBERS

MOST = 200_000
"""Longest input that is made [bytes]."""

INTERESTING = (*range(4), *(2**n + d for n in (3, 4, 5, 7, 8, 12, 15, 16, 31, 32) for d in (-1, 0)))
"""Numbers at which behaviour often changes."""

Mutation = Callable[[random.Random, bytes, bytes], bytes]
"""(generator, input, another input) -> mutated input."""


def _place(rng: random.Random, data: bytes, width: int = 1) -> int:
    """Return a place in ``data``, more often in its header, where meaning is dense."""
    end = max(1, len(data) - width + 1)
    return rng.randrange(min(end, 64)) if rng.random() < 0.4 else rng.randrange(end)


def _flip(rng: random.Random, data: bytes, _: bytes) -> bytes:
    changed = bytearray(data)
    for _i in range(rng.choice((1, 1, 1, 2, 4, 16))):
        changed[_place(rng, data)] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _overwrite(rng: random.Random, data: bytes, _: bytes) -> bytes:
    width = rng.choice((1, 2, 4))
    value = rng.choice(INTERESTING) & (1 << 8 * width) - 1
    place = _place(rng, data, width)
    return data[:place] + value.to_bytes(width, rng.choice(("big", "little"))) + data[place + width :]


def _cut(rng: random.Random, data: bytes, _: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def _delete(rng: random.Random, data: bytes, _: bytes) -> bytes:
    place = _place(rng, data)
    return data[:place] + data[place + rng.choice((1, 2, 4, 16, 100)) :]


def _repeat(rng: random.Random, data: bytes, _: bytes) -> bytes:
    place = _place(rng, data)
    piece = data[place : place + rng.choice((1, 4, 16, 100))]
    return data[:place] + piece * rng.choice((2, 3, 50)) + data[place:]


def _insert(rng: random.Random, data: bytes, _: bytes) -> bytes:
    place = _place(rng, data)
    return data[:place] + rng.randbytes(rng.choice((1, 2, 4, 32))) + data[place:]


def _splice(rng: random.Random, data: bytes, other: bytes) -> bytes:
    return data[: _place(rng, data)] + other[_place(rng, other) :]


BYTES: tuple[Mutation, ...] = (_flip, _flip, _overwrite, _overwrite, _cut, _delete, _repeat, _insert, _splice)


def _png_chunks(data: bytes) -> list[tuple[bytes, bytes]]:
    chunks, place = [], 8
    while place + 8 <= len(data):
        (length,) = struct.unpack(">I", data[place : place + 4])
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + length]))
        place += 12 + length
    return chunks


def png(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Mutate a PNG's chunks and correct its checksums, so that the mutation gets past the first checks."""
    chunks = _png_chunks(data)
    if not chunks:
        return mutate_bytes(rng, data, other)
    place = rng.randrange(len(chunks))
    kind, body = chunks[place]
    action = rng.randrange(6)
    if action == 0:
        del chunks[place]
    elif action == 1:
        chunks.insert(rng.randrange(len(chunks) + 1), chunks[place])
    elif action == 2:
        kinds = b"tRNS", b"gAMA", b"iCCP", b"eXIf", b"PLTE", b"acTL", b"fdAT", b"zTXt"
        chunks[place] = (rng.choice(kinds), body)
    elif action == 3 and kind == b"IDAT":
        try:
            raw = zlib.decompress(body)
        except zlib.error:
            raw = body
        chunks[place] = (kind, zlib.compress(mutate_bytes(rng, raw, other), 1))
    elif body:
        chunks[place] = (kind, rng.choice(BYTES)(rng, body, other))
    packed = (struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks)
    return data[:8] + b"".join(packed)


def mutate_bytes(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Make one to a few changes, of any kind, anywhere."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        data = rng.choice(BYTES)(rng, data, other)[:MOST] if data else b"\0"
    return data


NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
WORD = re.compile(r"[A-Za-z][\w-]*")
ATTRIBUTE = re.compile(r"[\w:-]+\s*=\s*(?:\"[^\"]*\"|'[^']*')")
ELEMENT = re.compile(r"<[a-zA-Z][^<>]*/>|<([a-zA-Z]+)\b[^<>]*>[^<>]*</\1>")
TAG = re.compile(r"</?[a-zA-Z][^<>]*>")


def _replace(rng: random.Random, text: str, pattern: re.Pattern[str], new: Callable[[str], str]) -> str:
    """Return ``text`` with one match of ``pattern``, chosen at random, replaced."""
    matches = list(pattern.finditer(text))
    if not matches:
        return text
    found = rng.choice(matches)
    return text[: found.start()] + new(found[0]) + text[found.end() :]


def _number(rng: random.Random, text: str) -> str:
    return _replace(rng, text, NUMBER, lambda _: rng.choice(NUMBERS))


def _word(rng: random.Random, text: str, words: tuple[str, ...]) -> str:
    return _replace(rng, text, WORD, lambda _: rng.choice(words))


def _token_twice(rng: random.Random, text: str) -> str:
    count = rng.choice((2, 2, 3, 20))
    return _replace(rng, text, rng.choice((NUMBER, WORD, ATTRIBUTE)), lambda t: " ".join([t] * count))


def _snippet(rng: random.Random, text: str, snippets: tuple[str, ...]) -> str:
    place = rng.randrange(len(text) + 1)
    if rng.random() < 0.7:  # between two tags or at a line's start rather than in the middle of a word
        places = [m.end() for m in re.finditer(r">|\n", text)]
        place = rng.choice(places) if places else place
    return text[:place] + rng.choice(snippets) + text[place:]


def _element_gone(rng: random.Random, text: str) -> str:
    return _replace(rng, text, rng.choice((TAG, ELEMENT, ATTRIBUTE, WORD, NUMBER)), lambda _: "")


def _elements_many(rng: random.Random, text: str) -> str:
    return _replace(rng, text, ELEMENT, lambda e: e * rng.choice((2, 5, 100)))


def _nested(rng: random.Random, text: str) -> str:
    depth = rng.choice((2, 20, 200, 300, 1000, 3000))
    tag = rng.choice(("g", "g", "svg", "a", "switch", "symbol", "defs", "mask"))
    attributes = "", "", ' transform="scale(1e9)"', ' opacity=".9"', ' style="fill:red"', ' fill="#123"'
    given = rng.choice(attributes)
    return _replace(rng, text, ELEMENT, lambda e: f"<{tag}{given}>" * depth + e + f"</{tag}>" * depth)


def _attribute_moved(rng: random.Random, text: str) -> str:
    attributes = ATTRIBUTE.findall(text)
    return _replace(rng, text, ATTRIBUTE, lambda _: rng.choice(attributes)) if attributes else text


def _encoded(rng: random.Random, text: str) -> bytes:
    """Return bytes: in UTF-8, or sometimes in another encoding, packed, or with a false declaration."""
    if rng.random() < 0.93:
        return text.encode("utf-8", "surrogatepass")
    encodings = "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "utf-32", "cp037"
    name = rng.choice((*encodings, "gzip", "gzip", "declared"))
    if name == "gzip":
        packed = gzip.compress(text.encode("utf-8", "replace"), 1, mtime=0)
        return packed if rng.random() < 0.5 else mutate_bytes(rng, packed, packed)
    if name == "declared":
        claimed = rng.choice(("utf-16", "latin-1", "shift_jis", "rot13", "nonsense", "utf-7"))
        return f'<?xml version="1.0" encoding="{claimed}"?>\n{text}'.encode("utf-8", "replace")
    return f'<?xml version="1.0" encoding="{name}"?>\n{text}'.encode(name, "replace")


def mutate_text(
    rng: random.Random, data: bytes, other: bytes, words: tuple[str, ...], snippets: tuple[str, ...]
) -> bytes:
    """Make one to a few changes to tokens of a text (XML or YAML), or seldom to its bytes."""
    if rng.random() < 0.1:
        return mutate_bytes(rng, data, other)
    text = data.decode("utf-8", "replace")
    changes: tuple[Callable[[random.Random, str], str], ...] = (
        *(3 * (_number,)),
        *(2 * (lambda rng, text: _word(rng, text, words),)),
        *(2 * (lambda rng, text: _snippet(rng, text, snippets),)),
        *(_token_twice, _element_gone, _elements_many, _attribute_moved, _nested),
    )
    for _ in range(rng.choice((1, 1, 2, 2, 3, 5))):
        text = rng.choice(changes)(rng, text)[:MOST]
    return _encoded(rng, text)
