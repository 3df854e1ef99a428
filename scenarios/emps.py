"""A real machine tells what its simulation gets wrong: the EMPS benchmark's axis, end to end.

    python scenarios/emps.py [FOLDER]

FOLDER holds DATA_EMPS.mat and DATA_EMPS_PULSES.mat of nonlinearbenchmark.org; without it, MOCOBOT_EMPS_DATA or
data/emps is used.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from mocobot import emps

FOLDER = Path(__file__).resolve().parents[1] / "data" / "emps"


def main() -> None:
    """Diagnose the first recording; predict the second with it, and say what is different there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folder",
        nargs="?",
        default=os.environ.get("MOCOBOT_EMPS_DATA", FOLDER),
        help="of DATA_EMPS.mat and DATA_EMPS_PULSES.mat",
    )
    given = parser.parse_args().folder
    paths = [Path(given) / name for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")]
    if missing := [str(path) for path in paths if not path.is_file()]:
        raise SystemExit(f"missing: {', '.join(missing)}; the recordings are on nonlinearbenchmark.org")

    diagnosis = emps.diagnose(paths[0])
    print(f"=== {paths[0].name}: four cycles of one motion. A mass without friction, and the data.\n")
    print(diagnosis)

    # The second recording was held out until here.
    there = emps.diagnose(paths[1])
    print(f"\n=== {paths[1].name}: the same reference with something added.\n")
    for cause in there.causes:
        print(cause.sentence)

    print("\n=== What every cause is worth; in the second recording nothing but the pulses was fitted.\n")
    steps = emps.staircase(diagnosis, there, different=["injected_voltage"])
    print(emps.format_staircase(steps, paths[1].name))


if __name__ == "__main__":
    main()
