"""Values of a group's columns as physical parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from discrepancy.evidence.posterior import Group
from discrepancy.joints.causes import CAUSES, OTHERS
from discrepancy.joints.given import horizontal
from discrepancy.joints.mechanics.tree import Tree
from discrepancy.joints.problem import JointProblem
from discrepancy.joints.said import parameter_name
from estimator.arrays import Array

NAMES: Mapping[str, tuple[str, ...]] = {cause.name: tuple(cause.parameters) for cause in (*CAUSES, *OTHERS)}
ROBOTS = ("payload", "link_length", "link_com", "link_mass", "link_inertia", "gravity_direction", "push")
LEAST_KG = 1e-3
"""Mass of a payload below which it has no centre."""


def physical(
    problem: JointProblem, group: Group, x: Array, covariance: Array
) -> tuple[dict[str, float], dict[str, float]]:
    """Values and standard errors by name.

    Args:
        problem: of the group.
        group: a cause at a place, or one of its members at that.
        x, covariance: of these columns, shapes (k,) and (k, k).
    """
    names = NAMES[group.cause]
    if group.cause == "link_mass" and len(x) > 1:
        names = (*names, *NAMES["link_com"], "inertia_share")
    change = _change(problem, group)
    if change is not None:
        value = change(x)
        size = np.sqrt(np.diag(covariance))
        J = np.column_stack([
            (change(x + e) - change(x - e)) / (2.0 * step)
            for e, step in ((1e-4 * s * np.eye(len(x))[k], 1e-4 * s) for k, s in enumerate(size + 1e-12))
        ])  # fmt: skip
        x, covariance = value, J @ covariance @ J.T
    joints = problem.model.joints
    slide = (
        group.cause not in ROBOTS
        and group.place in joints
        and problem.model.slides[joints.index(group.place)]
    )
    names = tuple(parameter_name(n, slide=bool(slide)) for n in names)
    se = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return dict(zip(names, map(float, x), strict=True)), dict(zip(names, map(float, se), strict=True))


def _change(problem: JointProblem, group: Group) -> Callable[[Array], Array] | None:
    tree = Tree.of(problem.model.model)
    if group.cause == "link_mass":
        mass = float(tree.mass[problem.model.model.body(group.place).id])
        return lambda x: np.append(x[0] * mass, x[1:])
    if group.cause == "payload":
        return load_of
    if group.cause == "gravity_direction":
        along = axes_of_tilt(tree.gravity) @ horizontal(tree.gravity).T
        return lambda x: along @ x
    return None


def axes_of_tilt(gravity: Array) -> Array:
    """Two horizontal axes: the one nearest to x (to y where that is up), and up times it, shape (2, 3)."""
    up = -gravity / np.linalg.norm(gravity)
    axis = np.eye(3)[0] if abs(up[0]) < 0.9 else np.eye(3)[1]
    first = axis - up * (axis @ up)
    first /= np.linalg.norm(first)
    return np.asarray(np.stack([first, np.cross(up, first)]), dtype=float)


def load_of(moments: Array) -> Array:
    """Mass, centre, and inertia about it (xx, yy, zz, xy, xz, yz) from ten parameters about the link's frame."""
    m = moments[0] if abs(moments[0]) > LEAST_KG else LEAST_KG
    c = moments[1:4] / m
    about = c @ c * np.eye(3) - np.outer(c, c)
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    inertia = [moments[4 + k] - m * about[i, j] for k, (i, j) in enumerate(pairs)]
    return np.array([moments[0], *c, *inertia])


def absolute(problem: JointProblem, group: Group) -> dict[str, Any]:
    """Numbers inside a cause's columns, with those in physical units that simulations need."""
    shape: dict[str, Any] = dict(group.shape)
    if group.place not in problem.model.joints:
        return shape
    j = problem.model.joints.index(group.place)
    span, slide = problem.joints[j][0].span, bool(problem.model.slides[j])
    speed, length = ("m_per_s", "m") if slide else ("rad_per_s", "rad")
    if group.cause == "stribeck":
        shape[f"fade_{speed}"] = shape["share"] * span.speed
    elif group.cause == "sublinear_friction":
        shape[f"thins_{speed}"] = shape["share"] * span.speed
    elif group.cause == "warming":
        shape["over_s"] = shape["share"] * span.until_s
    elif group.cause == "spring":
        shape[f"middle_{length}"] = span.middle
    elif group.cause == "torque_scale":
        asked = np.concatenate([s.asked for s in problem.joints[j]])
        shape["typical_load_N" if slide else "typical_load_Nm"] = float(np.sqrt(np.mean(asked**2)))
    return shape
