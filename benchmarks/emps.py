"""A real axis with one slide: what the engine finds in the EMPS benchmark's recordings, beside plain least squares.

    python benchmarks/emps.py

Set MOCOBOT_EMPS_DATA to the folder of the recordings, or put them into ``data/emps``. Plain least squares fits mass,
Coulomb, viscous friction and an offset to the force, low-passed at 40 Hz; published for the benchmark are 95.1 kg,
20.4 N, 203.5 N s/m and -3.2 N.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import tyro

from discrepancy.evidence.probability import odds_of
from discrepancy.joints.diagnose import Outcome, diagnose, labels_of
from estimator.filtering import low_pass
from mocobot import serial

TOP = Path(__file__).resolve().parents[1]
FOLDER = Path(os.environ.get("MOCOBOT_EMPS_DATA") or TOP / "data" / "emps")
FILES = ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")
SMOOTH_HZ, ROWS_HZ, EDGE_S, SLOW_MPS = 100.0, 40.0, 0.3, 1e-3


def plain(log: serial.JointLog) -> tuple[np.ndarray, float]:
    """Mass [kg], Coulomb [N], viscous friction [N s/m] and offset [N], and the share of the force that they leave."""
    assert log.torque is not None
    rate = log.rate_hz
    q = low_pass(log.q[:, 0], rate, SMOOTH_HZ)
    dq = np.gradient(q, 1.0 / rate)
    columns = np.column_stack(
        [np.gradient(dq, 1.0 / rate), np.clip(dq / SLOW_MPS, -1.0, 1.0), dq, np.ones(len(q))]
    )
    force = log.torque[:, 0]
    # The drive holds its voltage for a sample: the force is half a sample younger.
    force = 0.5 * (force + np.concatenate([force[:1], force[:-1]]))
    edge = round(EDGE_S * rate)
    y, x = (low_pass(series, rate, ROWS_HZ)[edge:-edge] for series in (force, columns))
    values = np.linalg.lstsq(x, y, rcond=None)[0]
    return values, float(np.std(y - x @ values) / np.std(y))


def told(outcome: Outcome) -> list[str]:
    """Causes with their probabilities, their values, and the mass that the tolerances take."""
    lines = [
        f"{odds.chosen.group.name}: {odds.over_nothing:.0f} nats, probability {odds.probability:.2f}"
        for odds in odds_of(outcome.search, outcome.state)
    ]
    numbers = labels_of(outcome)
    lines += [f"    {label}: {value:.4g} +- {error:.2g}" for label, (value, error) in numbers.items()]
    posterior = outcome.state.posterior
    at = outcome.problem.labels.index("carriage mass share")
    share, error = posterior.mean[at], np.sqrt(posterior.covariance[at, at])
    return [*lines, f"tolerated: mass share {share:.4f} +- {error:.4f}"]


def main() -> None:
    """Read, fit, diagnose, print."""
    if missing := [str(FOLDER / name) for name in FILES if not (FOLDER / name).is_file()]:
        raise SystemExit(
            f"missing: {', '.join(missing)}; set MOCOBOT_EMPS_DATA to the folder of the recordings"
        )
    model = serial.read_model(TOP / "models" / "emps" / "emps.xml")
    for name in FILES:
        logs = serial.read_logs(FOLDER / name, model)
        values, left = plain(logs[0])
        mass, coulomb, viscous, offset = values
        print(f"=== {name}: {len(logs)} part")
        print(
            f"plain: {mass:.2f} kg, {coulomb:.2f} N, {viscous:.1f} N s/m, {offset:.2f} N; {100 * left:.2f} % left"
        )
        begun = time.process_time()
        outcome = diagnose(model, logs)
        print(f"engine, {time.process_time() - begun:.1f} s of CPU:", *told(outcome), sep="\n    ")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
