"""The JSON metadata of a recording: strict both ways, every error names the key and what is allowed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

from estimator.arm.design import OmnidDesign
from estimator.arm.unit import COUNT, Arms, ArmUnit, units_from_list, units_to_list
from estimator.errors import InputError
from estimator.strict import Fields, is_number, parse_json

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


FORMAT = "mocobot-recording"
VERSIONS = (1, 2, 3, 4, 5)
"""Version 2 has the key ``level``, version 3 ``sampling`` besides, version 4 free trials, with or without ``sampling``,
version 5 ``units``, of any trial; each is written only where it is needed."""
FREE = "free"
"""Kind of trial in which the robots hold nothing."""
TRIALS = ("random", "periodic", "static", FREE)
Level = Literal["joint", "wrist"]
LEVELS: tuple[Level, ...] = ("joint", "wrist")
_REQUIRED = ("format", "version", "robots", "rate_hz", "trial", "source", "payload", "seed", "design")
_OPTIONAL = ("control",)


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
        """Parse and check JSON metadata.

        Args:
            text: UTF-8 JSON.
            where: what to call it in messages.

        Raises:
            InputError: not JSON, a key unknown, missing or repeated, or a value of the wrong type or range.
        """
        values = parse_json(text, where)
        _check_format(values, where)
        version = values.get("version", 1)
        newer = (), ("level",), ("level", "sampling"), ("level",), ("level", "units")
        required = _REQUIRED + newer[version - 1]
        optional = _OPTIONAL if version < 4 else ("sampling", *_OPTIONAL)
        _check_values(Fields(values, required, where, optional))
        kept = {key: value for key, value in values.items() if key not in ("format", "version")}
        design = OmnidDesign.from_dict(values["design"], where=f"{where}: design")
        if "sampling" in values:
            parts = enumerate(values["sampling"])
            kept["sampling"] = tuple(Sampling.from_dict(x, f"{where}: sampling[{k}]") for k, x in parts)
        if "units" in values:
            kept["units"] = units_from_list(values["units"], design, f"{where}: units")
        return cls(**kept | {"rate_hz": float(values["rate_hz"]), "design": design})


def check_of_robots(units: ArmUnit, metadata: RecordingMetadata, what: str) -> None:
    """Whether units are of as many robots, and of the same design.

    Args:
        units: robots as they are.
        metadata: of a recording of robots.
        what: how messages call the units.

    Raises:
        InputError: they are not.
    """
    if units.x.shape != (metadata.robots, COUNT):
        count = len(units.x) if units.x.ndim == 2 else 1
        raise InputError(f"{what}: of {count} robots; the recording is of {metadata.robots}")
    if units.design != metadata.design:
        raise InputError(f"{what}: of robots of another design than the recording's")


def _check_format(values: dict[str, Any], where: str) -> None:
    """Before anything else: another version may well have other keys."""
    if values.get("format", FORMAT) != FORMAT:
        raise InputError(f"{where}: format is {values['format']!r}; it must be {FORMAT!r}")
    version = values.get("version", VERSIONS[0])
    if type(version) is not int or version not in VERSIONS:
        known = f"{', '.join(map(str, VERSIONS[:-1]))} and {VERSIONS[-1]}"
        raise InputError(f"{where}: version is {version!r:.60}; this program reads versions {known}")


def _check_values(fields: Fields) -> None:
    def require(key: str, allowed: str, *, good: bool) -> None:
        if not good:
            fields.refuse(key, allowed)

    values = fields.values
    robots, rate, payload, seed = (values[key] for key in ("robots", "rate_hz", "payload", "seed"))
    require("robots", "a whole number, at least 1", good=type(robots) is int and robots >= 1)
    # A bound instead of isfinite, which overflows on whole numbers beyond the range of a float.
    is_rate = type(rate) in (int, float) and 0 < rate < 1e9
    require("rate_hz", "a number of hertz, greater than 0 and less than 1e9", good=is_rate)
    trials = TRIALS if values["version"] >= 4 else TRIALS[:-1]
    newer = (
        ""
        if FREE in trials or values["trial"] != FREE
        else f" in version {values['version']} (4 has free trials)"
    )
    require("trial", f"one of {', '.join(trials)}{newer}", good=values["trial"] in trials)
    require("source", "text", good=isinstance(values["source"], str))
    # It is printed; control characters and half surrogates are not for terminals.
    is_label = payload is None or (isinstance(payload, str) and payload.isprintable())
    require("payload", "text or null, all of it printable", good=is_label)
    empty = payload is None or values["trial"] != FREE
    require("payload", "null in a free trial, whose robots hold nothing", good=empty)
    require("seed", "a whole number or null", good=seed is None or type(seed) is int)
    fields.object("design")
    if "level" in fields:
        require("level", f"one of {', '.join(LEVELS)}", good=values["level"] in LEVELS)
    if "sampling" in fields:
        sampling = values["sampling"]
        good = isinstance(sampling, list) and len(sampling) == robots
        require("sampling", "a list with one object for each robot", good=good)
    if "units" in fields:
        units = values["units"]
        good = isinstance(units, list) and len(units) == robots
        require("units", "a list with one object for each robot", good=good)
    if "control" in fields:
        require("control", "an object (leave it out if unknown)", good=isinstance(values["control"], dict))
