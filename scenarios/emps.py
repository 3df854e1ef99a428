"""A real machine tells what its simulation gets wrong: the EMPS benchmark's axis, end to end.

    python scenarios/emps.py [FOLDER]

FOLDER holds DATA_EMPS.mat and DATA_EMPS_PULSES.mat of nonlinearbenchmark.org; without it, MOCOBOT_EMPS_DATA or
../shared/data/emps is used.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from discrepancy.emps.diagnosis import diagnose_axis
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.emps.staircase import format_staircase, staircase
from discrepancy.emps.words import EmpsWords
from discrepancy.result.json import diagnosis_to_dict
from discrepancy.result.text import format_diagnosis

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data" / "emps"


def main() -> None:
    """Diagnose the first recording; predict the second with it, and say what is different there."""
    given = sys.argv[1] if len(sys.argv) > 1 else os.environ.get("MOCOBOT_EMPS_DATA", BESIDE)
    paths = [Path(given) / name for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")]
    if missing := [str(path) for path in paths if not path.is_file()]:
        raise SystemExit(f"missing: {', '.join(missing)}; the recordings are on nonlinearbenchmark.org")

    rig = EmpsRig.of(read_emps(paths[0]))
    diagnosis = diagnose_axis(rig)
    print(f"=== {paths[0].name}: four cycles of one motion. A mass without friction, and the data.\n")
    print(format_diagnosis(diagnosis_to_dict(diagnosis, rig, EmpsWords())))

    # The second recording was held out until here.
    other = EmpsRig.of(read_emps(paths[1]))
    there = diagnose_axis(other)
    pulses = [(f.candidate, f.values) for f in there.causes if f.candidate.cause == "injected_voltage"]
    print(f"\n=== {paths[1].name}: the same reference with something added.\n")
    for item in there.causes:
        values, se = other.effect_parameters(item.candidate, item.values, item.covariance)
        print(EmpsWords().describe(item.candidate, values, se))

    print("\n=== What every cause is worth; in the second recording nothing but the pulses was fitted.\n")
    print(format_staircase(staircase(rig, diagnosis.explanation, (other, pulses)), paths[1].name))


if __name__ == "__main__":
    main()
