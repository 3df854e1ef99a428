"""JSON metadata of a recording: strict in reading and writing, with errors that name the key and the allowed values."""

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
"""Number of sensor channels of one robot, without its commands."""
Method = Literal["untouched", "filtered", "interpolated", "fitted"]
"""Processing of samples: none; low-passed and thinned; interpolated, or fitted with polynomials, then low-passed and
thinned."""
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
    """How one robot's sensors were read before resampling to the recording's grid.

    An interpolated, filtered or thinned recording no longer shows the step of an encoder or the noise of a single
    reading. It still contains errors that are constant while a joint rests. This class documents steps and noise.

    Attributes:
        native_hz: rate of the samples [Hz], by the recording's clock.
        first_s: time of the first sample, in the recording's time [s].
        jitter_s: standard deviation of the sample times from an even grid [s].
        missing: share of samples that the log lacked.
        aligned: whether the clock was aligned by the motion, so that the motion has no more information on it.
        method: processing before the robots were merged.
        level: channels of the log and of ``steps``: "joint" or "wrist".
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
        """Return the steps of phi (0), theta (1) or tau (2), three joints; 0 if the log had other channels."""
        if self.level == "wrist" and kind != 1:
            return (0.0, 0.0, 0.0)
        return self.steps[3 * kind : 3 * kind + 3]

    def later(self, start_s: float) -> Sampling:
        """Shift to a part of the recording that begins at ``start_s`` [s]."""
        return replace(self, first_s=self.first_s - start_s)

    def to_dict(self) -> dict[str, Any]:
        """Convert to plain values by name."""
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
"""Version 2 adds the key ``level``, version 3 ``sampling``, version 4 free trials, with or without ``sampling``,
version 5 ``units``, for any trial. Files use the lowest sufficient version."""
FREE = "free"
"""Kind of trial with unloaded robots."""
TRIALS = ("random", "periodic", "static", FREE)
_REQUIRED = ("format", "version", "robots", "rate_hz", "trial", "source", "payload", "seed", "design")
_NEWER = (), ("level",), ("level", "sampling"), ("level",), ("level", "units")
"""Additional required keys of each version."""


@dataclass(frozen=True)
class RecordingMetadata:
    """Metadata of a recording.

    Attributes:
        robots: number of robots N, at least 1.
        rate_hz: sampling rate [Hz].
        trial: "random", "periodic" or "static"; "free" for unloaded robots.
        source: what produced the samples, free text.
        payload: name of the payload, or None if unknown or absent.
        seed: seed of a simulated trial, or None.
        design: design parameters of the robots (all alike).
        control: gains, feed-forward and inner loop as plain JSON values, or None.
        level: columns of the file: "joint" (phi, theta, tau) or "wrist" (h, theta, force).
        sampling: how each robot's sensors were read, N entries, if the samples were resampled.
        units: the robots with calibrated deviations, ``x`` of shape (N, ``COUNT``), or None; the samples are raw
            readings in any case.
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
        """The robots with their deviations, or as designed if these are unknown."""
        return self.design if self.units is None else self.units

    @property
    def team(self) -> int:
        """Number of robots that carried the payload: more than ``robots`` if ``control`` lists forces of more."""
        forces = (self.control or {}).get("feed_forward_N")
        return max(self.robots, len(forces)) if isinstance(forces, list) else self.robots

    def to_json(self) -> str:
        """Convert the metadata to JSON text.

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
        # Apply the reader's rules: never write what cannot be read back.
        self.from_json(text, "recording metadata")
        return text

    @property
    def _version(self) -> int:
        if self.units is not None:
            return 5
        return 4 if self.trial == FREE else 3 if self.sampling else 2 if self.level != "joint" else 1

    @classmethod
    def from_json(cls, text: str | bytes, where: str = "metadata") -> RecordingMetadata:
        """Parse and check JSON metadata; ``where`` is its name in messages.

        Raises:
            InputError: not JSON, a key unknown, missing or repeated, or a value of the wrong type or range.
        """
        values = parse_json(text, where)
        # Check the version first: another version may have other keys.
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
    """Check that units have as many robots as a recording, and the same design; ``what`` is their name in messages.

    Raises:
        InputError: they do not.
    """
    if units.x.shape != (metadata.robots, COUNT):
        count = len(units.x) if units.x.ndim == 2 else 1
        raise InputError(f"{what}: of {count} robots; the recording is of {metadata.robots}")
    if units.design != metadata.design:
        raise InputError(f"{what}: of robots of another design than the recording's")


def _rules(values: dict[str, Any]) -> Rules:
    """Return the allowed values for metadata of their stated version."""
    version, trial, robots = (values.get(key) for key in ("version", "trial", "robots"))
    trials = TRIALS if (version or 0) >= 4 else TRIALS[:-1]
    newer = f" in version {version} (4 has free trials)" if trial == FREE and FREE not in trials else ""
    # The label is printed, so exclude control characters and lone surrogates.
    label = "text or null, all of it printable"
    if trial == FREE and isinstance(values.get("payload"), str) and values["payload"].isprintable():
        label = "null in a free trial, whose robots hold nothing"

    def is_label(x: Any) -> bool:
        return x is None or (trial != FREE and isinstance(x, str) and x.isprintable())

    def one_each(x: Any) -> bool:
        return isinstance(x, list) and len(x) == robots

    return {
        "robots": ("a whole number, at least 1", lambda x: type(x) is int and x >= 1),
        # Use a bound: isfinite overflows on integers beyond the range of a float.
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
