"""How long the command line takes to say its help, and to refuse what it cannot do: seconds of CPU and of the clock.

python benchmarks/speed/startup.py [--runs RUNS]
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from statistics import median

import tyro

LINES = (
    "--help",
    "--version",
    "simulate --help",
    "estimat",
    "estimate none.parquet",
    "calibrate none.parquet",
    "diagnose none.parquet",
    "convert none.csv rec.parquet",
    "inspect none.csv",
    "replay none.parquet --save rec.rrd",
    "report none",
    "paper --payload z",
    "simulate --payload z --out rec.parquet",
    "simulate --effect rust --out new.parquet",
    "effects rust",
    "diagnose rec.parquet --exclude rust",
    "diagnose rec.parquet --model robot.xml --exclude rust",
    "estimate empty.parquet",
    "simulate --effect joint_friction:robot=0 --out new.parquet",
    "estimate log.h5",
)
"""The last ones need the names of causes or effects, their numbers, or look into the file."""


def cpu_s() -> float:
    """CPU time of all processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def main(runs: int = 5) -> None:
    """Print medians; the first run of each line, which has to compile modules, does not count."""
    print(f"{'CPU [s]':>8} {'clock [s]':>10}  mocobot ...")
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as compiled:
        for name in ("empty.parquet", "rec.parquet", "log.h5"):
            open(f"{folder}/{name}", "w").close()
        for line in LINES:
            taken = []
            for _ in range(runs + 1):
                before, start = cpu_s(), time.perf_counter()
                subprocess.run(
                    [sys.executable, "-m", "mocobot", *line.split()],
                    cwd=folder,
                    env=kept | {"PYTHONPYCACHEPREFIX": compiled},
                    capture_output=True,
                    check=False,
                )
                taken.append((cpu_s() - before, time.perf_counter() - start))
            cpu, clock = (median(values) for values in zip(*taken[1:], strict=True))
            print(f"{cpu:8.2f} {clock:10.2f}  {line}")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
