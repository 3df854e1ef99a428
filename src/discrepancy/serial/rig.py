"""A serial robot as a rig: rows from blocks of its logs, candidates from the catalogue."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy.causes.excluded import excluded_from
from discrepancy.engine.explanation import Explanation
from discrepancy.least_squares.whitening import Whitening
from discrepancy.rig import Candidate, Channel, Rig, Rows
from discrepancy.serial import catalogue, rules, shapes
from discrepancy.serial.candidate import SerialCandidate
from discrepancy.serial.catalogue import Tolerances
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.causes.base import Hints
from discrepancy.serial.logs import Part, parts_of
from discrepancy.serial.model import SerialModel, load_spec
from discrepancy.serial.prediction import Within, unforetold
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.remainder import Key
from discrepancy.serial.rows.signals import Nominal
from discrepancy.serial.undecidable import general, look_alikes
from discrepancy.serial.whiten import whiten
from estimator.arrays import Array
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import write_extended


@dataclass(frozen=True, eq=False)
class SerialRig(Rig):
    """Logs of one robot, cut into blocks that validate each other.

    Attributes:
        model: the robot as described.
        parts: the logs with their rows.
        joints: which joints have torques, and so channels, from 0, shape (C,).
        hints: where shapes begin.
        whitening: of every block.
        level: sensors' noise over what the whole catalogue leaves, of every joint with torques, shape (C,).
        tolerances: given standard deviations by cause and parameter; causes that are not in it have their own.
        excluded: causes left out of the catalogue.
        spoilt: cause and place of what noise of the positions hides.
    """

    model: SerialModel
    parts: tuple[Part, ...]
    joints: NDArray[np.intp]
    hints: Hints
    whitening: tuple[Whitening, ...]
    level: Array
    tolerances: Tolerances
    excluded: frozenset[str]
    spoilt: frozenset[Key]
    _seen: dict[Any, list[Array]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(
        cls,
        model: SerialModel,
        logs: Sequence[JointLog],
        tolerances: Tolerances | None = None,
        excluded: Sequence[str] = (),
    ) -> SerialRig:
        """Cut the logs and find their noise.

        Raises:
            InputError: the logs cannot be used, or a cause to be excluded does not exist.
        """
        left_out = excluded_from(CAUSES, excluded)
        parts, joints = parts_of(model, logs)
        hints = catalogue.hints_of([part.signals for part in parts], logs)
        given = {} if tolerances is None else tolerances
        every = catalogue.candidates(parts[0].signals.tree, model.joints, hints, left_out, given)
        whitening, level, spoilt = whiten(parts, joints, every)
        return cls(model, parts, joints, hints, whitening, level, given, left_out, spoilt)

    @property
    def trials(self) -> Sequence[str]:
        """Names of the blocks."""
        return [name for part in self.parts for name in part.names]

    @property
    def channels(self) -> Sequence[Channel]:
        """Measured torque of every joint minus what the model asks for."""
        return [
            Channel(
                f"{self.model.joints[j]} torque",
                f"joint {j + 1}",
                None,
                "N" if self.model.slides[j] else "N m",
            )
            for j in self.joints
        ]

    @property
    def nominal(self) -> Nominal:
        """The model's numbers."""
        return self.parts[0].signals.nominal

    @cached_property
    def _where(self) -> list[tuple[Part, int]]:
        """Log and number in it of every block."""
        return [(part, k) for part in self.parts for k in range(len(part.blocks))]

    def row_rate_hz(self, trial: int) -> float:
        part, _ = self._where[trial]
        return part.signals.rate_hz / part.reduction.step

    def row_times(self, trial: int) -> Array:
        """Time of every row of a block on its log's clock [s], shape (n,)."""
        part, k = self._where[trial]
        return part.signals.time[part.reduction.samples[k]]

    def quantities(self, trial: int) -> dict[str, Array]:
        """Speed over every joint's typical one, and per joint position, per row of a block, shape (n,) each."""
        part, k = self._where[trial]
        at, s = part.reduction.samples[k], part.signals
        share = s.dq[at] / s.typical
        out = {"speed": np.sqrt(np.mean(share**2, axis=1))}
        return out | {f"position of joint {j + 1}": s.q[at, j] for j in self.joints}

    def directions(self, trial: int) -> dict[str, Array]:
        """Every joint's own channel."""
        white = self.whitening[trial]
        own = white.rows_only(np.tile(np.eye(len(self.joints)), (white.moving, 1, 1)))
        own /= np.linalg.norm(own, axis=1, keepdims=True)
        return {f"the torque of joint {j + 1}": own[:, :, [c]] for c, j in enumerate(self.joints)}

    def physical(self, candidate: Candidate) -> list[Array]:
        """Columns of one candidate in N m or N, rows (n, C, k) of every block."""
        cause, at = CAUSES[candidate.cause], _at(candidate)
        key = (candidate.key, tuple(sorted(candidate.shape.items())))
        if key not in self._seen:
            done = [part.reduction(cause.columns(part.signals, at, candidate.shape)) for part in self.parts]
            rows = [block[:, self.joints] for blocks in done for block in blocks]
            if candidate.transient:
                return [block * candidate.acts_in(t) for t, block in enumerate(rows)]
            self._seen[key] = rows
        return self._seen[key]

    def columns(self, candidate: Candidate) -> list[Array]:
        """Whitened columns of one candidate, shape (n, C, k) per block."""
        return [white(c) for white, c in zip(self.whitening, self.physical(candidate), strict=True)]

    def rows(self, candidates: Sequence[Candidate]) -> list[Rows]:
        """Whitened rows of every block; where joints rest, their friction is an unknown of the block."""
        columns = [self.columns(candidate) for candidate in candidates]
        return [
            Rows(
                self.trials[t], residual, self.local_columns(t), np.zeros((*residual.shape, 0)),
                [c[t] for c in columns], self.row_times(t),
            )
            for t, residual in enumerate(self.residual(np.zeros(0), [], []))
        ]  # fmt: skip

    def local_columns(self, trial: int) -> Array:
        """Whitened columns of the friction that joints may have while they rest, shape (n, C, l)."""
        part, k = self._where[trial]
        rests = [rest[:, self.joints] for rest in part.rests(k)]
        none = np.zeros((len(part.reduction.samples[k]), len(self.joints), 0))
        return self.whitening[trial](np.stack(rests, axis=2)) if rests else none

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """Exact whitened residual of every block with causes taken out."""
        return [white(r) for white, r in zip(self.whitening, self.physical_residual(active), strict=True)]

    def physical_residual(self, active: Sequence[tuple[Candidate, Array]]) -> list[Array]:
        """The same in N m or N, rows (n, C) of every block."""
        out = []
        for part in self.parts:
            left = part.reduction(part.signals.residual)
            out += [rows[:, self.joints] for rows in left]
        for candidate, values in active:
            cause = CAUSES[candidate.cause]
            if type(cause).exact is type(CAUSES["armature"]).exact:  # linear
                taken = [columns @ values for columns in self.physical(candidate)]
            else:
                at = _at(candidate)
                done = [p.reduction(cause.exact(p.signals, at, values, candidate.shape)) for p in self.parts]
                taken = [block[:, self.joints] for blocks in done for block in blocks]
            out = [r - x * candidate.acts_in(t) for t, (r, x) in enumerate(zip(out, taken, strict=True))]
        return out

    def candidates(self) -> list[Candidate]:
        """Every cause at every place; pushes come from ``transients``."""
        tree = self.nominal.tree
        every = catalogue.candidates(tree, self.model.joints, self.hints, self.excluded, self.tolerances)
        return [c for c in every if c.key not in self.spoilt]

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        """Whether such values can be: no negative mass, moments of inertia, compliance or play beyond the errors."""
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        return CAUSES[candidate.cause].possible(self.nominal.tree, _at(candidate), values, se)

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Pushes at the intervals where the torques are worst."""
        if "push" in self.excluded:
            return []
        times = [self.row_times(t) for t in range(len(remaining))]
        return [*shapes.pushes(self.nominal.tree, self.model.joints, times, remaining)]

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        """The candidate with every other shape of its cause; a push with its interval moved."""
        return shapes.others(candidate, self.hints, finer=finer)

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        """For every number of its shape that the data determine: a little less, a little more, and the difference."""
        return shapes.steps(candidate)

    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]]
    ) -> Callable[[], dict[str, Array] | None]:
        """What foretells one block's torques from its motion.

        It returns measured minus foretold torque by joint, low-passed as the rows are, shape (n,) each.
        """
        return partial(self._unforetold, trial, [(c, v) for c, v in active if c.acts_in(trial)])

    def _unforetold(self, trial: int, active: Sequence[tuple[Candidate, Array]]) -> dict[str, Array]:
        taken = {candidate.key for candidate, _ in active}
        within = [c for c in self._normal if c.key not in taken]
        left = self.physical_residual(active)
        if within:
            physical = zip(*([x * c.units for x in self.physical(c)] for c in within), strict=True)
            each = [
                Within(np.concatenate(columns, axis=2), self.whitening[t], self.local_columns(t))
                for t, columns in enumerate(physical)
            ]
            left[trial] = unforetold(trial, left, each)
        return {channel.name: left[trial][:, c] for c, channel in enumerate(self.channels)}

    @cached_property
    def _normal(self) -> list[Candidate]:
        """What is always in the model, within its tolerances."""
        return [c for c in self.candidates() if all(p.tolerance > 0 for p in c.parameters)]

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        """Noise of the rows, and the torque's own size."""
        part, k = self._where[trial]
        torque = part.reduction(part.signals.torque)[k][:, self.joints]
        noise = np.sqrt(np.mean(self.sigma(trial) ** 2, axis=0))
        return {
            channel.name: (noise[[c]], np.array([np.sqrt(np.mean(torque[:, c] ** 2))]))
            for c, channel in enumerate(self.channels)
        }

    def sigma(self, trial: int) -> Array:
        """Standard deviation of the noise in every row of a block, shape (n, C)."""
        white = self.whitening[trial]
        return white.loudness * np.linalg.norm(white.chol_moving, axis=1)

    def effect_parameters(
        self, candidate: Candidate, values: Array, covariance: Array
    ) -> tuple[dict[str, float], dict[str, float]]:
        """Values with standard errors, and the shape, of which those have one that the data determine."""
        names = [p.name for p in candidate.parameters]
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        found = dict(zip(names, map(float, values), strict=True)) | dict(candidate.shape)
        fitted = [*names, *CAUSES[candidate.cause].steps(candidate.shape)]
        errors = {name: float("nan") for name in candidate.shape}
        return found, errors | dict(zip(fitted, map(float, se), strict=False))

    def write_extended(self, explanation: Explanation, folder: Path) -> None:
        """Write the model with the named causes in it.

        Raises:
            InputError: the folder cannot be written, or MuJoCo refuses the model.
        """
        effects = []
        for found in explanation.found:
            candidate = found.candidate
            values, _ = self.effect_parameters(candidate, found.values, found.covariance)
            more = {"gyration_m": rules.PAYLOAD_GYRATION_M} if candidate.cause == "payload" else {}
            before = candidate.partner if isinstance(candidate, SerialCandidate) else None
            effects.append(RobotEffect(candidate.cause, candidate.joint, before, values | more))
        write_extended(load_spec(self.model.path), effects, folder, self.trials)

    def undecidable(self) -> list[dict[str, Any]]:
        """What such logs cannot decide, and what these cannot."""
        every = self.candidates()
        return [*general(), *look_alikes(every, [self.columns(c) for c in every])]


def _at(candidate: Candidate) -> int:
    return -1 if candidate.joint is None else candidate.joint - 1
