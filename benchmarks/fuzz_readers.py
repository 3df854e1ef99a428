"""Damage real logs of every format, and what else commands read: each must be read, or refused in one sentence.

Reading happens in a process of its own, so that a crash in a library counts as a fault and not as the end.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from pathlib import Path

import tyro

from fuzzing import FORMATS, KINDS, LONGEST_S, Outcome, check_original, try_damaged, write_original
from mocobot.progress import bar

AT_A_TIME = 500


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        runs: damaged logs, spread over the formats.
        seed: of the first one.
        formats: which, of logs and of what else is read; all logs if none is given.
        show: print so many of the refusals of each format, too.
        kept: file that outcomes are added to; what is in it is not done again, and counts.
    """

    runs: int = 2000
    seed: int = 0
    formats: tuple[str, ...] = FORMATS
    show: int = 0
    kept: Path | None = None


def main(options: Options) -> None:
    """Run, and print what happened; exit code 1 if a reader did what it must not."""
    each = -(-options.runs // len(options.formats))
    earlier = read(options.kept)
    counts: Counter[tuple[str, str]] = Counter()
    slowest: dict[str, float] = {}
    faults: list[Outcome] = []
    with bar(each * len(options.formats), "fuzzing", "log") as advance:
        for kind in options.formats:
            shown = 0
            for outcome in outcomes(kind, range(options.seed, options.seed + each), earlier, options.kept):
                counts[kind, outcome.result] += 1
                slowest[kind] = max(slowest.get(kind, 0.0), outcome.seconds)
                if outcome.is_fault:
                    faults.append(outcome)
                elif outcome.result == "refused" and shown < options.show:
                    shown += 1
                    print(outcome.detail)
                advance(1)
    print(f"{'format':18} {'read':>7} {'refused':>8} {'faults':>7} {'slowest':>9}")
    for kind in options.formats:
        wrong = sum(n for (k, result), n in counts.items() if k == kind and result not in ("read", "refused"))
        print(
            f"{kind:18} {counts[kind, 'read']:7} {counts[kind, 'refused']:8} {wrong:7} {slowest.get(kind, 0.0):7.2f} s"
        )
    for fault in faults[:20]:
        print(f"\n[[{fault.kind}, seed {fault.seed}: {fault.result}]]\n{fault.detail}")
    print(f"\n{sum(counts.values())} damaged logs, {len(faults)} faults")
    sys.exit(bool(faults))


def read(kept: Path | None) -> dict[tuple[str, int], Outcome]:
    """Outcomes of earlier runs."""
    lines = kept.read_text(encoding="utf-8").splitlines() if kept and kept.is_file() else []
    done = (Outcome(**json.loads(line)) for line in lines)
    return {(outcome.kind, outcome.seed): outcome for outcome in done}


def outcomes(
    kind: str, seeds: range, earlier: Mapping[tuple[str, int], Outcome], kept: Path | None
) -> Iterator[Outcome]:
    """Outcomes of one format, those of earlier runs first."""
    yield from (earlier[kind, seed] for seed in seeds if (kind, seed) in earlier)
    for outcome in run(kind, [seed for seed in seeds if (kind, seed) not in earlier]):
        if kept:
            with kept.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(outcome)) + "\n")
        yield outcome


def run(kind: str, seeds: Sequence[int]) -> Iterator[Outcome]:
    """Outcomes of damaged logs of one format, in the order of the seeds."""
    context = multiprocessing.get_context("spawn")
    todo = list(seeds)
    while todo:
        ours, theirs = context.Pipe(duplex=False)
        batch = todo[:AT_A_TIME]
        process = context.Process(target=_work, args=(kind, batch, theirs), daemon=True)
        process.start()
        theirs.close()
        try:
            ours.recv()
        except EOFError:
            raise SystemExit(f"a good file of kind {kind!r} is not read") from None
        done = 0
        try:
            while ours.poll(None if done else LONGEST_S + 60):
                yield ours.recv()
                done += 1
        except EOFError:
            pass
        process.join(LONGEST_S)
        if done < len(batch):
            process.kill()
            yield Outcome(kind, batch[done], "died", f"with exit code {process.exitcode}")
            done += 1
        todo = todo[done:]


def _work(kind: str, seeds: list[int], results: Connection) -> None:
    with tempfile.TemporaryDirectory() as folder:
        if kind in KINDS:
            log = file = Path(folder) / KINDS[kind].name
            KINDS[kind].write(file)
        else:
            log, file = write_original(kind, Path(folder))
        content = file.read_bytes()
        check_original(kind, log)
        results.send("read")
        for seed in seeds:
            results.send(try_damaged(kind, log, file, content, seed))
    results.close()


if __name__ == "__main__":
    main(tyro.cli(Options))
