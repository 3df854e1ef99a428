"""Resimulate a recording's reference, block by block from where each began."""

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.emps.recording.axis_log import FIRST_GUESS_KG, LIMIT_V, AxisLog
from discrepancy.emps.recording.signals import Signals
from discrepancy.laws.candidate import CAUSE, LawCandidate
from discrepancy.laws.said.pieces import pieces_of
from estimator.arrays import Array
from mocobot_sim.emps.effects import AxisEffect, apply_effects
from mocobot_sim.emps.loop import Start, run
from mocobot_sim.emps.plant import Plant


def nominal_plant(log: AxisLog) -> Plant:
    """As assumed before anything was measured: first guess of the mass, no friction, nominal gains of the loop."""
    return Plant(FIRST_GUESS_KG, log.gain_N_per_V, log.kp_per_s, log.kv_Vs_per_m, log.period_s, LIMIT_V)


def effects_of(active: Sequence[tuple[Candidate, Array]]) -> list[AxisEffect]:
    """Causes as the simulator's effects: values and shape by name; a law has one for every amplitude."""
    out = []
    for candidate, values in active:
        if isinstance(candidate, LawCandidate):
            out += [AxisEffect(CAUSE, asdict(piece)) for piece in pieces_of(candidate, values)]
            continue
        named = {p.name: float(v) for p, v in zip(candidate.parameters, values, strict=True)}
        inside = {name: float(v) for name, v in candidate.shape.items()}
        out.append(AxisEffect(candidate.cause, named | inside))
    return out


def plant_of(nominal: Plant, active: Sequence[tuple[Candidate, Array]]) -> Plant:
    """The plant with causes in it."""
    return apply_effects(nominal, effects_of(active))


def start_of(signals: Signals, sample: int) -> Start:
    """State at one sample of a recording, from its smoothed signals."""
    before = slice(max(sample - rules.REMEMBERED, 0), sample)
    return Start(
        float(signals.x[sample]),
        float(signals.v[sample]),
        signals.v[before].copy(),
        signals.log.voltage[before].copy(),
    )


def resimulation_errors(
    plant: Plant,
    time: Array,
    reference: Array,
    start: Start,
    position: Array,
    voltage: Array,
    usable: NDArray[np.bool_],
) -> dict[str, Array] | None:
    """Recorded minus simulated position [m] and voltage [V] at usable samples; None where the simulation fails.

    Args:
        plant: the axis.
        time, reference, position, voltage, usable: of one block, shape (Q,).
        start: its state at the first sample.
    """
    x, volts = run(plant, time, reference, start)
    if not np.isfinite(x).all():
        return None
    return {"position": (position - x)[usable], "voltage": (voltage - volts)[usable]}
