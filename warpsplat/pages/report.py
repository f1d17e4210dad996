"""``warpsplat.report``."""

from __future__ import annotations

import os
from pathlib import Path

from warpsplat.files.output import write_result
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
    """A page on a result, to look at in a browser: one file that needs nothing else and no network.

    It shows image and SVG under a slider, where they differ, the shapes with the decibels that each is worth,
    the figures and the course of the run. Of several results it compares these.

    Args:
        result: what ``vectorize`` or ``refine`` made; or any SVG, as for ``refine``, which is measured; or
            several results of one image, as ``vectorize_several`` makes them.
        image: that it shows, as for ``vectorize``.
        output: file to write the page to; an existing one is replaced in one step.
        command: what makes the result again, for people.
        name: of the image, for people; default: its file's name.
        svg_name: that the SVG is downloaded as; default: the image's name with ``.svg``. Those of several
            results have their numbers of shapes in their names.
        device: where to compute, see ``vectorize``.
        threads: see there.

    Returns:
        the page.

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
            made = report_page(text, image, backend, facts, name=name, svg_name=svg_name, own=own).text
    if output is not None:
        write_result(Path(output), made.encode())
    return made
