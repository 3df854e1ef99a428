"""What skewed clocks do to the estimates, and how well the motion tells the skew: python benchmarks/clock_skew.py

A random trial of payload (a) is simulated once. Robot 2's clock is then given an offset and a drift by reading its
joints at other instants; sensors are nominal, and 2 % of every robot's samples are dropped. Logs go the way of any
measured log: resampling, one clock, estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.clocks import ClockEstimate, Rates, recorded_clocks
from estimator.errors import InputError
from estimator.estimate.payload import estimate_payload
from estimator.recording.model import Recording
from mocobot_logs.log import CHANNELS, Level, Samples
from mocobot_logs.one_clock import ClockReport, to_recording
from mocobot_logs.resample import resample
from mocobot_sim.paper.scoring import rotation_error_deg
from mocobot_sim.scene.scene import build_team
from mocobot_sim.trial.sensors import PRESETS, measure
from mocobot_sim.trial.trajectories import random_vias
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import SensedLog, TrialLog
from mocobot_sim.trial.truth import GroundTruth

SKEWED = 1  # robot 2
CASES = ((0.0, 0.0), (1e-3, 0.0), (5e-3, 0.0), (20e-3, 0.0), (0.0, 50e-6), (5e-3, 50e-6))
DROPPED = 0.02
DRAWS = 10


@dataclass
class RecordingLog:
    """A recording as a log from which samples were dropped."""

    recording: Recording
    kept: list[np.ndarray]
    name: str = "trial"
    level: Level = "joint"
    channels = CHANNELS["joint"]
    metadata = None

    @property
    def robots(self) -> int:
        """Number of robots."""
        return len(self.kept)

    @property
    def size(self) -> int:
        """Rows."""
        return sum(len(rows) for rows in self.kept)

    def chunks(self, advance: Callable[[int], object]) -> Iterator[tuple[int, Samples]]:
        """As in ``LogSource``."""
        r = self.recording
        for i, rows in enumerate(self.kept):
            values = np.concatenate([r.phi[rows, i], r.theta[rows, i], r.tau[rows, i]], axis=1)
            advance(len(rows))
            yield i, Samples(np.rint(1e9 * r.time[rows]).astype(np.int64), values)


def skewed(log: TrialLog, offset_s: float, drift: float) -> TrialLog:
    """The trial as robot 2 logs it: stamp = t + offset + drift (t - middle)."""
    sensed, middle_s = log.sensed, log.time[-1] / 2
    stamp = np.arange(len(sensed.phi)) / sensed.rate_hz
    true = np.clip(middle_s + (stamp - middle_s - offset_s) / (1.0 + drift), stamp[0], stamp[-1])
    moved = {}
    for channel in ("phi", "theta", "tau"):
        values = getattr(sensed, channel).copy()
        values[:, SKEWED] = CubicSpline(stamp, values[:, SKEWED])(true)
        moved[channel] = values
    return replace(log, sensed=SensedLog(sensed.rate_hz, sensed.ticks, **moved))


def logged(log: TrialLog, rng: np.random.Generator) -> RecordingLog:
    """Through nominal sensors, with samples missing."""
    recording = measure(log, PRESETS["nominal"], rng)
    rows = len(recording.time)
    kept = [
        np.delete(np.arange(rows), rng.choice(np.arange(1, rows - 1), round(DROPPED * rows), replace=False))
        for _ in range(log.robots)
    ]
    return RecordingLog(recording, kept)


def recorded(source: RecordingLog, *, correct: bool) -> tuple[Recording, ClockReport]:
    """One clock for all robots, as corrected or as logged."""
    design = source.recording.metadata.design
    return to_recording(resample(source), design=design, trial="random", correct=correct)


def errors(recording: Recording, truth: GroundTruth) -> str:
    """Largest grasp errors, and those of mass, centre of mass and principal moments."""
    try:
        estimate = estimate_payload([recording])
    except InputError as error:
        return f"refused: {str(error)[:60]}"
    cells = []
    if (grasps := estimate.grasps) is not None:
        turn = max(rotation_error_deg(*pair) for pair in zip(truth.R_1i, grasps.R_1i, strict=True))
        shift = np.linalg.norm(grasps.p_1i - truth.p_1i, axis=1).max()
        cells += [f"{turn:8.4f}", f"{1e3 * shift:8.3f}"]
    else:
        cells += ["-".rjust(8)] * 2
    mass, p_1c, inertia = estimate.mass, estimate.p_1c, estimate.inertia
    cells.append("-".rjust(8) if mass is None else f"{100 * abs(mass.mass / truth.mass_kg - 1):8.4f}")
    cells.append("-".rjust(8) if p_1c is None else f"{1e3 * np.linalg.norm(p_1c - truth.p_1c):8.3f}")
    if inertia is None:
        cells.append("-".rjust(8))
    else:
        cells.append(f"{100 * np.abs(inertia.principal.moments / truth.principal_kgm2 - 1).max():8.3f}")
    return " ".join(cells)


def by_magnitude(recording: Recording) -> tuple[float, float]:
    """Offset and drift of robot 2 by |omega| alone, for comparison: Gauss-Newton from the truth's neighbourhood."""
    rates = [Rates(recording.theta[:, i], 0.0, recording.metadata.rate_hz) for i in (0, SKEWED)]
    middle_s = (len(recording.time) - 1) / recording.metadata.rate_hz / 2
    time = rates[0].time[25:-25]
    lever = time - middle_s
    wanted = np.linalg.norm(rates[0].spline(time), axis=1)
    x = np.zeros(2)
    for _ in range(15):
        q, q_dot = (s(time + x[0] + x[1] * lever) for s in (rates[1].spline, rates[1].change))
        size = np.linalg.norm(q, axis=1)
        slope = np.sum(q * q_dot, axis=1) / np.maximum(size, 1e-9)
        step = np.linalg.lstsq(
            np.stack([slope, lever * slope], axis=1), wanted - (1 + x[1]) * size, rcond=None
        )
        x += step[0]
    return float(x[0]), float(x[1])


def table(log: TrialLog, truth: GroundTruth) -> None:
    """Errors of skew and estimates, before and after correction."""
    names = " ".join(f"{name:>8}" for name in ("R [deg]", "p [mm]", "m [%]", "com [mm]", "I [%]"))
    print("largest errors of grasps, errors of mass, centre of mass, and largest of principal moments")
    print(f"{'true skew':>15} | {'error of the estimated skew':^42} | {'as logged':^44} | {'corrected':^44}")
    print(f"{'':15} | {'':42} | {names} | {names}")
    for case, (offset_s, drift) in enumerate(CASES):
        source = logged(skewed(log, offset_s, drift), np.random.default_rng(100 + case))
        corrected, report = recorded(source, correct=True)
        kept, _ = recorded(source, correct=False)
        clock = report.estimate
        skew = f"{1e3 * offset_s:3.0f} ms {1e6 * drift:3.0f} ppm"
        found = (
            f"{1e6 * (clock.offset_s[SKEWED] - offset_s):+6.2f} +- {1e6 * clock.offset_se_s[SKEWED]:4.2f} us, "
            f"{1e6 * (clock.drift[SKEWED] - drift):+6.3f} +- {1e6 * clock.drift_se[SKEWED]:5.3f} ppm"
        )
        print(f"{skew:>15} | {found:>42} | {errors(kept, truth)} | {errors(corrected, truth)}", flush=True)


def repeated(log: TrialLog) -> None:
    """Scatter over new noise, roundings and dropped samples against what is claimed."""
    offset_s, drift = CASES[-1]
    late = skewed(log, offset_s, drift)
    found, claimed, plain = [], [], []
    for draw in range(DRAWS):
        recording, report = recorded(logged(late, np.random.default_rng(draw)), correct=False)
        clock: ClockEstimate = report.estimate
        found.append((clock.offset_s[SKEWED] - offset_s, clock.drift[SKEWED] - drift))
        claimed.append((clock.offset_se_s[SKEWED], clock.drift_se[SKEWED]))
        magnitude = by_magnitude(recording)
        plain.append((magnitude[0] - offset_s, magnitude[1] - drift))
    e, se, other = np.array(found), np.array(claimed), np.array(plain)
    print(f"\n{DRAWS} draws at {1e3 * offset_s:g} ms and {1e6 * drift:g} ppm:")
    for k, (what, unit) in enumerate((("offset", "us"), ("drift", "ppm"))):
        print(
            f"  {what:6} [{unit}]: mean error {1e6 * e[:, k].mean():+.3f}, rms {1e6 * _rms(e[:, k]):.3f}, "
            f"claimed {1e6 * _rms(se[:, k]):.3f}, rms of error over claim {_rms(e[:, k] / se[:, k]):.2f}; "
            f"by |omega| alone: rms {1e6 * _rms(other[:, k]):.3f}"
        )


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


def uncalibrated() -> None:
    """The same skew with encoders that have zero errors of about a degree."""
    offset_s, drift = CASES[-1]
    print("\nuncalibrated robots, the same skew:")
    preset = PRESETS["uncalibrated"]
    for draw in range(3):
        rng = np.random.default_rng(draw)
        scene = build_team("a")
        scene = replace(scene, units=preset.spread.draw(scene.robots, rng))
        log = run_trial(scene, random_vias(scene.wrist_home_b, rng, vias=40))
        clock = recorded_clocks(measure(skewed(log, offset_s, drift), preset, rng))
        print(
            f"  offset: error {1e6 * (clock.offset_s[SKEWED] - offset_s):+.1f} us, claimed "
            f"{1e6 * clock.offset_se_s[SKEWED]:.1f}; rates differ by {100 * clock.mismatch[SKEWED]:.2f} %"
        )


def main() -> None:
    """Print everything."""
    scene = build_team("a")
    log = run_trial(scene, random_vias(scene.wrist_home_b, np.random.default_rng(1), vias=80))
    table(log, GroundTruth.of(scene))
    repeated(log)
    uncalibrated()


if __name__ == "__main__":
    main()
