"""The gallery's pages in Markdown, made of its list and its records when the site is built (``hooks.py``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import records
from gallery import SUBJECTS, Entry, entries, licences

LEGENDS = {
    "photo": (
        "Photographs",
        "Shapes that overlap and are translucent, as brush strokes are, fitted by gradient descent.",
    ),
    "drawing": (
        "Drawings",
        "Logos, icons, emoji, flags: one opaque path a region, with true corners and straight lines.",
    ),
    "line": (
        "Line art",
        "Strokes along the middle of the ink, as plotters need them; with `--mixed`, filled areas stay so.",
    ),
    "pixel": ("Pixel art", "Cell by cell, without loss; cells may be of several pixels."),
}
"""Of each subject: its heading, and what is made of it."""

PHONE_COLUMNS = 38
"""Of a command, as wide as a phone shows it."""

INTRODUCTION = """# Gallery

What warpsplat makes of photographs, drawings, line art and pixel art, each with its command. Figures are
those of the files, as an independent renderer (resvg) shows them. Each picture leads to its image and its
figures, and from there to its report, where image and SVG lie under a slider.
"""

SOURCES = """# Pictures of the gallery

Images that others made, with their authors and licences as the packages state them in which they were
found, and how they were changed. The SVGs are made of them by the commands on the gallery's pages.
Copyright notices of those under the MIT licence are in [NOTICES.txt](NOTICES.txt). Who made an image has
nothing to do with this project.

| image | author | licence | source | changes |
|---|---|---|---|---|
"""


def pages() -> dict[str, str]:
    """Markdown by the names of the pages, below ``docs``."""
    listed = entries()
    made = {"gallery/index.md": index(listed), "gallery/sources.md": sources(listed)}
    for subject in SUBJECTS:
        heading, legend = LEGENDS[subject]
        cards = "\n".join(card(entry) for entry in listed if entry.subject == subject)
        made[f"gallery/{subject}.md"] = (
            f'# {heading}\n\n{legend}\n\n<div class="cards" markdown>\n{cards}</div>\n'
        )
    return made


def index(listed: Sequence[Entry]) -> str:
    """All pictures, small, by subject."""
    made = records.age(entry.figures() for entry in listed)
    parts = [f"{INTRODUCTION}\nMade by `python docs/remake.py`: {made}.\n"]
    for subject in SUBJECTS:
        heading, legend = LEGENDS[subject]
        parts.append(f'## [{heading}]({subject}.md)\n\n{legend}\n\n<div class="thumbnails" markdown>\n')
        parts += [
            f'[{picture(entry, "svg")}]({subject}.md#{entry.name}){{ title="{entry.title}" }}'
            for entry in listed
            if entry.subject == subject
        ]
        parts.append("</div>\n")
    parts.append("[Authors and licences of the images](sources.md)\n")
    return "\n".join(parts)


def card(entry: Entry) -> str:
    """An image beside its SVG, with the command and its figures."""
    credit = f"Image: {entry.author}, [{entry.licence}]({licences()[entry.licence]})"
    return f"""<div class="card" markdown>
### {entry.title} {{ #{entry.name} }}

<div class="pair" markdown>
[{picture(entry, "image")}]({entry.report}){{ title="Compare" }}
[{picture(entry, "svg")}]({entry.report}){{ title="Compare" }}
</div>

{entry.what}

```sh
{folded(entry.command)}
```

{" · ".join(figures(entry))} · [report]({entry.report})
{{ .figures }}

{credit}{", " + entry.changes if entry.changes else ""}
{{ .credit }}
</div>
"""


def picture(entry: Entry, which: str) -> str:
    """The image, or the SVG, of an entry."""
    path = entry.image if which == "image" else entry.svg
    alt = entry.title if which == "image" else f"{entry.title}, as SVG"
    style = {"pixel": ".pixels ", "photo": ".photograph "}.get(entry.subject, "")
    return f"![{alt}]({path.relative_to(entry.folder).as_posix()}){{ {style}loading=lazy }}"


def folded(command: str) -> str:
    """A command on two lines where one is too long for a phone."""
    return command if len(command) <= PHONE_COLUMNS else command.replace(" --", " \\\n  --", 1)


def figures(entry: Entry) -> Iterator[str]:
    """What the record says, in words."""
    record = entry.figures()
    psnr = record.get("psnr")
    yield "**without loss**" if psnr is None else f"**{psnr:.1f} dB**"
    yield f"{record['shapes']} shapes"
    yield f"{record['nodes']} nodes"
    yield size(record["bytes"])
    yield f"{record['seconds']:.2g} s of one core" if record["seconds"] >= 1 else "less than a second"


def size(count: int) -> str:
    """Bytes, for people."""
    return f"{count / 1000:.2g} kB" if count < 99_500 else f"{count / 1000:.0f} kB"


def sources(listed: Sequence[Entry]) -> str:
    """A table of where the images are from."""
    where = licences()
    rows = (
        (
            f"[{entry.title}]({entry.subject}.md#{entry.name})",
            entry.author,
            f"[{entry.licence}]({where[entry.licence]})",
            f"{entry.package}: `{entry.file}`" if entry.file else entry.package,
            entry.changes or "none",
        )
        for entry in listed
    )
    return SOURCES + "".join(f"| {' | '.join(row)} |\n" for row in rows)
