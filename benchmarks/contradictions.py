"""Do the robots contradict each other? What is left over, in noise, of healthy and of poorly calibrated teams.

    python benchmarks/contradictions.py [--teams 2] [--rates 50 80 250]

Every team makes a random, a periodic and a static trial; ``nominal`` ones also go through ``convert`` at the rates. Of
each recording the largest of flange position, flange rotation, force and moment counts (docs/method.md).
"""

import argparse
import tempfile
from collections import defaultdict
from pathlib import Path

import mocobot
from estimator.estimate.leftover import CONTRADICTS
from mocobot_logs.convert import write_converted

SHORT = {"random": {"vias": 16}, "periodic": {"duration_s": 20.0}, "static": {}}


def main() -> None:
    """Simulate, estimate, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--teams", type=int, default=2, help="of every payload")
    parser.add_argument("--rates", type=float, nargs="*", default=[50.0, 80.0, 250.0], help="of convert [Hz]")
    options = parser.parse_args()
    ratios: dict[str, list[float]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        for payload in "abcd":
            for seed in range(options.teams):
                for preset in ("ideal", "nominal", "uncalibrated"):
                    for trial, length in SHORT.items():
                        made = mocobot.simulate(payload, trial, preset=preset, seed=seed, **length)
                        ratios[preset].append(largest(made))
                        if preset == "nominal":
                            write_converted(made, log)
                            for rate in options.rates:
                                again = mocobot.convert(log, rate_hz=rate).recording
                                ratios[f"nominal, convert --rate {rate:g}"].append(largest(again))
    print(f"{'':<28} recordings  least   most  beyond {CONTRADICTS:g}")
    for name, found in ratios.items():
        beyond = sum(ratio > CONTRADICTS for ratio in found)
        print(f"{name:<28} {len(found):>10} {min(found):>6.2f} {max(found):>6.2f} {beyond:>9}")


def largest(recording: mocobot.Recording) -> float:
    """The largest of what is left over, in noise."""
    (alone,) = mocobot.estimate([recording]).recordings
    return max(one.ratio for one in alone.leftovers)


if __name__ == "__main__":
    main()
