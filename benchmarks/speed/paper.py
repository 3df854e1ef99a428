"""Wall time of `mocobot paper` with one and with two processes: python benchmarks/speed/paper.py [OPTIONS]

--quick runs one payload with two random trials instead of the whole experiment, --staged-only leaves the fits beside
the paper's own method out.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

from mocobot_sim.paper.experiment import PaperPlan, run_paper


def main() -> None:
    """Print the wall times and their ratio."""
    plan = PaperPlan(payloads=("a",), trials=2) if "--quick" in sys.argv[1:] else PaperPlan()
    plan = replace(plan, staged_only="--staged-only" in sys.argv[1:])
    run_paper(
        PaperPlan(payloads=("a",), presets=("ideal",), trials=1, vias=2, duration_s=8.0)
    )  # compile, warm up
    seconds = {}
    for jobs in (2, 1):
        start = time.perf_counter()
        run_paper(plan, jobs)
        seconds[jobs] = time.perf_counter() - start
        print(f"{jobs} process{'es' * (jobs > 1)}: {seconds[jobs]:6.1f} s", flush=True)
    print(f"speed-up: {seconds[1] / seconds[2]:.2f}")


if __name__ == "__main__":
    main()
