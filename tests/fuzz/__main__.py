"""``python -m tests.fuzz --count 100000 --seed N``: a long run; exit code 1 if it finds anything."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.fuzz.campaign import campaigns
from tests.fuzz.cases import TARGETS, Cases


def main() -> None:
    """Run and print a summary of each worker."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="cases")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case, to see one again")
    parser.add_argument("--target", choices=["all", *TARGETS], default="all")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the inputs of findings")
    given = parser.parse_args()
    tallies = campaigns(
        Cases(given.seed, given.target),
        range(given.first, given.first + given.count),
        given.workers,
        given.keep,
        lambda text: print(ascii(text)[1:-1], flush=True),
    )
    print(*(tally.line() for tally in tallies), sep="\n")
    sys.exit(any(tally.findings for tally in tallies))


if __name__ == "__main__":
    main()
