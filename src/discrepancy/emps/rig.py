"""One axis as a rig: rows from blocks of a recording, candidates from the catalogue."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy import rules
from discrepancy.candidate import Candidate
from discrepancy.causes.excluded import excluded_from
from discrepancy.causes.intervals import intervals_near, worst_intervals
from discrepancy.emps.blocks import blocks, period_of
from discrepancy.emps.catalogue import (
    Tolerances,
    candidate_of,
    default_tolerances,
    hidden_by_rounding,
    remainder,
)
from discrepancy.emps.causes import CAUSES
from discrepancy.emps.causes.base import Hints
from discrepancy.emps.closed_loop import effects_of, nominal_plant, plant_of, resimulation_errors, start_of
from discrepancy.emps.hints import hints_of
from discrepancy.emps.noise import Noise, from_remainder, from_repeats, repeated
from discrepancy.emps.recording.axis_log import AxisLog
from discrepancy.emps.recording.preflight import checked
from discrepancy.emps.recording.signals import Signals
from discrepancy.emps.reduction import Reduction
from discrepancy.emps.undecidable import statements
from discrepancy.engine.explanation import Explanation
from discrepancy.law_doubt import LawDoubt
from discrepancy.least_squares.patches import Patches
from discrepancy.least_squares.whitening import Whitening
from discrepancy.rig import Channel, Rig, Rows
from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.emps.extended import write_extended
from mocobot_sim.emps.plant import Plant


@dataclass(frozen=True, eq=False)
class EmpsRig(Rig):
    """One recording of the axis, cut into blocks that validate each other.

    Attributes:
        log: the recording, checked.
        signals: its smoothed signals.
        blocks: samples of every block.
        reduction: from samples to rows.
        hints: where shapes begin.
        noise: what is not to be explained.
        whitening: of every block.
        tolerances: standard deviations by cause and parameter.
        excluded: causes left out of the catalogue, on request or because the position is too coarse for them.
    """

    log: AxisLog
    signals: Signals
    blocks: tuple[slice, ...]
    reduction: Reduction
    hints: Hints
    noise: Noise
    whitening: tuple[Whitening, ...]
    tolerances: Tolerances
    excluded: frozenset[str]

    @classmethod
    def of(cls, log: AxisLog, tolerances: Tolerances | None = None, excluded: Sequence[str] = ()) -> EmpsRig:
        """Check a recording, cut it and find its noise.

        Raises:
            InputError: the recording cannot be used, or a cause to be excluded does not exist.
        """
        left_out = excluded_from(CAUSES, excluded)
        log = checked(log)
        signals = Signals.of(log)
        period = period_of(log.reference, log.rate_hz)
        cut = blocks(signals, period)
        reduction = Reduction.of(log.rate_hz, cut, log.usable & ~log.saturated)
        cut, reduction = _long_enough(log, cut, reduction)
        hints = hints_of(signals, reduction, period)
        left = remainder(signals, reduction, hints)
        if period is not None and repeated(signals, period):
            noise = from_repeats(left, signals, reduction, period, rules.EMPS_AR_ORDER)
        else:
            noise = from_remainder(left, signals, reduction)
        shared = Whitening.of(noise.draws, noise.draws.shape[1], rules.EMPS_AR_ORDER)
        whitening = tuple(replace(shared, moving=len(rows)) for rows in reduction.samples)
        known = default_tolerances() if tolerances is None else tolerances
        hidden = hidden_by_rounding(signals, reduction, hints, shared)
        if hidden:
            said = (
                f"The position's rounding hides some causes, which are not looked for: {', '.join(hidden)}."
            )
            log = replace(log, notes=(*log.notes, said))
        return cls(
            log, signals, tuple(cut), reduction, hints, noise, whitening, known, left_out | set(hidden)
        )

    @property
    def trials(self) -> Sequence[str]:
        """Names of the blocks."""
        time, name = self.log.time, Path(self.log.name).stem
        return [f"{name} {time[b.start]:.2f}-{time[b.stop - 1]:.2f} s" for b in self.blocks]

    @property
    def channels(self) -> Sequence[Channel]:
        """Force that the drive is told minus what the motion needs, and voltage minus the loop's law."""
        return [Channel("force", "axis", None, "N"), Channel("voltage", "loop", None, "V")]

    @property
    def nominal(self) -> Plant:
        """The axis as assumed."""
        return nominal_plant(self.log)

    def candidates(self) -> list[Candidate]:
        """Every cause of the catalogue; pushes come from ``transients``."""
        return [
            candidate_of(name, self.hints, self.tolerances)
            for name, cause in CAUSES.items()
            if name not in self.excluded and not cause.transient
        ]

    def physical(self, candidate: Candidate) -> list[Array]:
        """Columns of one candidate in N and V, rows (n, 2, k) of every block."""
        columns = self.reduction(CAUSES[candidate.cause].columns(self.signals, candidate.shape))
        return [c * candidate.acts_in(t) for t, c in enumerate(columns)]

    def columns(self, candidate: Candidate) -> list[Array]:
        """Whitened columns of one candidate, shape (n, 2, k) per block."""
        return [white(c) for white, c in zip(self.whitening, self.physical(candidate), strict=True)]

    def rows(self, candidates: Sequence[Candidate]) -> list[Rows]:
        """Whitened rows of every block; there are no unknowns but the causes."""
        columns = [self.columns(candidate) for candidate in candidates]
        out = []
        for t, (white, residual) in enumerate(
            zip(self.whitening, self.reduction(self.signals.residual), strict=True)
        ):
            none = np.zeros((*residual.shape, 0))
            time = self.log.time[self.reduction.samples[t]]
            out.append(Rows(self.trials[t], white(residual), none, none, [c[t] for c in columns], time))
        return out

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """Exact whitened residual of every block with causes taken out."""
        return [white(r) for white, r in zip(self.whitening, self.physical_residual(active), strict=True)]

    def physical_residual(self, active: Sequence[tuple[Candidate, Array]]) -> list[Array]:
        """The same in N and V, rows (n, 2) of every block."""
        out = self.reduction(self.signals.residual)
        for candidate, values in active:
            taken = self.reduction(CAUSES[candidate.cause].exact(self.signals, values, candidate.shape))
            out = [r - x * candidate.acts_in(t) for t, (r, x) in enumerate(zip(out, taken, strict=True))]
        return out

    def law_doubt(self, candidate: Candidate) -> LawDoubt:
        """A real axis: noise is what differs between its cycles, and every law leaves more than that."""
        return LawDoubt(rules.LAW_SHARE if candidate.transient else rules.EMPS_LAW_SHARE)

    def unknowns(self, candidate: Candidate) -> Sequence[Patches]:
        """Dry friction at rest, whitened columns (n, 2, k) of every block."""
        rests = CAUSES[candidate.cause].rests(self.signals, candidate.shape)
        reduced = [self.reduction(np.column_stack([rest, np.zeros_like(rest)])) for rest in rests]
        out = []
        for t, (white, samples) in enumerate(zip(self.whitening, self.reduction.samples, strict=True)):
            seen = [r[t] for r in reduced if np.abs(r[t]).max(initial=0.0) > 1e-6]
            out.append(Patches.of(white(np.stack(seen, axis=2))) if seen else Patches((len(samples), 2)))
        return out

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        """Whether such values can be: no friction or play that is negative beyond two standard errors, or rounding."""
        cause = CAUSES[candidate.cause]
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return cause.visible(self.signals, self.hints, values) and cause.never_negative(values, se)

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Pushes at the intervals where the force is worst."""
        out = []
        causes = [c for c in CAUSES.values() if c.transient and c.name not in self.excluded]
        for t, z in enumerate(remaining if causes else ()):
            time = self.log.time[self.reduction.samples[t]]
            worst = worst_intervals(t, time, z[:, 0], rules.EMPS_PUSH_S, two_sided=True)
            out += [cause.event(self.tolerances[cause.name], when) for cause in causes for when in worst]
        return out

    def imitators(self, candidate: Candidate) -> Iterable[list[Array]]:
        """The candidate in shapes that what repeats with the motion may have."""
        shapes = CAUSES[candidate.cause].imitators(self.signals, self.hints, candidate.shape)
        return (self.columns(replace(candidate, shape=dict(shape))) for shape in shapes)

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        """The candidate with every other shape of its cause; a push with its interval moved."""
        cause, when = CAUSES[candidate.cause], candidate.transient
        if when:
            tolerance = self.tolerances[cause.name]
            return [cause.event(tolerance, near) for near in intervals_near(when, rules.EMPS_SHORTEST_PUSH_S)]
        shapes = cause.finer(candidate.shape) if finer else cause.shapes(self.hints)
        return [replace(candidate, shape=dict(shape)) for shape in shapes if dict(shape) != candidate.shape]

    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]],
        healthy: Sequence[tuple[Candidate, Array]] = (),
    ) -> Callable[[], dict[str, Array] | None]:  # fmt: skip
        """What resimulates one block's reference, with causes in the axis.

        It returns recorded minus simulated ``position`` [m] and ``voltage`` [V], shape (Q,) each.
        """
        here, log = self.blocks[trial], self.log
        acting = [(c, v) for c, v in active if c.acts_in(trial)]
        return partial(
            resimulation_errors,
            plant_of(self.nominal, acting),
            log.time[here],
            log.reference[here],
            start_of(self.signals, here.start),
            log.position[here],
            log.voltage[here],
            log.usable[here],
        )

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        here = self.blocks[trial]
        position, voltage = float(np.std(self.log.position[here])), float(np.std(self.log.voltage[here]))
        return {
            "position": (np.array([self.noise.position_m]), np.array([position])),
            "voltage": (np.array([self.noise.voltage_V]), np.array([voltage])),
        }

    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Values with standard errors, and the shape, which has none."""
        names = [p.name for p in candidate.parameters]
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        found = dict(zip(names, map(float, values), strict=True)) | dict(candidate.shape)
        return found, dict(zip(names, map(float, se), strict=True)) | {
            n: float("nan") for n in candidate.shape
        }

    def quantities(self, trial: int) -> dict[str, Array]:
        """Speed [m/s], position [m], acceleration [m/s^2] and force [N] per row, shape (n,) each."""
        at, s = self.reduction.samples[trial], self.signals
        return {"speed": np.abs(s.v[at]), "velocity": s.v[at], "position": s.x[at], "acceleration": s.a[at]}

    def row_rate_hz(self, trial: int) -> float:
        return self.log.rate_hz / self.reduction.step

    def directions(self, trial: int) -> dict[str, Array]:
        """The two channels themselves: what the axis does, and what its loop does."""
        n = len(self.reduction.samples[trial])
        return {
            "the axis' force": np.tile(np.array([[1.0], [0.0]]), (n, 1, 1)),
            "the loop's voltage": np.tile(np.array([[0.0], [1.0]]), (n, 1, 1)),
        }

    def write_extended(self, explanation: Explanation, folder: Path) -> None:
        """Write the axis with the named causes in it.

        Raises:
            InputError: the folder cannot be written.
        """
        active = [(found.candidate, found.values) for found in explanation.found]
        write_extended(self.nominal, effects_of(active), folder, self.trials)

    def undecidable(self) -> list[dict[str, Any]]:
        """What recordings of one axis cannot decide."""
        return statements()


def _long_enough(log: AxisLog, cut: list[slice], reduction: Reduction) -> tuple[list[slice], Reduction]:
    """Only blocks with rows enough."""
    keep = [k for k, rows in enumerate(reduction.samples) if len(rows) >= rules.LEAST_ROWS]
    if not keep:
        raise InputError(f"{log.name}: no part of it is long enough to diagnose")
    return [cut[k] for k in keep], replace(reduction, samples=tuple(reduction.samples[k] for k in keep))
