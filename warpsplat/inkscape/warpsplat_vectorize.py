"""org.warpsplat.vectorize: put vectors above the selected bitmaps of a document.

Inkscape runs this file alone, with its own Python, 3.8 or newer: only the standard library is there. It gives
the document as a file, reads the changed one from stdout, and shows what is on stderr.
"""

from __future__ import annotations

import argparse
import base64
import contextlib
import itertools
import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote_to_bytes, urlsplit
from urllib.request import url2pathname
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

COMMAND = ["warpsplat"]
"""Arguments that start warpsplat; set by ``warpsplat inkscape``."""

FOLDER = "."
"""Where it is started: the folder that has the package; set by ``warpsplat inkscape``."""

SVG, XLINK = "{http://www.w3.org/2000/svg}", "{http://www.w3.org/1999/xlink}"
ABSOLUTE_PATH = "{http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd}absref"

UNITS = {"": 1, "px": 1, "pt": 4 / 3, "pc": 16, "in": 96, "cm": 96 / 2.54, "mm": 96 / 25.4, "q": 96 / 101.6}
"""User units to a unit."""

KEPT = ("transform", "style", "class", "clip-path", "mask", "filter", "opacity", "display", "visibility")
"""Attributes of an image that its vectors have too."""

PLAIN = (
    "fill:#000;fill-opacity:1;fill-rule:nonzero;stroke:none;stroke-opacity:1;stroke-width:1;"
    "stroke-linecap:butt;stroke-linejoin:miter;stroke-miterlimit:4;stroke-dasharray:none"
)
"""Against what groups around the image hand down to its vectors."""

GOAL_MISSED = 6
"""Exit code if the time limit was missed; the result is there."""

GRACE = 120
"""Time over the limit after which the program is ended: it may have to compile [s]."""


def main() -> None:
    """Read the document that Inkscape names, and print it with the vectors."""
    parser = argparse.ArgumentParser()
    parser.add_argument("document")
    parser.add_argument("--id", action="append", default=[])
    parser.add_argument("--time-budget", type=int, default=0)
    parser.add_argument("--colors", type=int, default=0)
    parser.add_argument("--detail", type=float, default=0.5)
    parser.add_argument("--subject", default="auto")
    parser.add_argument("--strokes", default="false")
    given = parser.parse_known_args()[0]
    root = read(given.document)
    chosen = [element for element in root.iter() if element.get("id") in given.id]
    images = dict.fromkeys(image for element in chosen for image in element.iter(f"{SVG}image"))
    if not images:
        sys.exit("Select a bitmap first.")
    options = [f"--subject={given.subject}", f"--detail={given.detail}"]
    options += [f"--colors={given.colors}"] if given.colors else []
    options += ["--strokes"] if given.strokes == "true" else []
    options += [f"--time-budget={given.time_budget}s"] if given.time_budget else []
    limit = given.time_budget + GRACE if given.time_budget else None
    parents = {child: parent for parent in root.iter() for child in parent}
    for image in images:
        name = image.get("id", "image")
        try:
            vectors = ElementTree.fromstring(vectorized(data_of(image, given.document), options, limit))
            made = group(image, vectors, unused(f"{name}-vectors", root), viewport(image, parents))
        except (OSError, ValueError, subprocess.SubprocessError) as error:
            sys.exit(f"{name}: {error}")
        siblings = parents[image]
        siblings.insert(list(siblings).index(image) + 1, made)
    sys.stdout.buffer.write(ElementTree.tostring(root, encoding="utf-8"))


def read(document: str) -> Element:
    """Return the root of a document; the prefixes of its namespaces are kept for writing."""
    for _, (prefix, uri) in ElementTree.iterparse(document, ["start-ns"]):
        with contextlib.suppress(ValueError):  # ns0 and the like, which are made when it is written
            ElementTree.register_namespace(prefix, uri)
    ElementTree.register_namespace("", SVG.strip("{}"))
    keeping = ElementTree.TreeBuilder(insert_comments=True, insert_pis=True)
    return ElementTree.parse(document, ElementTree.XMLParser(target=keeping)).getroot()


def data_of(image: Element, document: str) -> bytes:
    """Return the bitmap's file, embedded or linked.

    Raises:
        ValueError: There is none, or it is damaged.
    """
    link = image.get("href") or image.get(f"{XLINK}href") or ""
    if link.startswith("data:"):
        head, _, body = link.partition(",")
        data = unquote_to_bytes(body)
        return base64.b64decode(data) if head.endswith("base64") else data
    path = url2pathname(urlsplit(link).path)
    # Inkscape links from the file that it made for this run, earlier versions from the document itself.
    folders = (Path(document).parent, Path(os.environ.get("DOCUMENT_PATH", document)).parent)
    for found in [*(folder / path for folder in folders), Path(image.get(ABSOLUTE_PATH, ""))]:
        if found.is_file():
            return found.read_bytes()
    raise ValueError(f"there is no file {link}")


def vectorized(data: bytes, options: list[str], limit: float | None) -> bytes:
    """Return the SVG that warpsplat makes of a bitmap.

    Raises:
        ValueError: It cannot; the message is its own.
        OSError: It cannot be started.
        subprocess.SubprocessError: It took longer than ``limit`` [s].
    """
    # Inkscape's libraries are not for another Python.
    others = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PYTHON") and name != "LD_LIBRARY_PATH"
    }
    done = subprocess.run(
        [*COMMAND, "vectorize", "-", "--output=-", "--quiet", *options],
        input=data,
        capture_output=True,
        cwd=FOLDER,
        env=others,
        timeout=limit,
        check=False,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )
    if done.returncode not in {0, GOAL_MISSED}:
        raise ValueError(done.stderr.decode("utf-8", "replace").strip())
    return done.stdout


def viewport(element: Element, parents: dict[Element, Element]) -> tuple[float, float]:
    """Return the width and height that an element's percentages are of [user units]."""
    outer = parents.get(element)
    while outer is not None and outer.tag != f"{SVG}svg":
        outer = parents.get(outer)
    if outer is None:
        return 100, 100
    if outer.get("viewBox"):
        return view_box(outer)
    width, height = viewport(outer, parents)
    return length(outer.get("width", "100%"), width), length(outer.get("height", "100%"), height)


def view_box(element: Element) -> tuple[float, float]:
    """Return the width and height of an element's view box."""
    numbers = re.split(r"[\s,]+", element.get("viewBox", "").strip())
    return float(numbers[2]), float(numbers[3])


def length(text: str, whole: float) -> float:
    """Return a length in user units; percentages are of ``whole``.

    Raises:
        ValueError: It has another unit.
    """
    found = re.fullmatch(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)(%|[a-z]*)\s*", text.lower())
    units = {**UNITS, "%": whole / 100}
    if not found or found[2] not in units:
        raise ValueError(f"{text} is no length that can be used here")
    return float(found[1]) * units[found[2]]


def group(image: Element, vectors: Element, name: str, whole: tuple[float, float]) -> Element:
    """Return a group of the vectors, at the image's place, with its size, transform, clip and opacity.

    Args:
        image: The image.
        vectors: A file of warpsplat.
        name: What all identifiers begin with.
        whole: What percentages are of.
    """
    outer = Element(f"{SVG}g", {key: image.attrib[key] for key in KEPT if key in image.attrib}, id=name)
    inner = SubElement(outer, f"{SVG}g", style=PLAIN)
    inner.extend(list(vectors))
    rename(inner, name)
    pixels = float(vectors.attrib["width"]), float(vectors.attrib["height"])
    x, y, width, height = box(image, pixels, whole)
    view = view_box(vectors)
    align, _, fit = image.get("preserveAspectRatio", "xMidYMid").partition(" ")
    scales = width / view[0], height / view[1]
    if align != "none":
        scales = ((max if fit.strip() == "slice" else min)(scales),) * 2
    share = {"Min": 0.0, "Max": 1.0}
    left = x + (width - view[0] * scales[0]) * share.get(align[1:4], 0.5)
    top = y + (height - view[1] * scales[1]) * share.get(align[5:], 0.5)
    inner.set("transform", f"matrix({scales[0]:.9g} 0 0 {scales[1]:.9g} {left:.9g} {top:.9g})")
    if fit.strip() == "slice":
        inner.set("clip-path", f"url(#{name}-box)")
        clip = SubElement(outer, f"{SVG}clipPath", id=f"{name}-box")
        corner = {"x": f"{(x - left) / scales[0]:.9g}", "y": f"{(y - top) / scales[1]:.9g}"}
        size = {"width": f"{width / scales[0]:.9g}", "height": f"{height / scales[1]:.9g}"}
        SubElement(clip, f"{SVG}rect", {**corner, **size})
    return outer


def box(
    image: Element, pixels: tuple[float, float], whole: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Return left, top, width and height of an image [user units]; a missing size follows from its pixels."""
    x, y = length(image.get("x", "0"), whole[0]), length(image.get("y", "0"), whole[1])
    width, height = image.get("width", "auto"), image.get("height", "auto")
    if "auto" not in (width, height):
        return x, y, length(width, whole[0]), length(height, whole[1])
    scale = 1.0
    if width != "auto":
        scale = length(width, whole[0]) / pixels[0]
    elif height != "auto":
        scale = length(height, whole[1]) / pixels[1]
    return x, y, pixels[0] * scale, pixels[1] * scale


def unused(name: str, root: Element) -> str:
    """Return ``name``, with a number if identifiers of the document begin with it."""
    taken = [element.get("id", "") for element in root.iter()]
    names = itertools.chain([name], (f"{name}{number}" for number in itertools.count(2)))
    return next(one for one in names if not any(other.startswith(one) for other in taken))


def rename(inner: Element, name: str) -> None:
    """Put ``name`` in front of all identifiers in a group, and of references to them."""
    for element in inner.iter():
        for key, value in element.attrib.items():
            if key == "id":
                element.set(key, f"{name}-{value}")
            elif key in {"href", f"{XLINK}href"}:
                element.set(key, re.sub("^#", f"#{name}-", value))
            else:
                element.set(key, value.replace("url(#", f"url(#{name}-"))


if __name__ == "__main__":
    main()
