"""The JSON metadata of a recording: strict both ways, every error names the key and what is allowed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import COUNT, Arms, ArmUnit, units_from_list, units_to_list
from estimator.errors import InputError
from estimator.strict import Fields, Rules, is_number, parse_json

SENSORS = 9
"""Channels of one robot before its commands."""
Method = Literal["untouched", "filtered", "interpolated", "fitted"]
"""Samples as they came; low-passed and thinned; interpolated, or polynomials fitted, then low-passed and thinned."""
METHODS: tuple[Method, ...] = ("untouched", "filtered", "interpolated", "fitted")
Level = Literal["joint", "wrist"]
LEVELS: tuple[Level, ...] = ("joint", "wrist")
_HERTZ = "a number of hertz, greater than 0 and less than 1e9"
_SAMPLING: Rules = {
    "native_hz": (_HERTZ, lambda x: is_number(x) and 0 < x < 1e9),
    "first_s": ("a number of seconds, between -1e6 and 1e6", lambda x: is_number(x) and abs(x) <= 1e6),
    "jitter_s": ("a number of seconds, from 0 to one", lambda x: is_number(x) and 0 <= x <= 1),
    "missing": ("a share, at least 0 and less than 1", lambda x: is_number(x) and 0 <= x < 1),
    "aligned": ("true or false", lambda x: isinstance(x, bool)),
    "method": (f"one of {', '.join(METHODS)}", lambda x: x in METHODS),
    "level": (f"one of {', '.join(LEVELS)}", lambda x: x in LEVELS),
    "steps": (
        f"{SENSORS} numbers, none negative",
        lambda x: isinstance(x, list) and len(x) == SENSORS and all(is_number(y) and y >= 0 for y in x),
    ),
}


@dataclass(frozen=True)
class Sampling:
    """How one robot's sensors were read before its samples were brought onto the recording's grid.

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
    level: Level
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
        Fields(values, tuple(_SAMPLING), where).check(_SAMPLING)
        numbers = {key: float(values[key]) for key in ("native_hz", "first_s", "jitter_s", "missing")}
        return cls(**values | numbers | {"steps": tuple(map(float, values["steps"]))})


FORMAT = "mocobot-recording"
VERSIONS = (1, 2, 3, 4, 5)
"""Version 2 has the key ``level``, version 3 ``sampling`` besides, version 4 free trials, with or without ``sampling``,
version 5 ``units``, of any trial; each is written only where it is needed."""
FREE = "free"
"""Kind of trial in which the robots hold nothing."""
TRIALS = ("random", "periodic", "static", FREE)
_REQUIRED = ("format", "version", "robots", "rate_hz", "trial", "source", "payload", "seed", "design")
_NEWER = (), ("level",), ("level", "sampling"), ("level",), ("level", "units")
"""Keys that each version requires besides."""


@dataclass(frozen=True)
class RecordingMetadata:
    """What a recording says about itself.

    Attributes:
        robots: number of robots N, at least 1.
        rate_hz: sampling rate [Hz].
        trial: "random", "periodic" or "static"; "free" where the robots hold nothing.
        source: what produced the samples, free text.
        payload: name of the payload, or None where unknown, and where there is none.
        seed: seed of a simulated trial, or None.
        design: numbers of the robots (all alike).
        control: gains, feed-forward and inner loop as plain JSON values, or None.
        level: how the file tells the samples: "joint" (phi, theta, tau) or "wrist" (h, theta, force).
        sampling: how each robot's sensors were read, N entries, where the samples are not as they were read.
        units: the robots as they are, ``x`` of shape (N, ``COUNT``), where a calibration says; the samples stay as
            they were read.
    """

    robots: int
    rate_hz: float
    trial: str
    source: str
    payload: str | None
    seed: int | None
    design: OmnidDesign
    control: dict[str, Any] | None = None
    level: Level = "joint"
    sampling: tuple[Sampling, ...] | None = None
    units: ArmUnit | None = None

    @property
    def arms(self) -> Arms:
        """The robots as they are, or as designed where nothing is known."""
        return self.design if self.units is None else self.units

    @property
    def team(self) -> int:
        """Robots that carried the payload: more than ``robots`` where ``control`` tells of forces of more."""
        forces = (self.control or {}).get("feed_forward_N")
        return max(self.robots, len(forces)) if isinstance(forces, list) else self.robots

    def to_json(self) -> str:
        """The metadata as JSON text.

        Raises:
            InputError: a value is not allowed, ``units`` are of other robots, or ``control`` is not plain finite JSON.
        """
        values: dict[str, Any] = {
            "format": FORMAT,
            "version": self._version,
            **{key: getattr(self, key) for key in _REQUIRED[2:]},
            "design": self.design.to_dict(),
        }
        if values["version"] > 1:
            values["level"] = self.level
        if self.sampling:
            values["sampling"] = [sampling.to_dict() for sampling in self.sampling]
        if self.units is not None:
            check_of_robots(self.units, self, "recording metadata: units")
            values["units"] = units_to_list(self.units)
        if self.control is not None:
            values["control"] = self.control
        try:
            text = json.dumps(values, allow_nan=False)
        except (TypeError, ValueError, RecursionError) as error:
            raise InputError(f"recording metadata cannot be written as JSON: {error}") from error
        # One set of rules: what cannot be read back must not be written.
        self.from_json(text, "recording metadata")
        return text

    @property
    def _version(self) -> int:
        if self.units is not None:
            return 5
        return 4 if self.trial == FREE else 3 if self.sampling else 2 if self.level != "joint" else 1

    @classmethod
    def from_json(cls, text: str | bytes, where: str = "metadata") -> RecordingMetadata:
        """Parse and check JSON metadata, which messages call ``where``.

        Raises:
            InputError: not JSON, a key unknown, missing or repeated, or a value of the wrong type or range.
        """
        values = parse_json(text, where)
        # Before anything else: another version may well have other keys.
        if values.get("format", FORMAT) != FORMAT:
            raise InputError(f"{where}: format is {values['format']!r}; it must be {FORMAT!r}")
        version = values.get("version", VERSIONS[0])
        if type(version) is not int or version not in VERSIONS:
            known = f"{', '.join(map(str, VERSIONS[:-1]))} and {VERSIONS[-1]}"
            raise InputError(f"{where}: version is {version!r:.60}; this program reads versions {known}")
        optional = ("control",) if version < 4 else ("sampling", "control")
        Fields(values, _REQUIRED + _NEWER[version - 1], where, optional).check(_rules(values))
        kept = {key: value for key, value in values.items() if key not in ("format", "version")}
        design = OmnidDesign.from_dict(values["design"], where=f"{where}: design")
        if "sampling" in values:
            parts = enumerate(values["sampling"])
            kept["sampling"] = tuple(Sampling.from_dict(x, f"{where}: sampling[{k}]") for k, x in parts)
        if "units" in values:
            kept["units"] = units_from_list(values["units"], design, f"{where}: units")
        return cls(**kept | {"rate_hz": float(values["rate_hz"]), "design": design})


def check_of_robots(units: ArmUnit, metadata: RecordingMetadata, what: str) -> None:
    """Whether units, which messages call ``what``, are of as many robots as a recording, and of the same design.

    Raises:
        InputError: they are not.
    """
    if units.x.shape != (metadata.robots, COUNT):
        count = len(units.x) if units.x.ndim == 2 else 1
        raise InputError(f"{what}: of {count} robots; the recording is of {metadata.robots}")
    if units.design != metadata.design:
        raise InputError(f"{what}: of robots of another design than the recording's")


def _rules(values: dict[str, Any]) -> Rules:
    """What is allowed in metadata of the version that they name."""
    version, trial, robots = (values.get(key) for key in ("version", "trial", "robots"))
    trials = TRIALS if (version or 0) >= 4 else TRIALS[:-1]
    newer = f" in version {version} (4 has free trials)" if trial == FREE and FREE not in trials else ""
    # It is printed; control characters and half surrogates are not for terminals.
    label = "text or null, all of it printable"
    if trial == FREE and isinstance(values.get("payload"), str) and values["payload"].isprintable():
        label = "null in a free trial, whose robots hold nothing"

    def is_label(x: Any) -> bool:
        return x is None or (trial != FREE and isinstance(x, str) and x.isprintable())

    def one_each(x: Any) -> bool:
        return isinstance(x, list) and len(x) == robots

    return {
        "robots": ("a whole number, at least 1", lambda x: type(x) is int and x >= 1),
        # A bound instead of isfinite, which overflows on whole numbers beyond the range of a float.
        "rate_hz": (_HERTZ, lambda x: type(x) in (int, float) and 0 < x < 1e9),
        "trial": (f"one of {', '.join(trials)}{newer}", lambda x: x in trials),
        "source": ("text", lambda x: isinstance(x, str)),
        "payload": (label, is_label),
        "seed": ("a whole number or null", lambda x: x is None or type(x) is int),
        "design": ("an object", lambda x: isinstance(x, dict)),
        "level": (f"one of {', '.join(LEVELS)}", lambda x: x in LEVELS),
        "sampling": ("a list with one object for each robot", one_each),
        "units": ("a list with one object for each robot", one_each),
        "control": ("an object (leave it out if unknown)", lambda x: isinstance(x, dict)),
    }
