"""A serial robot as a rig: rows from blocks of its logs, candidates from the catalogue."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from discrepancy.candidate import Candidate
from discrepancy.causes.excluded import excluded_from
from discrepancy.engine.explanation import Explanation, Found
from discrepancy.law_doubt import LawDoubt
from discrepancy.rig import Channel, Rig, Rows
from discrepancy.rules import LAW_SHARE
from discrepancy.rules import serial as rules
from discrepancy.serial import catalogue, shapes
from discrepancy.serial.candidate import SerialCandidate, place_of
from discrepancy.serial.catalogue import Tolerances
from discrepancy.serial.causes import CAUSES
from discrepancy.serial.forms import charged_as, forms_beside
from discrepancy.serial.logs import parts_of
from discrepancy.serial.model import SerialModel, load_spec
from discrepancy.serial.prediction import Within, unforetold
from discrepancy.serial.recording.joint_log import JointLog
from discrepancy.serial.rows.common import combinations
from discrepancy.serial.rows.remainder import Key
from discrepancy.serial.rows.whiten import whiten
from discrepancy.serial.serial_rows import SerialRows, shaped_key
from discrepancy.serial.servo.motor import with_torques
from discrepancy.serial.undecidable import general, look_alikes
from estimator.arrays import Array
from mocobot_sim.scene.named_files import check_named
from mocobot_sim.serial.effects import RobotEffect
from mocobot_sim.serial.extended import Effect, write_extended


@dataclass(frozen=True, eq=False)
class SerialRig(SerialRows, Rig):
    """Logs of one robot as a rig; its attributes are those of ``SerialRows``."""

    @classmethod
    def of(
        cls,
        model: SerialModel,
        logs: Sequence[JointLog],
        tolerances: Tolerances | None = None,
        excluded: Sequence[str] = (),
        reference: Sequence[JointLog] = (),
    ) -> SerialRig:
        """Cut the logs and find their noise.

        Args:
            model, logs, tolerances, excluded: as of ``diagnose_serial``.
            reference: logs of the robot while it was well. What is wrong with the model there, too, is no news; nothing
                of what differs has a tolerance then.

        Raises:
            InputError: the logs cannot be used, or a cause to be excluded does not exist.
        """
        left_out = excluded_from(CAUSES, excluded)
        every_log, motors = with_torques(model, [*logs, *reference])
        parts, joints = parts_of(model, every_log, motors)
        hints = catalogue.hints_of([part.signals for part in parts], logs, motors)
        given = catalogue.events() if reference else {} if tolerances is None else tolerances
        every = catalogue.candidates(parts[0].signals.tree, model.joints, hints, left_out, given)
        # What differs between the days must not look like noise, so each has its own.
        apart = [group for group in (parts[: len(logs)], parts[len(logs) :]) if group]
        whitened = [whiten(group, joints, every) for group in apart]
        whitening = tuple(white for done in whitened for white in done.whitening)
        spoilt = frozenset[Key]().union(*(done.spoilt for done in whitened))
        changed = sum(len(part.blocks) for part in apart[0])
        rig = cls(
            model,
            parts,
            joints,
            hints,
            whitening,
            whitened[0].level,
            given,
            left_out,
            spoilt,
            len(whitening),
            (),
            motors,
            {
                shaped_key(c): [rows for done in whitened for rows in done.traces[k]]
                for k, c in enumerate(every)
            },
        )
        if not reference:
            return rig
        common = combinations([rig.physical(c) for c in rig.candidates()], whitening)
        return replace(rig, changed=changed, common=common, _seen={})

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

    def row_rate_hz(self, trial: int) -> float:
        part, _ = self.block_of[trial]
        return part.signals.rate_hz / part.reduction.step

    def quantities(self, trial: int) -> dict[str, Array]:
        """Speed over every joint's typical one, and per joint position, per row of a block, shape (n,) each."""
        part, k = self.block_of[trial]
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

    def rows(self, candidates: Sequence[Candidate]) -> list[Rows]:
        """Whitened rows of every block; where joints rest, their friction is an unknown of the block."""
        columns = [self.columns(candidate) for candidate in candidates]
        return [
            Rows(
                self.trials[t], residual, self.local_columns(t), self.common_columns(t),
                [c[t] for c in columns], self.row_times(t),
            )
            for t, residual in enumerate(self.residual(np.zeros(0), [], []))
        ]  # fmt: skip

    def residual(
        self, shared: Array, local: Sequence[Array], active: Sequence[tuple[Candidate, Array]]
    ) -> list[Array]:
        """Exact whitened residual of every block with causes taken out."""
        left = self.physical_residual(active, shared)
        return [white(r) for white, r in zip(self.whitening, left, strict=True)]

    def candidates(self) -> list[Candidate]:
        """Every cause at every place; pushes come from ``transients``."""
        tree = self.tree
        every = catalogue.candidates(
            tree, self.model.joints, self.hints, self.excluded, self.tolerances, change=bool(self.common)
        )
        return [c for c in every if c.key not in self.spoilt]

    def possible(self, candidate: Candidate, values: Array, covariance: Array) -> bool:
        """Whether such values can be: no negative mass, moments of inertia, compliance or play beyond the errors."""
        se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        cause, tree, at = CAUSES[candidate.cause], self.tree, place_of(candidate)
        if not cause.stands_out(values, candidate.shape):
            return False
        gone = bool(self.common) and cause.reversible and cause.possible(tree, at, -values, se)
        return gone or cause.possible(tree, at, values, se)

    def law_doubt(self, candidate: Candidate) -> LawDoubt:
        """Any robot: noise is the sensors', every law leaves more than that, and much that is real has none."""
        share = LAW_SHARE if candidate.transient else rules.SERIAL_LAW_SHARE
        return LawDoubt(share, rules.RIVAL_SHARE, rules.UNSEEN_NATS)

    def other_forms(
        self, candidate: Candidate, values: Array, there: Sequence[tuple[Candidate, Array]],
        rival: Candidate | None = None,
    ) -> list[Array]:  # fmt: skip
        """What a joint's causes, and the friction that its model names, leave if their laws have other forms."""
        return forms_beside(self, candidate, values, there, rival)

    def charged_alike(self, one: Candidate, other: Candidate) -> bool:
        """Friction is not judged beside the forms of other friction, and a push beside none."""
        return charged_as(one) == charged_as(other)

    def transients(self, remaining: Sequence[Array]) -> list[Candidate]:
        """Pushes at the intervals where the torques are worst; none where torques are only what duties should give.

        A servo's gear leaves more than its readings' noise at every reversal, which looks like a push each time.
        """
        if "push" in self.excluded or self.motors:
            return []
        times = [self.row_times(t) for t in range(self.changed)]
        return shapes.pushes(self.tree, self.model.joints, times, remaining[: self.changed])

    def refinements(self, candidate: Candidate, *, finer: bool = False) -> list[Candidate]:
        """The candidate with every other shape of its cause; a push with its interval moved."""
        return shapes.others(candidate, self.hints, finer=finer)

    rigid = ("payload",)
    shaped = ("friction", "warming", "torque_scale")
    curved = True
    layered = True
    normal = True

    def steps(self, candidate: Candidate) -> list[tuple[Candidate, Candidate, float]]:
        """For every number of its shape that the data determine: a little less, a little more, and the difference."""
        return shapes.steps(candidate)

    def closer(self, candidate: Candidate) -> list[Candidate]:
        """A payload nearer to its link's frame: its first moment is known better than its mass."""
        return [candidate.in_shape(shape) for shape in CAUSES[candidate.cause].closer(candidate.shape)]

    def simulation(
        self, trial: int, shared: Array, local: Array, active: Sequence[tuple[Candidate, Array]],
        healthy: Sequence[tuple[Candidate, Array]] = (),
    ) -> Callable[[], dict[str, Array] | None]:  # fmt: skip
        """What foretells one block's torques from its motion.

        It returns measured minus foretold torque by joint in motion, low-passed as the rows are, shape (n,) each.
        """
        return partial(self._unforetold, trial, [(c, v) for c, v in active if c.acts_in(trial)], shared)

    def _unforetold(
        self, trial: int, active: Sequence[tuple[Candidate, Array]], shared: Array
    ) -> dict[str, Array]:
        taken = frozenset(candidate.key for candidate, _ in active if candidate.parameters[0].tolerance)
        left, within = self.physical_residual(active, shared), self._within(taken)
        if within:
            left[trial] = unforetold(trial, left, within)
        error = self.in_motion(left[trial], trial)
        return {channel.name: error[:, c] for c, channel in enumerate(self.channels)}

    def _within(self, taken: frozenset[Key]) -> Sequence[Within]:
        """What is normal in every block, less what causes take; only the last asked for is kept: it takes memory."""
        if taken not in self._kept:
            within = [c for c in self._normal if c.key not in taken]
            physical = zip(*([x * c.units for x in self.physical(c)] for c in within), strict=True)
            self._kept.clear()
            self._kept[taken] = [
                Within(np.concatenate(columns, axis=2), self.whitening[t], self.local_columns(t))
                for t, columns in enumerate(physical)
            ]
        return self._kept[taken]

    @cached_property
    def _kept(self) -> dict[frozenset[Key], Sequence[Within]]:
        return {}

    @cached_property
    def _normal(self) -> list[Candidate]:
        """What is always in the model, within its tolerances."""
        return [c for c in self.candidates() if all(p.tolerance > 0 for p in c.parameters)]

    def response_scale(self, trial: int) -> dict[str, tuple[Array, Array]]:
        """Noise of the rows, and the torque's own size."""
        part, k = self.block_of[trial]
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
            InputError: the folder cannot be written, MuJoCo refuses the model, or files in it are not its own.
        """
        effects = [effect for found in explanation.found for effect in self.effects(found)]
        spec = load_spec(self.model.path)
        check_named(self.model.path, assets=False)
        write_extended(spec, effects, folder, self.trials, reference=bool(self.common))

    def effects(self, found: Found) -> Sequence[Effect]:
        """A named cause as the simulator's effects."""
        candidate = found.candidate
        values, _ = self.effect_parameters(candidate, found.values, found.covariance)
        more = {"gyration_m": rules.PAYLOAD_GYRATION_M} if candidate.cause == "payload" else {}
        before = candidate.partner if isinstance(candidate, SerialCandidate) else None
        return [RobotEffect(candidate.cause, candidate.joint, before, values | more)]

    def undecidable(self) -> list[dict[str, Any]]:
        """What such logs cannot decide, and what these cannot."""
        every = [c for c in self.candidates() if not c.hidden]
        return [*general(), *look_alikes(every, [self.columns(c) for c in every])]
