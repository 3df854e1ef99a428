"""The axis as MJCF, with all of a plant that MJCF can express."""

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco

from mocobot_sim.emps.plant import Plant
from mocobot_sim.scene.models import models_dir

JOINT, DRIVE, CARRIAGE, MOTOR = "axis", "drive", "carriage", "motor_side"
LOAD_JOINT, PLAY = "load", "play"
ONE_WAY_MPS = 3e-4
"""Speed at which dry friction of one direction has grown to its full size, where it differs from the other's."""
LARGE_N = 1e9
CARRIAGE_SHARE = 0.5
"""Share of the moving mass behind a play: assumed."""
LACKS = frozenset({
    "stribeck_N", "stribeck_mps", "ripples", "delay_s", "velocity_lag_s", "voltage_pulses", "force_pulses", "pushes",
    "laws",
})  # fmt: skip
"""Numbers of a plant that MJCF has no words for; ``loop.py`` adds them."""


def axis_spec(plant: Plant) -> mujoco.MjSpec:
    """``models/emps/emps.xml`` with the plant's mass, friction, offset, play and loop gains in it.

    What acts in one direction only is an actuator whose force range ends at zero; its control is unused. The drive's
    control is the reference position [m], its force the voltage [V]; one step is one period of the loop.
    """
    spec = mujoco.MjSpec.from_file(str(models_dir() / "emps" / "emps.xml"))
    spec.option.timestep = plant.period_s
    joint = spec.joint(JOINT)
    spec.body(CARRIAGE).mass = plant.mass_kg
    drive = spec.actuator(DRIVE)
    gain, kp, kv = plant.gain_N_per_V, plant.kp_per_s, plant.kv_Vs_per_m
    drive.gear = [gain, 0, 0, 0, 0, 0]
    drive.gainprm = [kp * kv, *[0.0] * 9]
    drive.biasprm = [0.0, -kp * kv / gain, -kv / gain, *[0.0] * 7]
    drive.forcerange = [-plant.limit_V, plant.limit_V]
    if plant.play_m > 0:
        joint = _with_play(spec, plant)
    both = max(min(plant.coulomb_N), 0.0)
    joint.frictionloss = both
    slow = max(min(plant.viscous_Ns_per_m), 0.0)
    joint.damping = [slow, 0.0, 0.0] if hasattr(joint.damping, "__len__") else slow
    for sign, name, dry, wet in zip(
        (1.0, -1.0), ("forward", "backward"), plant.coulomb_N, plant.viscous_Ns_per_m, strict=True
    ):
        if wet != slow:
            _one_way(spec, joint.name, f"viscous_{name}", sign, wet - slow, LARGE_N)
        if dry != both:
            _one_way(spec, joint.name, f"coulomb_{name}", sign, (dry - both) / ONE_WAY_MPS, abs(dry - both))
    if plant.resisting_N:
        _general(spec, joint.name, "constant_force", [-plant.resisting_N, 0.0, 0.0], None)
    return spec


def _with_play(spec: mujoco.MjSpec, plant: Plant) -> mujoco.MjsJoint:
    """Split the mass: the motor keeps ``axis``, the carriage gets a joint of its own, a tendon holds them together."""
    frame, carriage = spec.body("frame"), spec.body(CARRIAGE)
    motor = frame.add_body(name=MOTOR, pos=[0.0, 0.0, 0.075])
    motor.mass = (1.0 - CARRIAGE_SHARE) * plant.mass_kg
    motor.inertia = [1.0, 1.0, 1.0]
    motor.explicitinertial = True
    old = spec.joint(JOINT)
    friction, impedance = list(old.solref_friction), list(old.solimp_friction)
    old.name = LOAD_JOINT
    carriage.mass = CARRIAGE_SHARE * plant.mass_kg
    axis = motor.add_joint(name=JOINT, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    axis.solref_friction, axis.solimp_friction = friction, impedance
    tendon = spec.add_tendon(name=PLAY, limited=True, range=[-0.5 * plant.play_m, 0.5 * plant.play_m])
    tendon.wrap_joint(JOINT, 1.0)
    tendon.wrap_joint(LOAD_JOINT, -1.0)
    tendon.solref_limit = [0.002, 1.0]
    tendon.solimp_limit = [0.99, 0.99, 1e-6, 0.5, 2.0]
    return old


def _one_way(spec: mujoco.MjSpec, joint: str, name: str, sign: float, damping: float, most: float) -> None:
    """A damper for one direction of motion, with at most so much force."""
    against = [-most, 0.0] if sign * damping > 0 else [0.0, most]
    _general(spec, joint, name, [0.0, 0.0, -damping], against)


def _general(
    spec: mujoco.MjSpec, joint: str, name: str, bias: list[float], force_range: list[float] | None
) -> None:
    actuator = spec.add_actuator(name=name, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
    # Not zero: MuJoCo takes an affine bias without stiffness or gain for a damping ratio, if it is positive.
    actuator.gainprm = [1e-9, *[0.0] * 9]
    actuator.biasprm = [*bias, *[0.0] * 7]
    if force_range is not None:
        actuator.forcelimited = True
        actuator.forcerange = force_range
