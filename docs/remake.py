"""Make what the pages show, as far as it is out of date: ``python docs/remake.py [--images FOLDER]``.

The pictures and figures of the README, the tutorial, the presets and the gallery, from images of the
repository: ten minutes of processor time for all. With a folder of the images that are not ours to give
away, also the README's table (forty minutes) and the comparison (ten). ``--text`` makes nothing: it only
writes into the pages how old their figures are.
"""

from __future__ import annotations

from pathlib import Path

import click
import comparison
import gallery
import kodak
import pictures
import records


@click.command(help=__doc__.split("\n\n", maxsplit=1)[1].replace("``", ""))
@click.option("--text", is_flag=True, help="Only the pages' text.")
@click.option("--images", type=click.Path(path_type=Path, exists=True), help="Has kodim01.png and others.")
def main(*, text: bool, images: Path | None) -> None:
    """Make all groups, then fill the pages."""
    if not text:
        pictures.main()
        gallery.make_all()
        if images:
            kodak.main(next(images.rglob("kodim01.png")).parent)
            comparison.main(images)
    records.fill_pages()


if __name__ == "__main__":
    main()
