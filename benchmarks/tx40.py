"""A real six-axis arm, from its maker's model alone: what is named, and how well it predicts.

    python benchmarks/tx40.py

Needs the published excitation run (``models/tx40/README.md`` says where it is from): put it into
``data/tx40`` or set MOCOBOT_TX40_DATA to its file.
Torques are low-passed, and compared while a joint moves: at rest friction is anything.
Everything is fitted to the first two thirds of the log, causes and their shapes included, and tried on the last third.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import tyro
from scipy.interpolate import CubicSpline

from discrepancy.evidence.posterior import Posterior
from discrepancy.evidence.settings import SETTINGS
from discrepancy.joints import problem
from discrepancy.joints.calibrated import as_found
from discrepancy.joints.calibration import ArmCalibration, calibrate_arm
from discrepancy.joints.causes import Span
from discrepancy.joints.diagnose import MOVED, Outcome, diagnose
from discrepancy.joints.friction import direction
from discrepancy.joints.mechanics import body_regressor, inverse_torque
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.problem import Given
from discrepancy.joints.signals import Signals
from discrepancy.joints.trials import trials_of
from discrepancy.joints.verdict import judged
from estimator.filtering import low_pass
from mocobot.serial import read_logs
from mocobot_logs.joints.joint_log import JointLog

VARIABLE = "MOCOBOT_TX40_DATA"
TOP = Path(__file__).resolve().parents[1]
FILE = TOP / "data" / "tx40" / "excitation.parquet"
ROWS_HZ, MOVES, SPLIT = 20.0, 0.98, 2.0 / 3.0
"""Low-pass of what is compared, the share of its window in which a joint moves, and where the log is split."""


def data() -> Path:
    """The file, or a message and the end of the program."""
    path = Path(os.environ.get(VARIABLE) or FILE)
    if not path.is_file():
        raise SystemExit(f"the TX40's excitation run is needed: set {VARIABLE} to its file ({path} is none)")
    return path


def read() -> tuple[SerialModel, JointLog]:
    """Model and log."""
    model = load_model(TOP / "models" / "tx40" / "tx40.xml")
    (log,) = read_logs(data(), model, map=TOP / "models" / "tx40" / "log.toml")
    return model, log


def crop(log: JointLog, start: float, stop: float) -> JointLog:
    """A part of a log, by shares of it."""
    here = slice(round(start * len(log.time)), round(stop * len(log.time)))
    assert log.torque is not None
    return replace(log, time=log.time[here], q=log.q[here], torque=log.torque[here], usable=log.usable[here])


def parts(model: SerialModel, log: JointLog) -> tuple[Signals, Signals]:
    """Signals of the first two thirds and of the last."""
    whole = trials_of(model, [log]).runs[0]
    first = whole.time < log.time[round(SPLIT * len(log.time))]
    return tuple(_of(whole, at) for at in (first, ~first))  # type: ignore[return-value]


def _of(s: Signals, at: np.ndarray) -> Signals:
    names = ("time", "q", "dq", "ddq", "torque", "usable", "inverse")
    return replace(s, **{name: getattr(s, name)[at] for name in names})


def shares(error: np.ndarray, s: Signals) -> np.ndarray:
    """Root mean square of an error over that of the torque while a joint moves [%], shape (J,)."""
    out = []
    for j in range(error.shape[1]):
        moves = np.abs(s.dq[:, j]) > s.slow[j]
        rows = low_pass(np.column_stack([moves, error[:, j], s.torque[:, j]]), s.rate_hz, ROWS_HZ)
        own = rows[rows[:, 0] > MOVES]
        out.append(100.0 * np.sqrt(np.mean(own[:, 1] ** 2) / np.mean(own[:, 2] ** 2)))
    return np.array(out)


def shown(share: np.ndarray) -> str:
    """Numbers of a row."""
    return "".join(f"{x:8.1f}" for x in share)


def standard(s: Signals, *, coupled: bool) -> np.ndarray:
    """Columns of ten inertial numbers a link, rotor, Coulomb, viscous friction and offset a joint, shape (W, J, k)."""
    out = [body_regressor(s.motion, int(body)) for body in s.tree.links]
    for j in range(s.q.shape[1]):
        own = np.zeros((*s.q.shape, 4))
        own[:, j] = np.column_stack([
            np.clip(s.dq[:, j] / s.slow[j], -1.0, 1.0), s.dq[:, j], s.ddq[:, j], np.ones(len(s.time)),
        ])  # fmt: skip
        out.append(own)
    for j in range(1, s.q.shape[1] if coupled else 0):
        out.append(pair(s, j))
    return np.concatenate(out, axis=2)


def pair(s: Signals, j: int) -> np.ndarray:
    """Coulomb, viscous friction and rotor of a drive that turns with the sum of a joint and the one before it."""
    out, both = np.zeros((*s.q.shape, 3)), [j - 1, j]
    v, a = s.dq[:, both].sum(axis=1), s.ddq[:, both].sum(axis=1)
    side = np.clip(v / s.slow[both].sum(), -1.0, 1.0)
    out[:, both] = np.column_stack([side, v, a])[:, None]
    return out


def plain(first: Signals, last: Signals, *, coupled: bool) -> np.ndarray:
    """What plain least squares leaves of the last third: numbers of all kinds, fitted by least norm."""
    X, y = standard(first, coupled=coupled), first.torque - first.inverse
    X, y = (low_pass(x.reshape(len(x), -1), first.rate_hz, ROWS_HZ).reshape(x.shape) for x in (X, y))
    scale = np.sqrt(np.mean(first.torque**2, axis=0))  # joints count by the size of their torques
    A, b = (X / scale[:, None]).reshape(-1, X.shape[2]), (y / scale).ravel()
    size = np.linalg.norm(A, axis=0)
    size = np.where(size > 0, size, 1.0)
    values = np.linalg.lstsq(A / size, b, rcond=1e-4)[0] / size  # base parameters: what is not seen stays
    return last.torque - last.inverse - standard(last, coupled=coupled) @ values


class Elsewhere(problem._Builder):
    """The problem of other signals, with the sizes of those that it was solved for."""

    given_spans: list[Span]

    def _spans(self) -> list[Span]:
        return self.given_spans


def left(outcome: Outcome, model: SerialModel, last: Signals) -> np.ndarray:
    """What causes and tolerances leave of the last third, with values of the first two.

    Values are those without the errors of laws, which nobody predicts.
    """
    solved, state = outcome.problem, outcome.state
    prior = state.posterior.prior.copy()
    for c in state.chosen:
        prior[list(c.forms)] = 0.0
        k = list(c.group.columns)
        prior[k] = np.maximum(prior[k], (SETTINGS.plain * np.array(c.group.slab)) ** 2)
    x = Posterior(solved.cells, prior, state.posterior.variance).mean
    found = {label: float(x[k]) for k, label in enumerate(solved.labels) if prior[k]}
    found = {n: v for n, v in found.items() if " rest " not in n and " turning " not in n}
    values = {n: v for n, v in found.items() if any(word in f" {n}" for word in MOVED) and "{" not in n}
    Elsewhere.given_spans = [own[0].span for own in solved.joints]
    s = replace(last, typical=solved.parts[0].typical)
    here = Elsewhere(model, [s], values, Given()).built()
    out = here.residual[0].copy()
    for label, by in zip(here.labels, here.series, strict=True):
        for j, own in by.items():
            out[:, j] -= found.get(label, 0.0) * own[0]
    return out


def as_found_left(found: ArmCalibration, last: Signals) -> np.ndarray:
    """What a calibration leaves of the last third, by MuJoCo's inverse dynamics of ``as_found.xml`` and friction."""
    of = {(p.place, p.name): p.value for p in found.parameters}
    names, model = found.model.joints, as_found(found)[0].compile()
    out = inverse_torque(model, last.q, last.dq, last.ddq)  # with the dampers and rotors of tendons
    side = [direction(last.dq[:, j], 1.0 / last.rate_hz, last.slow[j]) for j in range(len(names))]
    for j, n in enumerate(names):
        out[:, j] += of[n, "coulomb_Nm"] * side[j] + of[n, "viscous_Nms_per_rad"] * last.dq[:, j]
    for j, (coulomb, _, _, ratio) in found.coupled.items():
        v = last.dq[:, j] + ratio * last.dq[:, j - 1]
        both = coulomb * direction(v, 1.0 / last.rate_hz, last.slow[j] + last.slow[j - 1])
        out[:, j], out[:, j - 1] = out[:, j] + both, out[:, j - 1] + ratio * both
    for j, n in enumerate(names):
        late = CubicSpline(last.time, last.torque[:, j])(
            np.clip(last.time + of[n, "delay_s"], last.time[0], last.time[-1])
        )
        out[:, j] = late - (1.0 + of[n, "gain"]) * out[:, j] - of[n, "offset_Nm"]
    return out


def main() -> None:
    """Print the tables."""
    model, log = read()
    begun = time.process_time()
    verdict = judged(model, [log])
    print(
        f"{len(log.time)} samples at {log.rate_hz:g} Hz; {verdict.verdict}; {time.process_time() - begun:.1f} s of CPU"
    )
    for f in verdict.findings:
        print(f"  {f.cause} at {f.place} ({100 * f.probability:.0f} %, {f.over_nothing:.0f} nats)")
        for m in f.members:
            print(
                f"    {m.place}: "
                + ", ".join(f"{n} {v:.4g} +- {m.errors.get(n) or 0.0:.2g}" for n, v in m.values.items())
            )
    print("\nTorque left unpredicted in the last third, rms over that of the torque [%]")
    first, last = parts(model, log)
    print(f"  {'':<44}" + "".join(f"{name:>8}" for name in model.joints))
    print(f"  {'the bare model':<44}{shown(shares(last.torque - last.inverse, last))}")
    for title, coupled in (
        ("plain least squares, 14 numbers a joint", False),
        ("the same, and the coupled drives", True),
    ):
        begun = time.process_time()
        share = shares(plain(first, last, coupled=coupled), last)
        print(f"  {title:<44}{shown(share)}  ({time.process_time() - begun:.2f} s)")
    begun = time.process_time()
    share = shares(as_found_left(calibrate_arm(model, [crop(log, 0.0, SPLIT)]), last), last)
    title = "calibrate: as_found.xml in MuJoCo, and the log's errors"
    print(f"  {title:<44}{shown(share)}  ({time.process_time() - begun:.1f} s)")
    begun = time.process_time()
    outcome = diagnose(model, [crop(log, 0.0, SPLIT)])
    share = shares(left(outcome, model, last), last)
    title = f"{len(outcome.state.chosen)} causes named from the first two thirds"
    print(f"  {title:<44}{shown(share)}  ({time.process_time() - begun:.1f} s)")


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
