"""Recordings: joint angles and spring torques of one trial, with the columns of docs/recording.md."""

from dataclasses import dataclass

import numpy as np

from estimator.arm.delta import wrist_of
from estimator.arm.unit import Arms, arm_of, true_joints
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.recording.metadata import Level, RecordingMetadata

# Column suffixes in array order: one (Q, N, 3) array per field.
_THETA, _REF = ("theta_z", "theta_y", "theta_x"), ("ref_x", "ref_y", "ref_z")
_BASE = ("base_x", "base_y", "base_yaw")
CHANNELS: dict[Level, dict[str, tuple[str, ...]]] = {
    "joint": {
        "phi": ("phi1", "phi2", "phi3"),
        "theta": _THETA,
        "tau": ("tau1", "tau2", "tau3"),
        "ref": _REF,
        "base": _BASE,
    },
    "wrist": {
        "h": ("h_x", "h_y", "h_z"),
        "theta": _THETA,
        "force": ("force_x", "force_y", "force_z"),
        "ref": _REF,
        "base": _BASE,
    },
}
OPTIONAL = ("ref", "base")
"""Fields that a recording has for all robots or for none."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Samples of one trial with N robots, all taken at the same instants.

    Samples are raw sensor readings. ``arm`` and ``joints`` apply the robots' deviations if the metadata contain them.

    Attributes:
        time: sample times [s], shape (Q,).
        phi: driven angles [rad], 0 horizontal outward, positive raises the knee, shape (Q, N, 3).
        theta: gimbal angles in the order (theta_z, theta_y, theta_x) [rad], shape (Q, N, 3).
        tau: spring torques on the proximal links, positive raising them [N m], shape (Q, N, 3).
        ref: commanded wrist positions in each robot's {b} [m], shape (Q, N, 3), or None.
        metadata: metadata of the recording.
        name: name in messages, such as the file's name.
        base: measured planar pose (x, y [m], yaw [rad]) of each robot's {b} since the start, in its {b} at the start,
            by wheel odometry, shape (Q, N, 3), or None for bases that stand.

    Raises:
        InputError: the arrays' shapes do not agree with each other or with ``metadata.robots``.
    """

    time: Array
    phi: Array
    theta: Array
    tau: Array
    ref: Array | None
    metadata: RecordingMetadata
    name: str = "recording"
    base: Array | None = None

    def __post_init__(self) -> None:
        """Convert the arrays to float64 and check their shapes."""
        shape = (np.size(self.time), self.metadata.robots, 3)
        for field in ("time", *CHANNELS["joint"]):
            value = getattr(self, field)
            if value is None and field in OPTIONAL:
                continue
            array = np.asarray(value, dtype=float)
            expected = shape[:1] if field == "time" else shape
            if array.shape != expected:
                raise InputError(f"{self.name}: {field} has shape {array.shape}; it must be {expected}")
            object.__setattr__(self, field, array)

    def arm(self, robot: int) -> Arms:
        """Return the arm of one robot (from 0), with its deviations if known."""
        return arm_of(self.metadata.arms, robot)

    def joints(self, robot: int) -> tuple[Array, Array, Array]:
        """Return true phi [rad], theta [rad] and tau [N m] of one robot (from 0), shape (Q, 3) each."""
        return true_joints(self.arm(robot), self.phi[:, robot], self.theta[:, robot], self.tau[:, robot])

    def columns(self) -> dict[str, Array]:
        """Return driven angles, gimbal angles, torques and commands by column name, each of shape (Q,)."""
        return self._named("joint", {"phi": self.phi, "tau": self.tau})

    def file_columns(self) -> dict[str, Array]:
        """Return every column of the file by name, in file order, each of shape (Q,).

        Wrist positions and forces are computed with the design, as a robot's own controller does. ``units`` apply to
        both levels in the same way.

        Raises:
            InputError: the level is "wrist" and some driven angles have no wrist position (see ``wrist_of``).
        """
        if self.metadata.level == "joint":
            return self.columns()
        h, force = np.empty_like(self.phi), np.empty_like(self.tau)
        for robot in range(self.metadata.robots):
            try:
                converted = wrist_of(self.phi[:, robot], self.tau[:, robot], self.metadata.design)
            except InputError as error:
                raise InputError(f"{self.name}: omnid{robot + 1}: {error}") from error
            h[:, robot], force[:, robot] = converted
        return self._named("wrist", {"h": h, "force": force})

    def _named(self, level: Level, fields: dict[str, Array | None]) -> dict[str, Array]:
        columns = {"time": self.time}
        fields = fields | {"theta": self.theta, "ref": self.ref, "base": self.base}
        for robot in range(self.metadata.robots):
            for field, suffixes in CHANNELS[level].items():
                if (array := fields[field]) is not None:
                    columns |= {f"omnid{robot + 1}.{s}": array[:, robot, k] for k, s in enumerate(suffixes)}
        return columns
