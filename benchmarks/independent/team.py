"""One trial: a payload that moves as prescribed, and what the robots under it must then read and give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.arm.delta import legs_of
from independent.arm.dynamics import arm_load
from independent.arm.gimbal import gimbal_angles, gimbal_moment
from independent.as_built import ROBOTS, AsBuilt
from independent.effects.effect import Effect, Scene
from independent.motion import Motion
from independent.numerics import Array, coulomb, derivative, second_derivative, settled
from independent.payload import Payload, needed_wrench
from independent.rotations import back_turned, from_rotvec, spin, turned
from independent.sharing import shared_forces, wanted_forces

AXES_HEIGHT_M = 0.46
"""Of the driven axes over the floor; nothing depends on it."""
PRESLIDING_RAD = 1e-5
_PLAY_N, _PLAY_N_PER_M = 0.05, 200.0
"""Force at which a loose grasp is nearly at the end of its gap, and how much more it takes in a wider one, which shifts
the balance itself: contacts are not infinitely stiff."""
_RECORDED = slice(150, -150)
_MOVING_KG = 2.0
"""Roughly what moves with a base or grasp that yields: how slowly it does."""


@dataclass(frozen=True, eq=False)
class Bases:
    """Where the robots stand.

    Attributes:
        R_W1: orientation of the payload at home, shape (3, 3).
        p_W1: its {1} there [m], shape (3,).
        R_Wb, p_Wb: level frames {b}, shapes (N, 3, 3) and (N, 3).
    """

    R_W1: Array
    p_W1: Array
    R_Wb: Array
    p_Wb: Array


@dataclass(frozen=True, eq=False)
class Truth:
    """What is there, before any sensor, on the fine grid.

    Attributes:
        scene: the payload's motion.
        phi, theta: angles [rad], shape (Q, N, 3).
        torque: of the springs and what is beside them, on the driven links [N m], shape (Q, N, 3).
        force: of the robots on the payload in W [N], shape (Q, N, 3).
        moment: of the gimbals on the payload in W [N m], shape (Q, N, 3).
        wrist: in W [m], shape (Q, N, 3).
        h: wrist in the arms' frames [m], shape (Q, N, 3).
        outside: force and moment about the centre of mass of everything else on the payload, W, shape (Q, 3) each.
    """

    scene: Scene
    phi: Array
    theta: Array
    torque: Array
    force: Array
    moment: Array
    wrist: Array
    h: Array
    outside: tuple[Array, Array]


def place_bases(
    rng: np.random.Generator, payload: Payload, design: OmnidDesign, first: Bases | None = None
) -> Bases:
    """Each robot under its grasp within millimetres, its gimbal near zero; the payload at home on their mean height.

    Args:
        rng: source of what is random.
        payload: what is held.
        design: the robots' numbers.
        first: an earlier trial, under whose payload robot 1 stood as it will now: what is tied to its base then pulls
            at any point of the payload as it did.
    """
    R_W1 = from_rotvec(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    offsets = turned(R_W1, payload.p_1i)
    height = AXES_HEIGHT_M + design.home_height_m - offsets[:, 2].mean()
    p_W1 = np.array([*rng.uniform(-1, 1, 2), height])
    grasps = p_W1 + offsets
    off, yaw = rng.normal(0.0, 0.003, (ROBOTS, 3)), rng.normal(0.0, 0.12, ROBOTS)
    p_Wb = np.column_stack([grasps[:, :2], np.full(ROBOTS, AXES_HEIGHT_M)]) + off
    R_Wb = R_W1 @ payload.R_1i @ from_rotvec(np.outer(yaw, [0.0, 0.0, 1.0]))
    if first is not None:
        R_Wb[0] = R_W1 @ first.R_W1.T @ first.R_Wb[0]
        p_Wb[0] = p_W1 + R_W1 @ first.R_W1.T @ (first.p_Wb[0] - first.p_W1)
    return Bases(R_W1, p_W1, R_Wb, p_Wb)


def scene_of(trial: int, motion: Motion, payload: Payload, bases: Bases, design: OmnidDesign) -> Scene:
    """The payload's motion; it turns about the middle of its grasps, so that no wrist goes farther than need be."""
    turn = from_rotvec(motion.turn)
    middle = turned(bases.R_W1, payload.p_1i.mean(axis=0))
    p_W1 = bases.p_W1 + motion.shift + middle - turned(turn, middle)
    R_W1 = turn @ bases.R_W1
    centre = p_W1 + turned(R_W1, payload.p_1c)
    omega, alpha = spin(R_W1)
    gravity = np.array([0.0, 0.0, -design.gravity_mps2])
    velocity, acceleration = derivative(centre), second_derivative(centre)
    return Scene(
        trial, motion.time, payload, R_W1, p_W1, velocity, acceleration, omega, alpha,
        bases.R_Wb, bases.p_Wb, gravity,
    )  # fmt: skip


def carry(
    rng: np.random.Generator,
    scene: Scene,
    design: OmnidDesign,
    robots: AsBuilt,
    effects: Sequence[Effect],
    *,
    squeezing: bool,
) -> Truth:
    """Angles, torques and forces of a trial.

    Args:
        rng: source of how the robots share the load.
        scene: the payload's motion.
        design: the robots' numbers.
        robots: how they are off.
        effects: what else is hidden.
        squeezing: whether the robots' internal forces also change while the payload rests.
    """
    grasp = np.stack([scene.place(p) for p in scene.payload.p_1i], axis=1)
    weight = -scene.payload.mass_kg * scene.gravity
    time = scene.time if squeezing else np.zeros_like(scene.time)
    wanted = wanted_forces(rng, time, weight, grasp - grasp[:1])
    outside = _outside(scene, effects)
    grasp_shift, base_shift = np.zeros_like(grasp), np.zeros_like(grasp)
    # What yields by micrometres moves the angles, and these the forces a little: converges at once.
    for _ in range(12):
        truth, floor = _balance(
            scene, design, robots, effects, wanted, outside, grasp + grasp_shift, base_shift
        )
        before = np.concatenate([grasp_shift, base_shift], axis=1)
        grasp_shift = settled(_grasp_shift(scene, robots, effects, truth.force))
        period = 2 * np.sqrt(robots["base_compliance"].max() * _MOVING_KG)
        base_shift = settled(-robots["base_compliance"] * floor * [1.0, 1.0, 0.0], max(0.008, period))
        after = np.concatenate([grasp_shift, base_shift], axis=1)
        # The first and last instants are not recorded, and derivatives there know no neighbours.
        if np.abs(after - before)[_RECORDED].max() < max(1e-9, 1e-6 * np.abs(after).max()):
            return truth
    raise ValueError(f"trial {scene.trial}: displacements under load do not converge")


def _outside(scene: Scene, effects: Sequence[Effect]) -> tuple[Array, Array]:
    force, moment = np.zeros_like(scene.p_W1), np.zeros_like(scene.p_W1)
    for effect in effects:
        if (wrench := effect.wrench(scene)) is not None:
            force, moment = force + wrench[0], moment + wrench[1]
    return force, moment


def _grasp_shift(scene: Scene, robots: AsBuilt, effects: Sequence[Effect], force: Array) -> Array:
    shift = np.empty_like(force)
    for i in range(ROBOTS):
        axes = scene.R_W1 @ scene.payload.R_1i[i]
        own = back_turned(axes, force[:, i])
        gap = float(robots["grasp_play"][i, 0])
        # With half a newton more on one side an arm needs a while to cross a gap, and longer to cross a wider one.
        crossing = settled(np.tanh(own / (_PLAY_N + _PLAY_N_PER_M * gap)), max(0.008, 0.7 * np.sqrt(gap)))
        local = robots["grasp_flex"][i] * own + gap * crossing
        for effect in effects:
            local = local + effect.grasp_shift(i, own)
        shift[:, i] = turned(axes, local)
    return shift


def _balance(
    scene: Scene,
    design: OmnidDesign,
    robots: AsBuilt,
    effects: Sequence[Effect],
    wanted: Array,
    outside: tuple[Array, Array],
    wrist: Array,
    base_shift: Array,
) -> tuple[Truth, Array]:
    """All balances at given displacements, and the floor's force on every arm in W, shape (Q, N, 3)."""
    R_Wa, h, theta = _arms(scene, robots, wrist, base_shift)
    resisting = coulomb(theta, robots["gimbal_coulomb"], PRESLIDING_RAD)
    resisting += robots["gimbal_viscous"] * derivative(theta)
    for effect in effects:
        if (extra := effect.gimbal_torque(theta)) is not None:
            resisting[:, extra[0], extra[1]] += extra[2]
    moment = np.stack(
        [turned(R_Wa[i], gimbal_moment(theta[:, i], resisting[:, i], design)) for i in range(ROBOTS)], axis=1
    )
    force, turning = needed_wrench(scene.payload, scene.R_W1, scene.omega, scene.acceleration, scene.gravity)
    centre = scene.place(scene.payload.p_1c)
    pushes = shared_forces(
        wrist - centre[:, None], wanted, force - outside[0], turning - outside[1] - moment.sum(axis=1)
    )
    phi, torque, floor = np.empty_like(h), np.empty_like(h), np.empty_like(h)
    for i in range(ROBOTS):
        legs = legs_of(design, robots["base_radius"][i], robots["proximal"][i], robots["rod"][i])
        felt = back_turned(R_Wa[i], scene.gravity - second_derivative(base_shift[:, i]))
        load = arm_load(h[:, i], legs, design, felt)
        phi[:, i] = load.phi
        torque[:, i] = load.spring_torque(back_turned(R_Wa[i], pushes[:, i]))
        floor[:, i] = turned(R_Wa[i], load.floor) + pushes[:, i]
    torque += coulomb(phi, robots["joint_coulomb"], PRESLIDING_RAD)
    torque += robots["joint_viscous"] * derivative(phi)
    for effect in effects:
        if (extra := effect.driven_torque(phi)) is not None:
            torque[:, extra[0], extra[1]] += extra[2]
    return Truth(scene, phi, theta, torque, pushes, moment, wrist, h, outside), floor


def _arms(scene: Scene, robots: AsBuilt, wrist: Array, base_shift: Array) -> tuple[Array, Array, Array]:
    """Orientation of the arms' frames in W, (N, 3, 3); wrists in them and gimbal angles, (Q, N, 3) each."""
    tilt = from_rotvec(np.column_stack([robots["base_tilt"], np.zeros(ROBOTS)]))
    R_Wa = scene.R_Wb @ tilt
    elapsed = np.maximum(scene.time, 0.0)[:, None, None]
    creep = np.einsum("nij,nj->ni", scene.R_Wb[:, :, :2], robots["base_creep"]) * elapsed
    base = scene.p_Wb + creep + base_shift
    h = back_turned(R_Wa, wrist - base)
    axes = scene.R_W1[:, None] @ scene.payload.R_1i
    theta = [gimbal_angles(R_Wa[i].T @ axes[:, i]) for i in range(ROBOTS)]
    return R_Wa, h, np.stack(theta, axis=1)
