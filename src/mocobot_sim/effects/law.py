"""A formula at a place: what nobody has listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from estimator.errors import InputError
from mocobot_sim.effects.base import Effect
from mocobot_sim.laws import signals, targets
from mocobot_sim.laws.functions import FUNCTIONS, Inside, Step, check_numbers
from mocobot_sim.trial.actors import Actor, Reader

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene


@dataclass(frozen=True)
class Law(Effect):
    """``amplitude`` times a function of a signal, and times another signal where one is named, added to a target.

    ``target`` is a reading (``tau_2_1`` of robot 2, joint 1; ``phi_2_1``, ``theta_2_1``), a torque
    (``driven_torque_2_1``, ``gimbal_torque_2_1``), a displacement (``base_position_2_x``, ``grasp_position_2_x``), or
    the payload's (``payload_force_x`` in robot 1's {b}, ``payload_moment_x``, ``payload_mass``,
    ``payload_first_moment_x``, ``payload_spin_x`` in {1}). ``of`` and ``times`` are signals: ``time``, ``phi_2_1``,
    ``phi_rate_2_1``, ``phi_acceleration_2_1``, the same of ``theta``, ``tau_2_1``, ``payload_position_x`` (and
    ``velocity``, ``acceleration``, ``felt``, ``rate``, ``turn``, which is an acceleration, ``up``). All in SI; readings
    are as seen. A sum of signals is one, too: ``0.6*payload_felt_x + -0.8*payload_felt_y``.

    ``number``, ``second`` and ``phase_rad`` are what the function has inside: a knee, the periods a turn of a sine, a
    time constant, half the width of a play (docs/effects.md).
    """

    repeats = True
    texts = ("target", "function", "of", "times")
    target: str
    function: str
    of: str
    amplitude: float
    number: float = 0.0
    second: float = 0.0
    phase_rad: float = 0.0
    times: str = ""

    def __post_init__(self) -> None:
        """Check names and numbers.

        Raises:
            InputError: a name is not known, or a number is not allowed with this function.
        """
        super().__post_init__()
        self._named("target", self.target, targets.is_target(self.target), targets.WORDS)
        self._named("function", self.function, self.function in FUNCTIONS, ", ".join(FUNCTIONS))
        self._named("of", self.of, signals.is_signal(self.of), signals.WORDS)
        self._named("times", self.times, not self.times or signals.is_signal(self.times), signals.WORDS)
        check_numbers(self.function, self.number, self.second)

    def _named(self, field: str, value: str, known: bool, words: str) -> None:
        if not known:
            raise InputError(f"law: {field} is {value!r:.60}; it must be one of {words}")

    def step(self, dt: float) -> Step:
        """The function, one value after the other at steps of ``dt`` [s]."""
        return FUNCTIONS[self.function](Inside(self.number, self.second, self.phase_rad, dt))

    def actors(self, trial_number: int | None) -> Sequence[Actor]:
        """Who acts in a trial."""
        return () if self._reads else (self._acts(),)

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        """Which sensor misreads in it."""
        return (self._acts(),) if self._reads else ()

    @property
    def _reads(self) -> bool:
        return bool(targets.READING.fullmatch(self.target))

    def _acts(self) -> targets.Acts:
        return targets.Acts(self.target, self.of, self.times, self.amplitude, partial(Law.step, self))

    def _edit(self, scene: TeamScene) -> TeamScene:
        for robot in targets.robots_in(self.target, self.of, self.times):
            if robot > scene.robots:
                raise InputError(f"law: there is no robot {robot}; the team has robots 1 .. {scene.robots}")
        if not scene.carries and targets.is_about_payload(self.target, self.of, self.times):
            raise InputError("law: it is about a payload; robots of a free trial hold nothing")
        return targets.with_slide(scene, self.target)
