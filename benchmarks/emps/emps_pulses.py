"""What is injected in the EMPS benchmark's second recording, from its signals alone; then scored against its log.

python benchmarks/emps/emps_pulses.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import loadmat

from discrepancy.emps.diagnosis import also_fitted, diagnose_axis
from discrepancy.emps.recording.reader import read_emps
from discrepancy.emps.rig import EmpsRig
from discrepancy.engine.diagnose import Diagnosis
from emps_data import DATA, PULSES, needed_folder
from mocobot_sim.emps.plant import PulseTrain


def found_pulses(
    path: Path, *, closed_loop: bool = True
) -> tuple[EmpsRig, Diagnosis, PulseTrain | None, float]:
    """The rig, the diagnosis, the pulses that it names (size in V) or None, and the size's standard error [V]."""
    rig = EmpsRig.of(read_emps(path))
    diagnosis = diagnose_axis(rig, closed_loop=closed_loop)
    for item in diagnosis.causes:
        if item.candidate.cause == "injected_voltage":
            shape = item.candidate.shape
            train = PulseTrain(shape["start_s"], shape["period_s"], shape["width_s"], float(item.values[0]))
            return rig, diagnosis, train, float(np.sqrt(item.covariance[0, 0]))
    return rig, diagnosis, None, float("nan")


def scored(path: Path, train: PulseTrain) -> dict[str, float]:
    """The found train beside the log ``pulses_N``: edges, samples that agree, size over the log's."""
    log = loadmat(path, variable_names=["t", "pulses_N"])
    time, pulses = log["t"].ravel(), log["pulses_N"].ravel().astype(float)
    on = pulses > 0
    rising = time[1:][np.diff(on.astype(int)) == 1]
    falling = time[1:][np.diff(on.astype(int)) == -1]
    mine = train.on(time) > 0.5
    return {
        "start_error_s": train.start_s - float(rising[0]),
        "period_error_s": train.period_s - float(np.mean(np.diff(rising))),
        "width_error_s": train.width_s - float(np.mean(falling - rising[: len(falling)])),
        "samples_agreeing": float(np.mean(mine == on)),
        "pulses_in_log": float(len(rising)),
        "size_over_log": train.size / float(pulses.max()),
    }


def main() -> None:
    """Print what is found in both recordings, and the score."""
    folder = needed_folder()
    for name in (DATA, PULSES):
        rig, diagnosis, train, se = found_pulses(folder / name)
        print(f"{name}: {diagnosis.verdict}")
        if train is None:
            value, spread = also_fitted(rig, diagnosis.explanation, ("injected_voltage",))["injected_voltage"]
            print(
                f"    no pulses; the best train of rectangles has {1e3 * value:.3f} +- {1e3 * spread:.3f} mV"
            )
            continue
        print(
            f"    pulses of {train.size:.5f} +- {se:.5f} V from {train.start_s:.4f} s on, every {train.period_s:.5f} s "
            f"for {train.width_s:.4f} s, between law and drive"
        )
        for key, value in scored(folder / name, train).items():
            print(f"    {key:<20}{value:.6g}")
        other, spread = also_fitted(rig, diagnosis.explanation, ("injected_force",))["injected_force"]
        print(f"    the same train as an outside force: {other:.3f} +- {spread:.3f} N")


if __name__ == "__main__":
    main()
