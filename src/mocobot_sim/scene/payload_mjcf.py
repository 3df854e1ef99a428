"""The MJCF of a payload that is known by its numbers only, such as an estimated one."""

import numpy as np
from scipy.spatial.transform import RigidTransform

from estimator.arrays import Array
from estimator.errors import InputError
from mocobot_sim.scene.pymjcf import mjcf


def payload_mjcf(mass_kg: float, p_1c: Array, inertia_1: Array, X_1i: RigidTransform) -> "mjcf.RootElement":
    """Make a payload for ``build_team``.

    Args:
        mass_kg: mass, greater than 0.
        p_1c: centre of mass in {1} [m], shape (3,).
        inertia_1: inertia about the centre of mass in the axes of {1} [kg m^2], shape (3, 3), symmetric.
        X_1i: grasp frames in {1}, N transforms; the first is taken as the identity.

    Returns:
        A body ``payload`` at {1} with sites ``grasp1`` .. ``graspN`` and ``com``, and thin bars to look at.

    Raises:
        InputError: a number is not finite, or mass and inertia are those of no rigid body.
    """
    p_1c, inertia_1 = np.asarray(p_1c, dtype=float), np.asarray(inertia_1, dtype=float)
    if not 0 < mass_kg < np.inf:
        raise InputError(f"payload mass is {mass_kg:g} kg; it must be finite and greater than 0")
    if p_1c.shape != (3,) or not np.isfinite(p_1c).all():
        raise InputError(f"payload centre of mass is {p_1c.tolist()}; it must be three finite numbers")
    _check_inertia(inertia_1)
    if not np.isfinite(X_1i.as_matrix()).all():
        raise InputError("a grasp frame is not finite; every number of it must be")

    root = mjcf.RootElement(model="payload")
    root.compiler.angle = "radian"
    body = root.worldbody.add("body", name="payload")
    xx, yy, zz, xy, xz, yz = (inertia_1[at] for at in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
    body.add("inertial", pos=p_1c, mass=mass_kg, fullinertia=[xx, yy, zz, xy, xz, yz])
    look = {"group": 2, "contype": 0, "conaffinity": 0, "mass": 0.0, "rgba": [0.55, 0.60, 0.70, 1.0]}
    body.add("geom", name="com", type="sphere", pos=p_1c, size=[0.02], **look)
    body.add("site", name="com", pos=p_1c, group=4, size=[0.006])
    for i, X in enumerate(X_1i, start=1):
        at = np.zeros(3) if i == 1 else X.translation
        quat = [1.0, 0.0, 0.0, 0.0] if i == 1 else X.rotation.as_quat(scalar_first=True)
        body.add("site", name=f"grasp{i}", pos=at, quat=quat, group=4, size=[0.006])
        if np.linalg.norm(at - p_1c) > 1e-3:
            body.add("geom", name=f"bar{i}", type="capsule", fromto=[*p_1c, *at], size=[0.01], **look)
    return root


def nearest_inertia(inertia: Array, least_ratio: float) -> Array:
    """The nearest inertia that a rigid body can have: principal moments positive, none above the others' sum.

    Args:
        inertia: symmetric, shape (3, 3) [kg m^2].
        least_ratio: smallest moment over the largest.
    """
    moments, axes = np.linalg.eigh(inertia)
    moments = np.maximum(moments, least_ratio * max(moments[-1], 1e-9))
    excess = moments[2] - moments[0] - moments[1]
    if excess > 0:  # moved to the sum of the others in equal parts
        moments = moments + np.array([1.0, 1.0, -1.0]) * excess / 3.0 * 1.001
    return (axes * moments) @ axes.T


def _check_inertia(inertia: Array) -> None:
    if inertia.shape != (3, 3) or not np.isfinite(inertia).all():
        raise InputError("payload inertia is not 3 x 3 finite numbers; it must be")
    if np.abs(inertia - inertia.T).max() > 1e-9 * np.abs(inertia).max():
        raise InputError("payload inertia is not symmetric; it must be")
    moments = np.linalg.eigvalsh(inertia)
    if not moments[0] > 0 or moments[2] > moments[0] + moments[1]:
        text = ", ".join(f"{moment:.4g}" for moment in moments)
        raise InputError(
            f"payload inertia has principal moments ({text}) kg m^2; all must be greater than 0 and the largest "
            "at most the sum of the others"
        )
