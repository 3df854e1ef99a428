"""Strict reading of an extended model's numbers: every message names the key and what is allowed."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform, Rotation

from estimator.errors import InputError

Array = NDArray[np.float64]
POSE = ("position_m", "quaternion_wxyz")


def poses_to_list(poses: RigidTransform) -> list[dict[str, list[float]]]:
    """Poses as plain JSON values."""
    quats = poses.rotation.as_quat(scalar_first=True)
    return [
        dict(zip(POSE, (p.tolist(), q.tolist()), strict=True))
        for p, q in zip(poses.translation, quats, strict=True)
    ]


def parse_object(text: str, where: str) -> dict[str, Any]:
    """Parse JSON text that is an object, no key twice and no NaN or infinity.

    Raises:
        InputError: it is not.
    """
    try:
        values = json.loads(text, object_pairs_hook=_unique, parse_constant=_no_constant)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not valid JSON ({error})") from error
    if not isinstance(values, dict):
        raise InputError(f"{where}: must be a JSON object, not {values!r:.60}")
    return values


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names = [name for name, _ in pairs]
    if len(set(names)) != len(names):
        raise ValueError(f"key {max(names, key=names.count)!r} appears twice")
    return dict(pairs)


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")


@dataclass(frozen=True)
class Fields:
    """An object with exactly certain keys, read by type.

    Attributes:
        values: the object.
        keys: all its keys.
        where: how messages call it.
    """

    values: dict[str, Any]
    keys: Sequence[str]
    where: str

    def __post_init__(self) -> None:
        """Check the keys."""
        unknown = [key for key in self.values if key not in self.keys]
        missing = [key for key in self.keys if key not in self.values]
        if unknown or missing:
            problem = f"unknown key {unknown[0]!r}" if unknown else f"missing key {missing[0]!r}"
            raise InputError(f"{self.where}: {problem}; the keys are {', '.join(self.keys)}")

    def within(self, value: Any, keys: Sequence[str], name: str) -> Fields:
        """An object inside this one."""
        if not isinstance(value, dict):
            raise InputError(f"{self.where}: {name} is {value!r:.60}; it must be an object")
        return Fields(value, keys, f"{self.where}: {name}")

    def whole(self, key: str) -> int:
        """A whole number of at least 1."""
        value = self.values[key]
        if type(value) is not int or value < 1:
            raise InputError(f"{self.where}: {key} is {value!r:.60}; it must be a whole number of at least 1")
        return value

    def object(self, key: str) -> dict[str, Any]:
        """An object."""
        if not isinstance(self.values[key], dict):
            raise InputError(f"{self.where}: {key} is {self.values[key]!r:.60}; it must be an object")
        return self.values[key]

    def list(self, key: str, length: int | None = None) -> list[Any]:
        """A list, of a certain length if one is given."""
        value = self.values[key]
        if not isinstance(value, list) or length not in (None, len(value)):
            many = "" if length is None else f" of {length} entries"
            raise InputError(f"{self.where}: {key} is {value!r:.60}; it must be a list{many}")
        return value

    def array(self, key: str, shape: tuple[int, ...]) -> Array:
        """Finite numbers in nested lists of a shape."""
        value = self.values[key]
        if not _is_array(value, shape):
            size = " x ".join(map(str, shape))
            raise InputError(f"{self.where}: {key} is {value!r:.60}; it must be {size} finite numbers")
        return np.array(value, dtype=float)

    def poses(self, key: str, count: int) -> RigidTransform:
        """Poses as ``poses_to_list`` writes them."""
        positions, quats = [], []
        for i, entry in enumerate(self.list(key, count), start=1):
            pose = self.within(entry, POSE, f"{key}[{i}]")
            positions.append(pose.array("position_m", (3,)))
            quats.append(pose.array("quaternion_wxyz", (4,)))
            if abs(np.linalg.norm(quats[-1]) - 1.0) > 1e-6:
                raise InputError(f"{pose.where}: quaternion_wxyz has not length 1; it must have")
        return RigidTransform.from_components(
            np.array(positions), Rotation.from_quat(quats, scalar_first=True)
        )


def _is_array(value: Any, shape: tuple[int, ...]) -> bool:
    if not shape:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return number and abs(value) < 1e300 and math.isfinite(value)
    return isinstance(value, list) and len(value) == shape[0] and all(_is_array(v, shape[1:]) for v in value)
