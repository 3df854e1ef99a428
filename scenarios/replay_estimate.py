"""Simulate uncalibrated robots with payload (b), and write a replay that shows estimate and truth.

python scenarios/replay_estimate.py [replay.rrd], then: rerun replay.rrd
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mocobot


def main(target: Path) -> None:
    """Replay a periodic trial of 20 s; encoders are off by about 1 deg, lengths by 1 mm, springs by 2 %."""
    recording = mocobot.simulate("b", "periodic", duration_s=20, preset="uncalibrated")
    mocobot.replay(recording, target, truth=recording.truth)
    print(f"{target}: {target.stat().st_size / 1e6:.1f} MB; open it with: rerun {target}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("target", nargs="?", type=Path, default=Path("replay.rrd"), help="the replay's file")
    main(parser.parse_args().target)
