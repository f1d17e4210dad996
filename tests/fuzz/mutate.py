"""Change bytes and texts, with a seeded generator: the same seed, the same input."""

from __future__ import annotations

import gzip
import random
import re
import struct
import zlib

from tests.fuzz.vocabulary import NUMBERS

MOST = 200_000
"""Longest input that is made [bytes]."""

INTERESTING = (*range(4), *(2**n + d for n in (3, 4, 5, 7, 8, 12, 15, 16, 31, 32) for d in (-1, 0)))
"""Numbers at which behaviour often changes."""

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")
WORD = re.compile(r"[A-Za-z][\w-]*")
ATTRIBUTE = re.compile(r"[\w:-]+\s*=\s*(?:\"[^\"]*\"|'[^']*')")
ELEMENT = re.compile(r"<[a-zA-Z][^<>]*/>|<([a-zA-Z]+)\b[^<>]*>[^<>]*</\1>")
TAG = re.compile(r"</?[a-zA-Z][^<>]*>")
PLACE = re.compile(r"(?<=[>\n])")
"""Between two tags, or at the start of a line."""

NESTS = (
    "<g>",
    '<g transform="scale(1e9)">',
    '<svg opacity=".9">',
    "<a>",
    "<switch>",
    "<symbol>",
    "<defs>",
    "<mask>",
)


def mutate_bytes(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Make one to a few changes, of any kind, anywhere; ``other``: another input, to take a part of."""
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        data = _change_bytes(rng, data, other)[:MOST] if data else b"\0"
    return data


def _change_bytes(rng: random.Random, data: bytes, other: bytes) -> bytes:
    # More often in the header, where meaning is dense.
    place = rng.randrange(min(len(data), 64) if rng.random() < 0.4 else len(data))
    width = rng.choice((1, 2, 4, 16, 100))
    piece, rest = data[place : place + width], data[place + width :]
    match rng.choice(["flip", "flip", "number", "number", "cut", "delete", "repeat", "insert", "splice"]):
        case "flip":
            piece = bytes([piece[0] ^ 1 << rng.randrange(8)]) + piece[1:]
        case "number":
            size = min(len(piece), 4)
            value = rng.choice(INTERESTING) % (1 << 8 * size)
            piece = value.to_bytes(size, rng.choice(("big", "little"))) + piece[size:]
        case "cut":
            piece = rest = b""
        case "delete":
            piece = b""
        case "repeat":
            piece *= rng.choice((2, 3, 50))
        case "insert":
            piece = rng.randbytes(width) + piece
        case "splice":
            piece, rest = b"", other[rng.randrange(len(other)) :]
    return data[:place] + piece + rest


def mutate_png(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Change a PNG's chunks and correct the checksums, so that the changes get past the first checks."""
    chunks, place = [], 8
    while place + 8 <= len(data):
        (length,) = struct.unpack(">I", data[place : place + 4])
        chunks.append((data[place + 4 : place + 8], data[place + 8 : place + 8 + length]))
        place += 12 + length
    place = rng.randrange(len(chunks))
    kind, body = chunks[place]
    if kind == b"IDAT" and rng.random() < 0.7:
        new = [(kind, zlib.compress(mutate_bytes(rng, zlib.decompress(body), other), 1))]
    else:
        kinds = b"tRNS", b"gAMA", b"iCCP", b"eXIf", b"PLTE", b"acTL", b"fdAT", b"zTXt"
        changed = (kind, mutate_bytes(rng, body, other))
        new = rng.choice(([], 2 * [(kind, body)], [(rng.choice(kinds), body)], [changed], [changed]))
    chunks[place : place + 1] = new
    packed = (struct.pack(">I", len(b)) + k + b + struct.pack(">I", zlib.crc32(k + b)) for k, b in chunks)
    return data[:8] + b"".join(packed)


def mutate_text(rng: random.Random, data: bytes, other: bytes, words: tuple[str, ...]) -> bytes:
    """Change tokens of a text (XML or YAML), or seldom its bytes or its encoding."""
    if rng.random() < 0.1:
        return mutate_bytes(rng, data, other)
    text = data.decode("utf-8", "replace")
    for _ in range(rng.choice((1, 1, 2, 2, 3, 5))):
        text = _change_token(rng, text, words)[:MOST]
    if rng.random() < 0.93:
        return text.encode("utf-8", "surrogatepass")
    name = rng.choice(["gzip", "utf-8-sig", "utf-16", "utf-16-le", "latin-1", "utf-32", "cp037", "utf-8"])
    if name == "gzip":
        packed = gzip.compress(text.encode("utf-8", "replace"), 1, mtime=0)
        return packed if rng.random() < 0.5 else mutate_bytes(rng, packed, packed)
    declared = rng.choice([name, "utf-16", "shift_jis", "rot13", "nonsense", "utf-7"])
    return f'<?xml version="1.0" encoding="{declared}"?>\n{text}'.encode(name, "replace")


def _change_token(rng: random.Random, text: str, words: tuple[str, ...]) -> str:
    """Replace, remove, repeat or wrap one token, or insert one of ``words``."""
    pattern = rng.choice((NUMBER, NUMBER, NUMBER, WORD, WORD, ATTRIBUTE, ELEMENT, TAG, PLACE, PLACE))
    tokens = list(pattern.finditer(text))
    if not tokens:
        return text
    found = rng.choice(tokens)
    token, new = found[0], rng.choice(tokens)[0]
    if pattern is NUMBER:
        new = rng.choice(NUMBERS)
    elif pattern in (WORD, PLACE):
        new = rng.choice(words)
    elif pattern is ELEMENT:
        start, depth = rng.choice(NESTS), rng.choice((2, 20, 200, 300, 1000, 3000))
        new = start * depth + token + f"</{start.strip('<>').split()[0]}>" * depth
    new = rng.choice((new, new, new, "", " ".join([token] * rng.choice((2, 3, 20, 100)))))
    return text[: found.start()] + new + text[found.end() :]
