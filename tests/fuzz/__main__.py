"""``python -m tests.fuzz --count 100000 --seed N``: a long run; exit code 1 if it finds anything."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.fuzz.campaign import Finding, campaign
from tests.fuzz.cases import TARGETS, Cases
from tests.fuzz.worker import Worker


def main() -> None:
    """Run cases, print the findings as they come and a summary at the end."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="number of cases")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other cases")
    parser.add_argument("--first", type=int, default=0, help="number of the first case, to see one again")
    parser.add_argument("--target", choices=["all", *TARGETS], default="all")
    parser.add_argument("--keep", type=Path, help="folder for the inputs of findings")
    given = parser.parse_args()

    def on_finding(finding: Finding) -> None:
        print(ascii(finding.line())[1:-1], flush=True)
        if given.keep:
            finding.save(given.keep)

    cases, numbers = Cases(given.seed, given.target), range(given.first, given.first + given.count)
    with Worker() as worker:
        tally = campaign(cases, numbers, worker, on_finding)
    print(tally.line())
    sys.exit(bool(tally.findings))


if __name__ == "__main__":
    main()
