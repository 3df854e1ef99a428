"""Diagnose the manufacturer's model of a real six-axis arm, from a published log of a Staubli TX40.

    python scenarios/any_robot.py [FOLDER]

FOLDER holds excitation.parquet (models/tx40/README.md states its source); the default is the variable MOCOBOT_TX40_DATA
or data/tx40. The same calls work for any robot in MJCF or URDF and any log of its joints.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import mocobot

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "data" / "tx40"


def main() -> None:
    """Inspect the log, and diagnose what the model gets wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder", nargs="?", default=os.environ.get("MOCOBOT_TX40_DATA", FOLDER), help="of excitation.parquet"
    )
    given = parser.parse_args().folder
    log = Path(given) / "excitation.parquet"
    if not log.is_file():
        raise SystemExit(f"missing: {log}; models/tx40/README.md says where it is published")

    model = ROOT / "models" / "tx40" / "tx40.xml"
    print(mocobot.inspect(log, model), "\n")
    print(mocobot.diagnose(log, model))


if __name__ == "__main__":
    main()
