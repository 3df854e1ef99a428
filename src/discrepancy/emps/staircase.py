"""What every cause is worth, one by one: error of the force, and of position and voltage in closed loop."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.emps.rig import EmpsRig
from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.fit import Fit
from estimator.arrays import Array
from estimator.statistics import rms

Active = Sequence[tuple[Candidate, Array]]


@dataclass(frozen=True)
class Errors:
    """Errors of one model on one set of data.

    Attributes:
        force_percent: norm of the force that the motion leaves unexplained over that of the force, at the nominal gain;
            both filtered alike.
        position_um, voltage_mV: root mean square of recorded minus simulated; NaN where a simulation fails.
    """

    force_percent: float
    position_um: float
    voltage_mV: float


@dataclass(frozen=True)
class Step:
    """One model of the staircase.

    Attributes:
        cause: what was added last, or ``nominal``.
        in_sample: fitted to all blocks.
        held_out: every block with a fit to the others.
        elsewhere: another recording with the fit to all blocks of this one, or None.
    """

    cause: str
    in_sample: Errors
    held_out: Errors
    elsewhere: Errors | None


def staircase(
    rig: EmpsRig,
    explanation: Explanation,
    other: tuple[EmpsRig, Active] | None = None,
    done: Callable[[int], object] | None = None,
) -> list[Step]:
    """Errors of the nominal model, and with each named cause added in the order of discovery.

    Args:
        rig: the recording that was diagnosed.
        explanation: what was found.
        other: a recording to be held out until the end, with what is known to be different there.
        done: called with 1 for every step.
    """
    problem = explanation.problem
    blocks = list(range(len(rig.blocks)))
    out = []
    for count in range(len(explanation.found) + 1):
        free = list(explanation.fit.free[:count])
        whole = _fitted(explanation, free, blocks)
        apart = [_fitted(explanation, free, [k for k in blocks if k != t] or [t]) for t in blocks]
        elsewhere = None
        if other is not None:
            elsewhere = errors(other[0], [[*whole, *other[1]]] * len(other[0].blocks))
        name = problem.candidates[free[-1]].cause if free else "nominal"
        out.append(Step(name, errors(rig, [whole] * len(blocks)), errors(rig, apart), elsewhere))
        if done:
            done(1)
    return out


def errors(rig: EmpsRig, models: Sequence[Active]) -> Errors:
    """Errors of one model per block, all blocks together."""
    left = [rig.physical_residual(model)[t][:, 0] for t, model in enumerate(models)]
    force = np.concatenate(rig.reduction(rig.signals.force))
    position, voltage = [], []
    for t, model in enumerate(models):
        error = rig.simulation(t, np.zeros(0), np.zeros(0), model)()
        position.append(np.array([np.nan]) if error is None else error["position"])
        voltage.append(np.array([np.nan]) if error is None else error["voltage"])
    return Errors(
        100.0 * float(np.linalg.norm(np.concatenate(left)) / np.linalg.norm(force)),
        1e6 * rms(np.concatenate(position)),
        1e3 * rms(np.concatenate(voltage)),
    )


def _fitted(explanation: Explanation, free: Sequence[int], trials: Sequence[int]) -> Active:
    return Fit.of(explanation.problem.as_whitened, free, trials, background=False).active


def format_staircase(steps: Sequence[Step], other: str | None = None) -> str:
    """A table of at most 100 columns.

    Args:
        steps: of the staircase.
        other: name of the held-out recording.
    """
    groups = ["in sample", "held-out blocks", *([other] if other else [])]
    lines = [
        f"{'':<22}" + "".join(f"{group:^26}" for group in groups),
        f"{'added cause':<22}" + f"{'force %':>8}{'pos um':>9}{'volt mV':>9}" * len(groups),
    ]
    for step in steps:
        cells = [step.in_sample, step.held_out, *([step.elsewhere] if step.elsewhere else [])]
        numbers = "".join(
            f"{cell.force_percent:>8.2f}{cell.position_um:>9.3g}{cell.voltage_mV:>9.4g}" for cell in cells
        )
        lines.append(f"{step.cause:<22}{numbers}")
    return "\n".join(lines)
