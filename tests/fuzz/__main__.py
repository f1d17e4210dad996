"""``python -m tests.fuzz --count 100000 --seed N``: a long run; exit code 1 if it finds anything."""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
from pathlib import Path

from tests.forks import Forks
from tests.fuzz.cases import TARGETS, Cases, run_case


def main() -> None:
    """Run cases, print the findings as they come and a summary at the end."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="number of cases")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case, to see one again")
    parser.add_argument("--target", choices=["all", *TARGETS], default="all")
    parser.add_argument("--keep", type=Path, help="folder for the inputs of findings")
    given = parser.parse_args()
    cases, codes, findings = Cases(given.seed, given.target), [], 0
    with tempfile.TemporaryDirectory() as scratch, contextlib.closing(Forks(Path(scratch))) as forks:
        for number in range(given.first, given.first + given.count):
            case = cases[number]
            for outcome, fault in run_case(forks, case, Path(scratch, "deep", "down", "case")):
                codes.append(outcome.code)
                if fault:
                    findings += 1
                    print(ascii(fault)[1:-1], flush=True)
                    if given.keep:
                        given.keep.mkdir(parents=True, exist_ok=True)
                        name = f"{case.target}-{case.index}{Path(case.name).suffix}"
                        (given.keep / name).write_bytes(case.data)
    print(f"{len(codes)} commands ({codes.count(0)} accepted), {findings} findings")
    sys.exit(bool(findings))


if __name__ == "__main__":
    main()
