"""Time to log a replay, and size of its file: python benchmarks/speed/replay.py [--recording REC.parquet]

Without a recording, a random trial of 110 s with three robots is simulated; `nominal` sensors repeat values, `ideal`
ones never do, so that their file is as large as such a trial's can be. Reading and estimating are not counted.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import tyro

from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from estimator.recording.parquet import read_recording
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_view.replay_trial import replay_trial
from mocobot_view.stream import save_replay

RUNS = 5


def measure(recording: Recording) -> tuple[list[float], list[float], float]:
    """Seconds to work out what is drawn, seconds to log and write it, and the file's size [MB]."""
    estimate = estimate_payload([recording])
    prepare, write = [], []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "replay.rrd"
        for _ in range(RUNS):
            start = time.perf_counter()
            trial = replay_trial(recording, "trial", estimate)
            ready = time.perf_counter()
            save_replay([trial], path)
            prepare.append(ready - start)
            write.append(time.perf_counter() - ready)
        return prepare, write, path.stat().st_size / 1e6


def main(recording: Path | None = None) -> None:
    """Print times and sizes."""
    if recording:
        recordings = {str(recording): read_recording(recording)}
    else:
        presets = [sensor_preset(name) for name in ("nominal", "ideal")]
        recordings = simulate(TrialRequest("a", "random"), presets).recordings
    for name, each in recordings.items():
        prepare, write, size = measure(each)
        total = sorted(p + w for p, w in zip(prepare, write, strict=True))
        print(
            f"{name}: {each.time[-1] - each.time[0]:.1f} s, {each.metadata.robots} robots: "
            f"prepare {min(prepare):.2f} s, log and write {min(write):.2f} s, together {total[0]:.2f} .. "
            f"{total[-1]:.2f} s of {RUNS}; {size:.1f} MB"
        )


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
