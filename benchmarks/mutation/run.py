"""Change the code at random and see whether the tests notice.

    python benchmarks/mutation/run.py --count 100              the first hundred changes of a random order
    python benchmarks/mutation/run.py --skip 100 --count 100   the next hundred
    python benchmarks/mutation/run.py --again                  those of the first hundred that survived, once more

Needs ``pytest-cov``. All tests run once under coverage; each change is then made in a copy of the tree, and the tests
that cover it run, the fastest first. What was found is added to ``found.jsonl``; changes in it are not made again.
"""

from __future__ import annotations

import json
import os
import random
import sys
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import tyro

from mutation.covering import PACKAGES, Tests
from mutation.mutants import all_mutants

ALIVE = ("survived", "not covered")


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        count: changes to make.
        skip: changes of the order to leave out before them.
        seed: of the order.
        work: folder of the copy, of what covers what, and of what was found.
        most_s: seconds that the tests of one change may need, as they needed under coverage.
        again: run those of the same changes that survived again.
        fresh: look again which tests cover what.
    """

    count: int = 100
    skip: int = 0
    seed: int = 0
    work: Path = Path("/tmp/mutation")
    most_s: float = 600.0
    again: bool = False
    fresh: bool = False


def main(options: Options) -> None:
    tests, store = Tests(options.work, options.most_s, options.fresh), options.work / "found.jsonl"
    found = {}
    for line in store.read_text().splitlines() if store.exists() else ():
        one = json.loads(line)
        found[one["place"]] = one
    order = all_mutants(tests.copy, PACKAGES, random.Random(options.seed))
    chosen = order[options.skip : options.skip + options.count]
    code, printed = tests.run(next(filter(None, map(tests.covering, chosen)))[:20])
    if code:  # or every change would be told
        sys.exit(f"tests fail without any change: {printed}")
    print(f"{len(order)} changes")
    counts: Counter[str] = Counter()
    survivors = []
    for mutant in chosen:
        place = mutant.place()
        if place not in found or (options.again and found[place]["verdict"] in ALIVE):
            start = time.monotonic()
            verdict, words, diff = tests.verdict(mutant)
            seconds = round(time.monotonic() - start, 1)
            found[place] = dict(place=place, verdict=verdict, seconds=seconds, words=words, diff=diff)
            with store.open("a") as file:
                file.write(json.dumps(found[place]) + "\n")
            print(f"{verdict:12s} {seconds:6.1f} s  {place[:120]}  {words}", flush=True)
        counts[found[place]["verdict"]] += 1
        if found[place]["verdict"] in ALIVE:
            survivors.append(found[place]["diff"])
    print(*survivors, ", ".join(f"{n} {verdict}" for verdict, n in counts.items()), sep="\n")


if __name__ == "__main__":
    main(tyro.cli(Options))
