"""Recordings with one mistake in their wiring, put in column by column."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from estimator.recording.model import Recording

Edit = Callable[[np.ndarray, np.ndarray, np.ndarray], None]
"""Changes phi, theta and tau, each (Q, N, 3), in place."""


@dataclass(frozen=True)
class Miswired:
    """A mistake and how inspection must name it.

    Attributes:
        name: for the test's id.
        edit: puts the mistake in.
        kind: kind of the mistake found.
        robots: robots named, from 1.
        channels: channels named, at joint level.
        words: part of the sentence.
    """

    name: str
    edit: Edit
    kind: str
    robots: tuple[int, ...]
    channels: tuple[str, ...]
    words: str


def miswire(recording: Recording, edit: Edit) -> Recording:
    """A copy with the mistake."""
    phi, theta, tau = recording.phi.copy(), recording.theta.copy(), recording.tau.copy()
    edit(phi, theta, tau)
    return dataclasses.replace(recording, phi=phi, theta=theta, tau=tau)


def _exchange(array: np.ndarray, robot: int | slice, i: int, j: int) -> None:
    array[:, robot, [i, j]] = array[:, robot, [j, i]]


def _swap(array: np.ndarray, i: int, j: int) -> None:
    array[:, [i, j]] = array[:, [j, i]]


def _turn(array: np.ndarray, robot: int | slice, *channels: int) -> None:
    for channel in channels:
        array[:, robot, channel] *= -1


def _scale(array: np.ndarray, factor: float, robot: int | slice = slice(None)) -> None:
    array[:, robot] *= factor


def _columns_of_each_other(a: np.ndarray, b: np.ndarray, robot: int) -> None:
    a[:, robot], b[:, robot] = b[:, robot].copy(), a[:, robot].copy()


def _roll(array: np.ndarray, robot: int) -> None:
    array[:, robot] = np.roll(array[:, robot], 1, axis=-1)


def _shift(array: np.ndarray, robot: int | slice, channel: int, by: float) -> None:
    array[:, robot, channel] += by


PHI = ("phi1", "phi2", "phi3")
THETA = ("theta_z", "theta_y", "theta_x")
TAU = ("tau1", "tau2", "tau3")
ALL = (1, 2, 3)
EVERY = slice(None)
DEGREES = 180 / np.pi

MISTAKES = [
    Miswired("theta in degrees", lambda p, t, f: _scale(t, DEGREES), "wrong_unit", ALL, THETA, "in degrees"),
    Miswired("phi in degrees", lambda p, t, f: _scale(p, DEGREES), "wrong_unit", ALL, PHI, "in degrees"),
    Miswired("theta of one in degrees", lambda p, t, f: _scale(t, DEGREES, 1), "wrong_unit", (2,), THETA, "in degrees"),
    Miswired("theta scaled twice", lambda p, t, f: _scale(t, 1 / DEGREES), "wrong_unit", ALL, THETA, "was in radians"),
    Miswired("tau in mN m", lambda p, t, f: _scale(f, 1e3), "wrong_unit", ALL, TAU, "in mN m, not N m"),
    Miswired("tau scaled twice", lambda p, t, f: _scale(f, 1e-3), "wrong_unit", ALL, TAU, "was in N m"),
    Miswired("phi swapped", lambda p, t, f: _swap(p, 0, 1), "swapped_robots", (1, 2), PHI, "phi columns are exch"),
    Miswired("theta swapped", lambda p, t, f: _swap(t, 0, 2), "swapped_robots", (1, 3), THETA, "theta columns are"),
    Miswired("tau swapped", lambda p, t, f: _swap(f, 1, 2), "swapped_robots", (2, 3), TAU, "tau columns are exch"),
    Miswired(
        "gimbal order of one", lambda p, t, f: _exchange(t, 1, 0, 2), "gimbal_axes", (2,), ("theta_x", "theta_z"),
        "theta_z and theta_x are exchanged",
    ),
    Miswired(
        "gimbal order", lambda p, t, f: _exchange(t, EVERY, 0, 2), "gimbal_axes", ALL, ("theta_x", "theta_z"),
        "theta_z and theta_x are exchanged",
    ),
    Miswired("gimbal sign", lambda p, t, f: _turn(t, 2, 0), "gimbal_axes", (3,), ("theta_z",), "has the wrong sign"),
    Miswired("all gimbal signs", lambda p, t, f: _turn(t, EVERY, 0, 1, 2), "gimbal_axes", ALL, THETA, "wrong sign"),
    Miswired("torque sign", lambda p, t, f: _turn(f, EVERY, 0, 1, 2), "torque_sign", ALL, TAU, "tau has the wrong"),
    Miswired("torque sign of one", lambda p, t, f: _turn(f, 1, 0, 1, 2), "torque_sign", (2,), TAU, "has the wrong"),
    Miswired("one torque's sign", lambda p, t, f: _turn(f, 2, 0), "torque_sign", (3,), ("tau1",), "has the wrong sign"),
    Miswired("torque order", lambda p, t, f: _roll(f, 0), "joint_order", (1,), TAU, "column tau2 holds tau1"),
    Miswired(
        "joint order", lambda p, t, f: (_exchange(p, 0, 0, 1), _exchange(f, 0, 0, 1)), "joint_order", (1,),
        ("phi2", "phi1", "tau2", "tau1"), "phi1 and phi2 are exchanged and tau1 and tau2 are exchanged",
    ),
    Miswired("joint sign", lambda p, t, f: _turn(p, 2, 1), "joint_sign", (3,), ("phi2",), "phi2 has the wrong sign"),
    Miswired(
        "joints turn the other way", lambda p, t, f: (_turn(p, EVERY, 0, 1, 2), _turn(f, EVERY, 0, 1, 2)),
        "joint_sign", ALL, PHI + TAU, "phi has the wrong sign and tau has the wrong sign",
    ),
    Miswired("joint zero", lambda p, t, f: _shift(p, 1, 2, 0.35), "wrong_zero", (2,), ("phi3",), "phi3 reads 20"),
    Miswired("gimbal zero", lambda p, t, f: _shift(t, 0, 0, -0.3), "wrong_zero", (1,), ("theta_z",), "reads 17"),
    Miswired(
        "offset of the wrong sign", lambda p, t, f: _shift(p, EVERY, 1, np.deg2rad(20.0)), "wrong_zero", ALL, ("phi2",),
        "phi2 reads 20.0 deg too much (the map lacks an offset, or has one of 10.0 deg with the wrong sign)",
    ),
    Miswired(
        "phi and theta exchanged", lambda p, t, f: _columns_of_each_other(p, t, 1), "exchanged_groups", (2,),
        PHI + THETA, "the columns of phi and theta are exchanged",
    ),
]  # fmt: skip
