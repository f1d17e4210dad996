"""The API function ``warpsplat.report``."""

from __future__ import annotations

import os
from pathlib import Path

from warpsplat.files.output import write_result
from warpsplat.files.remote import path_of
from warpsplat.files.sources import ImageSource, held, source_name
from warpsplat.pages.reports.several import several_page, versions_of
from warpsplat.pages.reports.single import Facts, report_page
from warpsplat.run.arguments import backend_on
from warpsplat.run.result import Result
from warpsplat.run.svg import SvgSource, score, svg_name_of, text_of


def report(
    result: Result | SvgSource | list[Result] | tuple[Result, ...],
    image: ImageSource,
    output: str | os.PathLike[str] | None = None,
    *,
    command: str = "",
    name: str | None = None,
    svg_name: str | None = None,
    device: str = "auto",
    threads: int | None = None,
) -> str:
    """Return a page on a result for a browser: one self-contained file that needs no network.

    It shows image and SVG under a slider, an error map, the shapes with their contributions in decibels, the
    figures and the course of the run. Several results are compared.

    Args:
        result: result of ``vectorize`` or ``refine``; or any SVG, as for ``refine``, which is measured; or
            several results of one image, as from ``vectorize_several``.
        image: the image that it shows, as for ``vectorize``.
        output: file to write the page to; an existing one is replaced in one step.
        command: command that makes the result again, for people.
        name: name of the image, for people; default: its file's name.
        svg_name: file name of the download; default: the image's name with ``.svg``. With several results the
            numbers of shapes are added.
        device: where to compute, see ``vectorize``.
        threads: see ``vectorize``.

    Raises:
        ImageError: the image or the SVG cannot be read, or their proportions differ.
        OutputError: ``output`` cannot be written.
    """
    name = name or Path(source_name(image)).name
    svg_name = svg_name or Path(name).with_suffix(".svg").name
    if isinstance(result, (list, tuple)):
        made = several_page(versions_of(result, svg_name), image, name=name, command=command)
    else:
        if isinstance(result, Result):
            text, facts, own = result.svg, Facts.of(result, command), result.before is None
        else:
            text, image = text_of(result, svg_name_of(result)), held(image)
            facts, own = Facts(score(text, image).as_dict(), command=command), False
        with backend_on(device, threads) as backend:
            made = report_page(text, image, backend(), facts, name=name, svg_name=svg_name, own=own)
    if output is not None:
        write_result(path_of(output), made.encode())
    return made
