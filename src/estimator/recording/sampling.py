"""How a robot's sensors were read before its samples were brought onto the recording's grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from estimator.strict import Fields, is_number

SENSORS = 9
"""Channels of one robot before its commands."""
Method = Literal["untouched", "filtered", "interpolated", "fitted"]
"""Samples as they came; low-passed and thinned; interpolated, or polynomials fitted, then low-passed and thinned."""
METHODS: tuple[Method, ...] = ("untouched", "filtered", "interpolated", "fitted")
_KEYS = ("native_hz", "first_s", "jitter_s", "missing", "aligned", "method", "level", "steps")


@dataclass(frozen=True)
class Sampling:
    """One robot's native samples.

    A recording that was interpolated, filtered or thinned shows neither the step of an encoder nor the noise of a
    single reading any more; errors that repeat while a joint rests are still in it. This tells them.

    Attributes:
        native_hz: rate of the samples [Hz], by the recording's clock.
        first_s: when the first was taken, in the recording's time [s].
        jitter_s: standard deviation of the instants from evenly spaced ones [s].
        missing: share of samples that the log lacked.
        aligned: whether its clock was set by the motion, so that the motion tells nothing of it any more.
        method: what was done to them before the robots were brought together.
        level: channels of the log, and so of ``steps``: "joint" or "wrist".
        steps: rounding step of every channel of the log [rad, rad, N m] or [m, rad, N], 0 for none.
    """

    native_hz: float
    first_s: float
    jitter_s: float
    missing: float
    aligned: bool
    method: Method
    level: Literal["joint", "wrist"]
    steps: tuple[float, ...]

    def steps_of(self, kind: int) -> Sequence[float]:
        """Steps of phi (0), theta (1) or tau (2), three joints; 0 where the log had other channels."""
        if self.level == "wrist" and kind != 1:
            return (0.0, 0.0, 0.0)
        return self.steps[3 * kind : 3 * kind + 3]

    def later(self, start_s: float) -> Sampling:
        """The same for a part of the recording that begins at ``start_s`` [s]."""
        return replace(self, first_s=self.first_s - start_s)

    def to_dict(self) -> dict[str, Any]:
        """Plain values by name."""
        return asdict(self) | {"steps": list(self.steps)}

    @classmethod
    def from_dict(cls, values: Any, where: str) -> Sampling:
        """Parse and check.

        Raises:
            InputError: a key is unknown or missing, or a value of the wrong type or range.
        """
        fields = Fields(values, _KEYS, where)

        def require(key: str, allowed: str, *, good: bool) -> None:
            if not good:
                fields.refuse(key, allowed)

        native, first, jitter, missing, aligned, method, level, steps = (values[key] for key in _KEYS)
        require("native_hz", "a number of hertz, greater than 0 and less than 1e9",
                good=is_number(native) and 0 < native < 1e9)  # fmt: skip
        require(
            "first_s",
            "a number of seconds, between -1e6 and 1e6",
            good=is_number(first) and abs(first) <= 1e6,
        )
        require("jitter_s", "a number of seconds, from 0 to one", good=is_number(jitter) and 0 <= jitter <= 1)
        require(
            "missing", "a share, at least 0 and less than 1", good=is_number(missing) and 0 <= missing < 1
        )
        require("aligned", "true or false", good=isinstance(aligned, bool))
        require("method", f"one of {', '.join(METHODS)}", good=method in METHODS)
        require("level", "one of joint, wrist", good=level in ("joint", "wrist"))
        good = (
            isinstance(steps, list) and len(steps) == SENSORS and all(is_number(x) and x >= 0 for x in steps)
        )
        require("steps", f"{SENSORS} numbers, none negative", good=good)
        numbers = float(native), float(first), float(jitter), float(missing)
        return cls(*numbers, aligned, method, level, tuple(float(step) for step in steps))
