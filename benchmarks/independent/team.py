"""Motion, forces and loads of a team whose payload moves as prescribed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from estimator.arm.design import OmnidDesign
from independent.arm import arm_load, gimbal_angles, gimbal_moment, legs_of
from independent.bodies import ROBOTS, AsBuilt, Payload, needed_wrench
from independent.effects import Effect, Scene
from independent.numerics import (
    FINE_HZ,
    Array,
    back_turned,
    coulomb,
    derivative,
    from_rotvec,
    second_derivative,
    settled,
    smooth_step,
    spin,
    turned,
)

PAD_S = 0.5
"""Rest before and after what is recorded, for delays and derivatives [s]."""
REST_S = 2.0
_RAMP_S = 3.0
_HOLD_S, _MOVE_S = 3.0, 1.3


@dataclass(frozen=True)
class Motion:
    """Displacement of the payload from home over time.

    Attributes:
        kind: of trial, as a recording calls it.
        time: on the fine grid, 0 where the recording starts [s], shape (Q,).
        shift: of the point about which it turns, W axes [m], shape (Q, 3).
        turn: rotation vector from home, W axes [rad], shape (Q, 3).
    """

    kind: str
    time: Array
    shift: Array
    turn: Array

    def scaled(self, factor: float) -> Motion:
        """The same motion, smaller."""
        return Motion(self.kind, self.time, self.shift * factor, self.turn * factor)

    @property
    def duration_s(self) -> float:
        """Length of what is recorded [s]."""
        return float(self.time[-1]) - PAD_S


def random_motion(rng: np.random.Generator, duration_s: float = 35.0) -> Motion:
    """Sums of sines of 0.1 to 0.6 Hz at no common period, at rest for 2 s at either end."""
    time = _grid(duration_s)
    waves = np.zeros((len(time), 6))
    for axis in range(6):
        rate = rng.uniform(0.1, 0.6, 9)
        size = rng.uniform(0.4, 1.0, 9) / np.sqrt(rate)
        waves[:, axis] = np.sin(2 * np.pi * np.outer(time, rate) + rng.uniform(0, 2 * np.pi, 9)) @ size
    return _windowed("random", rng, time, waves)


def periodic_motion(rng: np.random.Generator, duration_s: float = 30.0) -> Motion:
    """Five harmonics of 0.1 Hz on every axis, at rest for 2 s at either end."""
    time = _grid(duration_s)
    rate = 0.1 * np.arange(1, 6)
    waves = np.zeros((len(time), 6))
    for axis in range(6):
        size = rng.uniform(0.2, 1.0, 5) / np.sqrt(rate)
        waves[:, axis] = np.sin(2 * np.pi * np.outer(time, rate) + rng.uniform(0, 2 * np.pi, 5)) @ size
    return _windowed("periodic", rng, time, waves)


def static_motion(rng: np.random.Generator, poses: int = 10) -> Motion:
    """Poses that are held for 3 s each, with smooth moves between them; home comes first."""
    time = _grid(poses * _HOLD_S + (poses - 1) * _MOVE_S)
    spread = np.array([0.045] * 3 + [0.12] * 3)
    goals = rng.uniform(-1, 1, (poses, 6)) * spread
    goals[0] = 0.0
    path: Array = np.zeros((len(time), 6))
    for k in range(1, poses):
        start = k * _HOLD_S + (k - 1) * _MOVE_S
        path = path + smooth_step((time - start) / _MOVE_S)[:, None] * (goals[k] - goals[k - 1])
    return Motion("static", time, path[:, :3], path[:, 3:])


MOTIONS: Mapping[str, Callable[[np.random.Generator], Motion]] = {
    "random": random_motion, "periodic": periodic_motion, "static": static_motion,
}  # fmt: skip
"""By kind of trial."""


def _grid(duration_s: float) -> Array:
    pad = round(PAD_S * FINE_HZ)
    return np.arange(-pad, round(duration_s * FINE_HZ) + pad + 1) / FINE_HZ


def _windowed(kind: str, rng: np.random.Generator, time: Array, waves: Array) -> Motion:
    end = time[-1] - PAD_S
    window = smooth_step((time - REST_S) / _RAMP_S) * smooth_step((end - REST_S - time) / _RAMP_S)
    path = waves * window[:, None]
    largest = np.concatenate([rng.uniform(0.040, 0.050, 3), rng.uniform(0.105, 0.140, 3)])
    path = np.asarray(path * (largest / np.abs(path).max(axis=0)), dtype=float)
    return Motion(kind, time, path[:, :3], path[:, 3:])


STIFFNESS_N_PER_M = 120.0
"""Stiffness of the springs that robots seem to hold their wrists with; what it does beyond the balance is internal."""


def shared_forces(arm: Array, wanted: Array, force: Array, moment: Array) -> Array:
    """Forces on the payload that balance it and are as near to wanted ones as they can be.

    Args:
        arm: from the centre of mass to the wrists, W axes [m], shape (Q, N, 3).
        wanted: forces that a team might want, W axes [N], shape (Q, N, 3).
        force: that the forces have to sum to [N], shape (Q, 3).
        moment: that they have to give about the centre of mass [N m], shape (Q, 3).

    Returns:
        Forces on the payload in W [N], shape (Q, N, 3).
    """
    samples, robots = arm.shape[:2]
    G = np.zeros((samples, 6, robots, 3))
    G[:, :3] = np.eye(3)[None, :, None, :]
    x, y, z = arm[..., 0], arm[..., 1], arm[..., 2]
    for row, column, value in ((0, 1, -z), (0, 2, y), (1, 0, z), (1, 2, -x), (2, 0, -y), (2, 1, x)):
        G[:, 3 + row, :, column] = value
    G = G.reshape(samples, 6, 3 * robots)
    missing = np.concatenate([force, moment], axis=1) - (G @ wanted.reshape(samples, -1, 1))[..., 0]
    back = np.swapaxes(G, 1, 2)
    extra = back @ np.linalg.solve(G @ back, missing[..., None])
    return wanted + extra.reshape(samples, robots, 3)


def wanted_forces(rng: np.random.Generator, time: Array, weight: Array, shift: Array) -> Array:
    """Equal shares of the weight, slow squeezes of a few newtons, and springs that pull wrists home.

    Args:
        rng: source of the squeezes.
        time: fine grid [s], shape (Q,).
        weight: force that holds the payload [N], shape (3,).
        shift: of the wrists from home in W [m], shape (Q, N, 3).
    """
    robots = shift.shape[1]
    rate, phase = rng.uniform(0.03, 0.4, (4, robots, 3)), rng.uniform(0, 2 * np.pi, (4, robots, 3))
    size = rng.normal(0.0, 1.2, (4, robots, 3))
    waves = (size * np.sin(2 * np.pi * time[:, None, None, None] * rate + phase)).sum(axis=1)
    constant = rng.normal(0.0, 2.0, (robots, 3))
    return weight / robots + constant + waves - STIFFNESS_N_PER_M * shift


AXES_HEIGHT_M = 0.46
"""Height of the driven axes over the floor; nothing depends on it."""
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
