"""A formula at a joint of a serial robot: what nobody has listed."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, field

from estimator.errors import InputError
from estimator.strict import Fields
from mocobot_sim.laws.functions import FUNCTIONS, NEEDS, POSITIVE, WIDE, Inside, Step
from mocobot_sim.serial.state import State

TARGET = re.compile(r"(torque|position)_([1-9][0-9]*)")
SIGNAL = re.compile(r"(q|dq|ddq|direction|load|torque)_([1-9][0-9]*)")
KEYS = ("target", "function", "of", "amplitude", "number", "second", "phase_rad", "times")


@dataclass(eq=False)
class JointLaw:
    """``amplitude`` times a function of a signal, and times another signal where one is named, at a joint.

    Attributes:
        target: ``torque_3``: what the torque of joint 3 holds besides; ``position_3``: what its reading is off by,
            which is an error of the log and not simulated.
        function: as in ``mocobot_sim.laws.functions``.
        of, times: ``time``, ``q_3``, ``dq_3``, ``ddq_3``, ``direction_3``, ``load_3``, ``torque_3``; ``times`` is empty
            where there is none. All in SI.
        amplitude: in the target's unit over those of the signals.
        number, second, phase_rad: what the function has inside (docs/diagnosis/laws.md).
    """

    target: str
    function: str
    of: str
    amplitude: float
    number: float = 0.0
    second: float = 0.0
    phase_rad: float = 0.0
    times: str = ""
    _step: Step | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        """Check names and numbers.

        Raises:
            InputError: a name is not known, or a number is not allowed with this function.
        """
        self._known("target", self.target, bool(TARGET.fullmatch(self.target)), "torque_3 or position_3")
        self._known("function", self.function, self.function in FUNCTIONS, ", ".join(FUNCTIONS))
        for name in ("of", "times"):
            value = getattr(self, name)
            known = value == "time" or bool(SIGNAL.fullmatch(value)) or (name == "times" and not value)
            self._known(name, value, known, "time, q_3, dq_3, ddq_3, direction_3, load_3, torque_3")
        if self.function in POSITIVE and self.number <= 0.0:
            raise InputError(
                f"law: number is {self.number!r}; of {self.function} it is {NEEDS[self.function]}"
            )
        if self.function in WIDE and self.second <= 0.0:
            raise InputError(f"law: second is {self.second!r}; with {self.function} it must be above 0")

    def _known(self, name: str, value: str, known: bool, words: str) -> None:
        if not known:
            raise InputError(f"law: {name} is {value!r:.60}; it must be one of {words}")

    @property
    def joint(self) -> int:
        """At which joint, from 1."""
        return int(self.target.rpartition("_")[2])

    @property
    def acts(self) -> bool:
        """Whether it is a torque, and no error of a reading."""
        return self.target.startswith("torque")

    def torque(self, state: State) -> float:
        """What it takes from the drive of its joint now [N m or N]; to be asked once a step, as it may remember."""
        if self._step is None:
            self._step = FUNCTIONS[self.function](
                Inside(self.number, self.second, self.phase_rad, state.period_s)
            )
        value = self.amplitude * self._step(state.signal(self.of))
        return value * state.signal(self.times) if self.times else value

    def to_dict(self) -> dict[str, str | float]:
        """Plain JSON values."""
        values = asdict(self)
        return {key: values[key] for key in KEYS}

    @classmethod
    def of_dict(cls, values: object, where: str) -> JointLaw:
        """From plain JSON values.

        Raises:
            InputError: they are no law.
        """
        entry = Fields(values, KEYS, where)
        texts = {key: str(entry.values[key]) for key in ("target", "function", "of", "times")}
        numbers = {key: entry.number(key) for key in ("amplitude", "number", "second", "phase_rad")}
        return cls(**texts, **numbers)
