"""The TX40 beside ``mujoco.sysid``, which is told what to fit: torques of the last third of the same log.

    pip install 'mujoco[sysid]'
    python benchmarks/tx40_sysid.py

``mujoco.sysid`` fits the MJCF by simulation: a servo in the model follows the measured motion of the first two thirds,
and the torques that it gives are compared with those of the log. Its lists hold what the diagnosis names and MJCF can
say: rotor, dry and viscous friction of every joint, the coupled drive of joints 5 and 6 as a fixed tendon; then masses
and centres of all links besides. Judged as ``tx40.py`` judges the others.
"""

from __future__ import annotations

import time
from dataclasses import replace

import mujoco
import numpy as np
import tyro
from mujoco import sysid

from discrepancy.joints.model import SerialModel
from discrepancy.joints.reading import read_spec
from discrepancy.joints.signals import Signals
from estimator.filtering import differentiate, low_pass
from mocobot_logs.joints.joint_log import JointLog
from mocobot_sim.serial.mjcf import SOLIMP, SOLREF
from tx40 import TOP, pair, parts, read, shares, shown

RATE_HZ, SERVO_HZ, SMOOTH_HZ = 2500.0, 40.0, 60.0
"""Rates of the simulation, its servo, and the low-pass of the log. An explicit integrator is stable here; an implicit
one applies the servo's damping at the step's end, so that its torque is told as if rotors were larger by damping times
step (half of ``INERTIA`` at 1 kHz)."""
INERTIA = np.array([1.5, 1.5, 0.6, 0.15, 0.08, 0.03])
"""As the joints feel it, about: for the servo's gains [kg m^2]."""
AXES = "xyz"
LEAST = 0.05
"""Lower bounds over start values: at 0 its differences are taken over steps too small to see, and it stays there."""


def servoed() -> mujoco.MjSpec:
    """The model with a servo at every joint, its torque as a sensor, and the tendon of the coupled drive."""
    spec = read_spec(TOP / "models" / "tx40" / "tx40.xml").spec
    spec.option.timestep, spec.option.integrator = 1.0 / RATE_HZ, mujoco.mjtIntegrator.mjINT_EULER
    stiffness = (2.0 * np.pi * SERVO_HZ) ** 2 * INERTIA
    damping = 2.0 * 2.0 * np.pi * SERVO_HZ * INERTIA
    for own in [*spec.actuators, *spec.sensors]:
        spec.delete(own)
    names = [joint.name for joint in spec.joints]
    for joint in spec.joints:
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for kind, gains in (("position", stiffness), ("velocity", damping)):
        for j, name in enumerate(names):
            actuator = spec.add_actuator(name=f"{kind}_{name}", target=name)
            actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
            actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            actuator.gainprm[0] = gains[j]
            actuator.biasprm[1 if kind == "position" else 2] = -gains[j]
    for name in names:
        sensor = spec.add_sensor(name=f"torque_{name}", objname=name)
        sensor.type = mujoco.mjtSensor.mjSENS_JOINTACTFRC
        sensor.objtype = mujoco.mjtObj.mjOBJ_JOINT
    tendon = spec.add_tendon(name="coupled")
    tendon.wrap_joint(names[5], 1.0)
    tendon.wrap_joint(names[4], 1.0)
    for rubbing in (*spec.joints, tendon):  # with MuJoCo's defaults dry friction grows with the speed
        rubbing.solref_friction, rubbing.solimp_friction = list(SOLREF), list(SOLIMP)
    return spec


def parameters(*, masses: bool) -> sysid.ParameterDict:
    """Start values and bounds, which the user has to give."""
    out = sysid.ParameterDict()
    for j in range(6):
        for name, start, most in (("armature", 0.05, 2.0), ("viscous", 0.5, 20.0), ("coulomb", 1.0, 20.0)):
            out[f"{name}_{j}"] = sysid.Parameter(f"{name}_{j}", start, LEAST * start, most)
    for name, start, most in (
        ("coupled_armature", 0.02, 1.0),
        ("coupled_viscous", 0.3, 10.0),
        ("coupled_coulomb", 0.5, 10.0),
    ):
        out[name] = sysid.Parameter(name, start, LEAST * start, most)
    for body in servoed().bodies[2:] if masses else ():
        out[f"mass_{body.name}"] = sysid.Parameter(
            f"mass_{body.name}", body.mass, 0.5 * body.mass, 2.0 * body.mass
        )
        for k, axis in enumerate(AXES):
            at = float(body.ipos[k])
            name = f"{axis}_{body.name}"
            out[name] = sysid.Parameter(name, at, at - 0.05, at + 0.05)
    return out


def edited(params: sysid.ParameterDict, base: mujoco.MjSpec) -> mujoco.MjModel:
    """The model with the parameters in it."""
    spec = base.copy()
    value = dict(zip(params.parameters, params.as_vector(), strict=True))
    put(spec, value)
    (tendon,) = spec.tendons
    tendon.armature, tendon.frictionloss = value["coupled_armature"], value["coupled_coulomb"]
    tendon.damping = [value["coupled_viscous"], 0.0, 0.0]
    return spec.compile()


def put(spec: mujoco.MjSpec, value: dict[str, float]) -> None:
    """Values of joints and links into a model."""
    for j, joint in enumerate(spec.joints):
        joint.armature, joint.frictionloss = value[f"armature_{j}"], value[f"coulomb_{j}"]
        joint.damping = [value[f"viscous_{j}"], 0.0, 0.0]
    for body in spec.bodies[2:]:
        if f"mass_{body.name}" in value:
            body.mass = value[f"mass_{body.name}"]
            body.ipos = [value[f"{axis}_{body.name}"] for axis in AXES]


def fitted(log: JointLog, *, masses: bool) -> tuple[dict[str, float], float, int]:
    """Values fitted to the first two thirds, seconds of CPU, and the number of simulations."""
    assert log.torque is not None
    spec, calls = servoed(), 0

    def build(params: sysid.ParameterDict, base: mujoco.MjSpec) -> mujoco.MjModel:
        nonlocal calls
        calls += 1
        return edited(params, base)

    params = parameters(masses=masses)
    q = low_pass(log.q, log.rate_hz, SMOOTH_HZ)
    v = differentiate(q, log.rate_hz)
    torque = low_pass(log.torque, log.rate_hz, SMOOTH_HZ)
    step = round(log.rate_hz / RATE_HZ)
    here = slice(0, round(2.0 / 3.0 * len(q)), step)
    clock = log.time[here] - log.time[0]
    model = edited(params, spec)
    scale = np.sqrt(np.mean(torque**2, axis=0))
    sequences = sysid.ModelSequences(
        "tx40", spec, ["log"], [sysid.create_initial_state(model, q[0], v[0])],
        [sysid.TimeSeries.from_control_names(clock, np.column_stack([q[here], v[here]]), model)],
        [sysid.TimeSeries.from_names(clock, torque[here], model)],
    )  # fmt: skip
    residual = sysid.build_residual_fn(
        models_sequences=[sequences],
        build_model=build,
        n_threads=1,
        sensor_weights={f"torque_joint_{j + 1}": 1.0 / scale[j] for j in range(6)},
    )
    start = time.process_time()
    found, _ = sysid.optimize(params, residual, optimizer="scipy", verbose=False, x_scale="jac", max_iters=30)
    return (
        dict(zip(found.parameters, map(float, found.as_vector()), strict=True)),
        time.process_time() - start,
        calls,
    )


def left(model: SerialModel, log: JointLog, value: dict[str, float]) -> tuple[np.ndarray, Signals]:
    """What a fitted model leaves of the last third, by inverse dynamics as those of the diagnosis, and that third."""
    spec = read_spec(TOP / "models" / "tx40" / "tx40.xml").spec
    put(spec, value)
    _, s = parts(replace(model, model=spec.compile()), log)
    joints = ([value[f"{name}_{j}"] for j in range(6)] for name in ("coulomb", "viscous"))
    coulomb, viscous = map(np.array, joints)
    rubs = coulomb * np.clip(s.dq / s.slow, -1.0, 1.0) + viscous * s.dq
    numbers = np.array([value[f"coupled_{name}"] for name in ("coulomb", "viscous", "armature")])
    return s.torque - s.inverse - rubs - pair(s, 5) @ numbers, s


def main() -> None:
    """Print errors per joint, and times."""
    model, log = read()
    print("Torque left unpredicted in the last third, rms over that of the torque [%]")
    for masses in (False, True):
        value, spent, calls = fitted(log, masses=masses)
        named = f"mujoco.sysid, {len(value)} numbers"
        share = shares(*left(model, log, value))
        print(f"  {named:<44}{shown(share)}  ({spent:.1f} s, {calls} simulations)")
        print("    " + ", ".join(f"{name} {x:.3g}" for name, x in value.items()))


if __name__ == "__main__":
    tyro.cli(main, description=__doc__)
