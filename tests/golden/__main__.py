"""Make the golden files: print their digests as JSON, keep the files, or update what the tests expect."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pytest

from tests.golden.cases import ALL_CASES, CASES, digest_of, text_of
from tests.lanes import divide_as_on_gpu

EXPECTED = Path(__file__).with_name("digests.json")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("cases", nargs="*", help="names of cases; default: all")
    parser.add_argument("--threads", type=int, help="CPU threads; default: the usual number")
    parser.add_argument("--device", default="cpu", help="default: cpu; others round differently")
    parser.add_argument("--gpu-lanes", action="store_true", help="divide tiles on the CPU as on a GPU")
    parser.add_argument("--save", type=Path, metavar="FOLDER", help="write the SVGs here as well")
    parser.add_argument(
        "--update", action="store_true", help=f"write {EXPECTED.name}, which the tests expect"
    )
    given = parser.parse_args()
    unknown = sorted(set(given.cases) - set(CASES))
    if unknown:
        parser.error(f"no such case: {', '.join(unknown)}")
    if given.save:
        given.save.mkdir(parents=True, exist_ok=True)
    if given.gpu_lanes:
        divide_as_on_gpu(pytest.MonkeyPatch())
    digests = {}
    for name in given.cases or CASES:
        svg = text_of(name, given.threads, given.device)
        digests[name] = digest_of(svg)
        print(json.dumps({name: digests[name]}), flush=True)
        if given.save:
            (given.save / f"{name}.svg").write_text(svg, encoding="utf-8")
    if given.update:
        known = json.loads(EXPECTED.read_text(encoding="utf-8")) if EXPECTED.exists() else {}
        kept = {name: digest for name, digest in {**known, **digests}.items() if name in ALL_CASES}
        EXPECTED.write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
