"""Cases: a changed input with the commands that take it; running them, and judging the outcomes."""

from __future__ import annotations

import itertools
import json
import os
import random
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from PIL import Image

from tests.forks import Forks, Outcome
from tests.fuzz import corpus
from tests.fuzz import vocabulary as words
from tests.fuzz.corpus import Seed
from tests.fuzz.mutate import mutate_bytes, mutate_png, mutate_text
from warpsplat.errors import ExitCode

Mutation = Callable[[random.Random, bytes, bytes], bytes]
"""(generator, input, another input) -> changed input."""

MAX_SECONDS = 10.0
"""Longest run on a small input, in processor time, which other programs do not lengthen [s]."""
PATIENCE = 100
"""Time after which a command is ended [s]."""
MAX_MEMORY, ADDRESSES = 2 << 30, 32 << 30
"""Most memory of a run, and most that it can allocate [bytes]."""

QUICK = ("--device", "cpu", "--curves", "4", "--iterations", "2")


@dataclass(frozen=True)
class Command:
    """A command line, and what is expected of it."""

    arguments: tuple[str, ...]
    codes: tuple[int, ...]
    """Exit codes that are right, besides 0 and ``RESOURCES``."""
    output: str = ""
    """File that exists, complete, if and only if the exit code is 0."""
    stdin: str = ""
    """File for the standard input."""


@dataclass(frozen=True)
class Case:
    """An input file and commands on it, run one after the other in a folder of their own."""

    target: str
    index: int
    seed: str
    """Name of the input that was mutated."""
    name: str
    """File name of the input."""
    data: bytes
    commands: tuple[Command, ...] = field(repr=False)


GOOD_IMAGE, GOOD_SVG = "good.picture", "good.svg"  # the former is not found in a folder given as a whole
FILES: dict[str, bytes] = {
    GOOD_IMAGE: corpus.saved(corpus.picture(), "PNG"),
    GOOD_SVG: corpus.own_svg("fill"),
    # Images of batch files: they fail, so that no case trains for long.
    "in/a.png": b"no image",
    "in/b.jpg": b"",
    "in/deep/c.gif": b"GIF89a",
    "in/é.png": b"\x89PNG\r\n\x1a\n",
}
"""Files in every case's folder, which must not change."""

INPUT, USAGE, MISSED = int(ExitCode.INPUT), int(ExitCode.USAGE), int(ExitCode.GOAL_MISSED)


def _image_commands(rng: random.Random, name: str) -> tuple[Command, ...]:
    given, stdin = ("-", name) if rng.random() < 0.05 else (name, "")
    commands = [Command(("eval", given, GOOD_SVG, "--json"), (INPUT,), stdin=stdin)]
    if rng.random() < 0.15:
        kind = rng.choice(words.FITS)
        fit = ("vectorize", name, "-o", "out.svg", *kind, *QUICK)
        if rng.random() < 0.2:
            fit = (*fit, "--report", "out.html")
        commands.append(Command(fit, (INPUT, USAGE, MISSED), "out.svg"))
    if rng.random() < 0.05:
        refine = ("refine", GOOD_SVG, name, "-o", "out2.svg", "--iterations", "1", "--device", "cpu")
        commands.append(Command(refine, (INPUT,), "out2.svg"))
    if rng.random() < 0.02:
        compare = ("compare", name, GOOD_IMAGE, "--against", "vtracer", "--json", *QUICK)
        commands.append(Command(compare, (INPUT, USAGE, int(ExitCode.SOME_FAILED))))
    return tuple(commands)


def _svg_commands(rng: random.Random, name: str) -> tuple[Command, ...]:
    keep = rng.choice(((), ("--keep",)))
    refine = ("refine", name, GOOD_IMAGE, "-o", "out.svg", "--iterations", "1", "--device", "cpu", *keep)
    given, stdin = ("-", name) if rng.random() < 0.05 else (name, "")
    all_of_them = (
        Command(("render", given, "-o", "out.png"), (INPUT,), "out.png", stdin),
        Command(("eval", GOOD_IMAGE, name), (INPUT,)),
        Command(refine, (INPUT,), "out.svg"),
    )
    if rng.random() < 0.1:
        report = ("eval", GOOD_IMAGE, name, "--report", "out.html")
        return (*all_of_them, Command(report, (INPUT,), "out.html"))
    return all_of_them


def _yaml_commands(rng: random.Random, name: str) -> tuple[Command, ...]:
    flags = rng.choice(((), ("--json",), ("-q",), ("-v",)))
    return (Command(("batch", name, *flags), (USAGE, int(ExitCode.SOME_FAILED)), output=""),)


def _changed_image(rng: random.Random, data: bytes, other: bytes) -> bytes:
    is_png = data.startswith(b"\x89PNG") and rng.random() < 0.6
    return (mutate_png if is_png else mutate_bytes)(rng, data, other)


@dataclass(frozen=True)
class Target:
    """A kind of input."""

    seeds: Callable[[], list[Seed]]
    change: Mutation
    commands: Callable[[random.Random, str], tuple[Command, ...]]


TARGETS = {
    "image": Target(corpus.images, _changed_image, _image_commands),
    "svg": Target(corpus.svgs, partial(mutate_text, words=words.SVG_WORDS), _svg_commands),
    "yaml": Target(corpus.yamls, partial(mutate_text, words=words.YAML_WORDS), _yaml_commands),
}


def cases_of(name: str, seed: str) -> Iterator[Case]:
    """Yield cases of a target without end; each depends on the seed and its number only."""
    target = TARGETS[name]
    inputs = target.seeds()
    for number in itertools.count():
        rng = random.Random(f"{seed} {number}")
        given, other = rng.choice(inputs), rng.choice(inputs)
        file = "case" + Path(given.name).suffix
        data = target.change(rng, given.data, other.data)
        yield Case(name, number, given.name, file, data, target.commands(rng, file))


def lay_out(case: Case, folder: Path) -> None:
    """Make an empty folder with the case's files."""
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in {**FILES, case.name: case.data}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def run_case(forks: Forks, case: Case, folder: Path) -> Iterator[tuple[Outcome, str]]:
    """Run a case's commands up to the first that goes wrong; yield each outcome and its fault, if any."""
    lay_out(case, folder)
    given = folder / case.name
    for command in case.commands:
        stdin = str(folder / command.stdin) if command.stdin else os.devnull
        how = {"stdin": stdin, "memory": ADDRESSES, "patience": PATIENCE}
        outcome = forks.outcome(command.arguments, folder, **how)
        fault = judge(command, outcome, folder)
        if not fault and given.read_bytes() != case.data:
            fault = "the input was changed"
        line = f"{case.target} {case.index} ({case.seed}): warpsplat {' '.join(command.arguments)}: {fault}"
        yield outcome, line if fault else ""
        if fault:
            return


LINE = re.compile(r"warpsplat: [^\x00-\x1f\x7f-\x9f]+\n?")
BATCH_LINE = re.compile(r"(warpsplat: |\[\d+/\d+\] |failed:|  |in/|case)[^\x00-\x1f\x7f-\x9f]*")


def judge(command: Command, outcome: Outcome, folder: Path) -> str:
    """Return what is wrong with the outcome, in a few words; empty: nothing is."""
    code = outcome.code
    if code < 0:
        return f"ended by signal {-code}"
    if "Traceback" in outcome.stderr:
        return f"traceback: {outcome.stderr.strip().splitlines()[-1][:150]}"
    if code not in (0, ExitCode.RESOURCES, *command.codes):
        return f"exit code {code}"
    message = _judge_messages(command, outcome)
    if message:
        return message
    if outcome.seconds > MAX_SECONDS:
        return f"took more than {MAX_SECONDS:g} s"
    if outcome.peak > MAX_MEMORY:
        return "over 2 GiB"
    return _judge_output(command, code, folder)


def _judge_messages(command: Command, outcome: Outcome) -> str:
    lines = outcome.stderr.splitlines(keepends=True)
    if command.arguments[0] == "batch" and outcome.code in (0, ExitCode.SOME_FAILED):
        given = outcome.stderr.rstrip("\n").split("\n")
        wrong = [line for line in given if line and not BATCH_LINE.fullmatch(line)]
        return f"odd line on stderr: {wrong[0][:100]!r}" if wrong else ""
    failed = outcome.code not in (0, ExitCode.GOAL_MISSED)  # a missed goal may have notes beside it
    if (failed and len(lines) > 1) or any(not LINE.fullmatch(line) for line in lines):
        return f"not one line on stderr: {outcome.stderr[:200]!r}"
    if outcome.code and not lines:
        return "failed without a word"
    if "--json" in command.arguments:
        return "" if _is_json(outcome.stdout) else f"no JSON on stdout: {outcome.stdout[:100]!r}"
    if failed and outcome.stdout:
        return "failed, and wrote to stdout"
    return ""


def _judge_output(command: Command, code: int, folder: Path) -> str:
    if command.output:
        path = folder / command.output
        made = code in (0, ExitCode.GOAL_MISSED)
        if path.exists() != made:
            return f"exit code {code}, and {command.output} is {'there' if path.exists() else 'missing'}"
        if made:
            if path.suffix == ".png":
                with Image.open(path) as image:
                    whole = bool(image.load())
            else:
                whole = path.read_bytes().rstrip().endswith(f"</{path.suffix[1:]}>".encode())
            # The copy of a foreign SVG that cannot be improved ends as that does.
            if not whole and command.arguments[0] != "refine":
                return f"{command.output} is not whole"
            path.unlink()
    for stray in folder.rglob(".*"):
        return f"left {stray.name}"
    for name, data in FILES.items():
        if (folder / name).read_bytes() != data:
            return f"{name} was changed"
    return ""


def _refused(name: str) -> None:
    raise ValueError(name)


def _is_json(text: str) -> bool:
    """Return whether a text is one JSON object, without NaN."""
    try:
        return isinstance(json.loads(text, parse_constant=_refused), dict)
    except ValueError:
        return False
