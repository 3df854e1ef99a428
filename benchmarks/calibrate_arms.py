"""Arms whose every number is wrong: what `mocobot calibrate --model` finds, against the truth.

    python benchmarks/calibrate_arms.py --arms 20 --first SEED

The owner's model is the Panda of ``models`` without friction and rotors. The simulated arm has other masses (30 %),
centres of mass (2 cm), inertias (30 %), lengths (1 mm), friction and rotors (half or twice as much), joint zeros
(10 mrad), torque gains (2 %, mean 1), delays (1 ms) and a tilted base (10 mrad). MuJoCo simulates it forward under a
controller; a log has 60 s at 500 Hz with noise. Printed are the rms of error over standard error of the parameters that
are called determined, and torques left in parts that were not fitted, over those left with the true numbers.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np
import tyro
from scipy.spatial.transform import Rotation

from discrepancy.joints.calibration import ArmCalibration, calibrate_arm
from discrepancy.joints.fit import Fit
from discrepancy.joints.link_prior import CENTRAL
from discrepancy.joints.mechanics import horizontal, inertial_parameters
from discrepancy.joints.model import SerialModel, load_model
from discrepancy.joints.trials import trials_of
from estimator.statistics import rms
from joints import arm
from mocobot_logs.joints.joint_log import JointLog

MASS, CENTRE_M, INERTIA, JOINT = 0.3, 0.02, 0.3, 0.5
ZERO_RAD, GAIN, DELAY_S, TILT_RAD = 0.01, 0.02, 1e-3, 0.01
Truth = dict[tuple[str, str], float]


@dataclass(frozen=True)
class Options:
    """Command line.

    Attributes:
        arms: how many.
        first: seed of the first.
        verbose: print every determined parameter that is off by more than three standard errors.
    """

    arms: int = 20
    first: int = 0
    verbose: bool = False


def owners(folder: Path) -> SerialModel:
    """The owner's model: masses as its maker says, no friction, no rotors."""
    path = folder / "arm.xml"
    spec = mujoco.MjSpec.from_file(str(arm.MODEL))
    for joint in spec.joints:
        joint.limited = joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    spec.compile()
    path.write_text(spec.to_xml(), encoding="utf-8")
    return load_model(path)


def wrong(rng: np.random.Generator) -> arm.Healthy:
    """The true arm."""
    spec = arm.model_spec()
    for body in spec.bodies[2:]:
        body.mass *= np.exp(MASS * rng.standard_normal())
        moments, axes = np.linalg.eigh(full(np.asarray(body.fullinertia)))
        turn = Rotation.from_rotvec(0.1 * rng.standard_normal(3)).as_matrix()
        second = 0.5 * moments.sum() - moments  # second moments of mass: any positive ones are a body's
        second = second * np.exp(INERTIA * rng.standard_normal(3))
        inertia = turn @ axes @ np.diag(second.sum() - second) @ axes.T @ turn.T
        body.fullinertia = [inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        body.ipos = np.asarray(body.ipos) + CENTRE_M * rng.standard_normal(3)
        if body.name != "link1":
            body.pos = np.asarray(body.pos) + arm.LENGTH_M * rng.standard_normal(3)
    tilt = TILT_RAD * rng.standard_normal(2)
    spec.option.gravity = 9.81 * np.array([tilt[0], tilt[1], -np.sqrt(1.0 - tilt @ tilt)])
    for joint in spec.joints:
        share = np.exp(JOINT * rng.standard_normal(3))
        joint.armature, joint.frictionloss = joint.armature * share[0], joint.frictionloss * share[1]
        joint.damping = np.asarray(joint.damping) * share[2]
        joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
    zero, gain, delay = (size * rng.standard_normal(7) for size in (ZERO_RAD, GAIN, DELAY_S))
    zero[0] = 0.0  # turns the arm about gravity, which nothing shows
    return arm.Healthy(spec, zero, 1.0 + gain - gain.mean(), delay)


def full(six: np.ndarray) -> np.ndarray:
    """A symmetric matrix of xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def log_of(true: arm.Healthy, rng: np.random.Generator) -> JointLog:
    """What the arm's sensors read."""
    motion = arm.moved(true.spec.copy(), rng)
    torque = arm.late(motion.time, motion.torque * true.scale, true.delay_s)
    return arm.logged("arm", motion.time, motion.q + true.zero, torque, rng)


def truth_of(true: arm.Healthy, model: SerialModel) -> Truth:
    """True values by place and parameter."""
    spec = true.spec.compile()
    out: Truth = {}
    for b in range(2, spec.nbody):
        own = Rotation.from_quat(spec.body_iquat[b], scalar_first=True).as_matrix()
        inertia = own @ np.diag(spec.body_inertia[b]) @ own.T
        six = (inertia[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)))
        values = [spec.body_mass[b], *spec.body_ipos[b], *six]
        out |= {(spec.body(b).name, n): float(v) for n, v in zip(CENTRAL, values, strict=True)}
    for j, n in enumerate(model.joints):
        out |= {
            (n, "coulomb_Nm"): float(spec.dof_frictionloss[j]),
            (n, "viscous_Nms_per_rad"): float(spec.dof_damping[j]),
            (n, "armature_kgm2"): float(spec.dof_armature[j]),
            (n, "offset_Nm"): 0.0,
            (n, "gain"): float(true.scale[j] - 1.0),
            (n, "delay_s"): float(true.delay_s[j]),
            (n, "zero_rad"): float(-true.zero[j]),
        }
        moved = spec.body_pos[spec.jnt_bodyid[j]] - model.model.body_pos[model.model.jnt_bodyid[j]]
        out |= {(n, f"position_{axis}_m"): float(x) for axis, x in zip("xyz", moved, strict=True)}
    gravity = np.array(model.model.opt.gravity)
    for i, w in enumerate(horizontal(gravity)):
        out["base", f"tilt_{i + 1}_rad"] = float(
            -np.cross(w, gravity) @ spec.opt.gravity / (gravity @ gravity)
        )
    return out


def combined(found: ArmCalibration, truth: Truth) -> list[float]:
    """Error over standard error of the determined combinations."""
    out = []
    for combination in found.combinations:
        value = 0.0
        for (place, name), factor in combination.terms.items():
            if (place, name) in truth:
                value += factor * truth[place, name]
            else:
                t = [truth[place, n] for n in CENTRAL]
                ten = inertial_parameters(t[0], np.array(t[1:4]), full(np.array(t[4:])))
                value += factor * ten[("m", "mx", "my", "mz", "xx", "yy", "zz", "xy", "xz", "yz").index(name)]
        out.append((combination.value - value) / combination.se)
    return out


def at_truth(true: arm.Healthy, log: JointLog, truth: Truth, folder: Path) -> list[np.ndarray]:
    """Torques left with the true model, rms of each part and joint."""
    path = folder / "true.xml"
    true.spec.compile()
    path.write_text(true.spec.to_xml(), encoding="utf-8")
    model = load_model(path)
    fit = Fit(model, trials_of(model, [log]))
    at = fit.given_x.copy()
    for i, s in enumerate(fit.scalars):
        known = s.place == "base" or s.name.startswith("position")  # they are in the true model
        at[10 * len(fit.bodies) + i] = 0.0 if known else truth[s.place, s.name] - s.model
    fit.jump(at)
    fit.prepare()
    return [np.sqrt(np.mean(fit.left(t, at - fit.at) ** 2, axis=0)) for t in range(len(fit.normals))]


def main(options: Options) -> None:
    """Print the tables."""
    all_z: list[float] = []
    all_both: list[float] = []
    ratios, gained, seconds = [], [], []
    with tempfile.TemporaryDirectory() as name:
        model = owners(Path(name))
        for seed in range(options.first, options.first + options.arms):
            rng = np.random.default_rng([seed, *b"calibrate arms"])
            true = wrong(rng)
            log, truth = log_of(true, rng), truth_of(true, model)
            begun = time.process_time()
            found = calibrate_arm(model, [log])
            seconds.append(time.process_time() - begun)
            told = [p for p in found.parameters if p.determined]
            z = [(p.value - truth[p.place, p.name]) / p.se for p in told]
            both = combined(found, truth)
            all_z += z
            all_both += both
            best = at_truth(true, log, truth, Path(name))
            own = [h.calibrated / b for h, b in zip(found.held_out, best, strict=True)]
            plain = [h.least_squares / b for h, b in zip(found.held_out, best, strict=True)]
            ratios.append(float(np.mean(own)))
            gained.append(float(np.mean(plain)))
            print(
                f"arm {seed}: {len(told)} of {len(found.parameters)} determined, rms {rms(z):.2f}, largest "
                f"{np.max(np.abs(z)):.1f}; {len(both)} combinations, rms {rms(both):.2f}; held out over truth "
                f"{ratios[-1]:.3f}, least squares {gained[-1]:.3f}; {seconds[-1]:.1f} s of CPU",
                flush=True,
            )
            if options.verbose:
                for p, own_z in zip(told, z, strict=True):
                    if abs(own_z) > 3.0:
                        print(
                            f"    {p.place} {p.name}: {p.value:.5g} +- {p.se:.2g}, true {truth[p.place, p.name]:.5g}"
                        )
    print(
        f"\nrms of error over standard error {rms(all_z):.2f}, of combinations {rms(all_both):.2f}; beyond 3: "
        f"{100 * np.mean(np.abs(all_z) > 3):.1f} %; held out over truth: median {np.median(ratios):.3f}, worst "
        f"{max(ratios):.3f}; least squares {np.median(gained):.3f}, {max(gained):.3f}; {np.median(seconds):.1f} s CPU"
    )


if __name__ == "__main__":
    main(tyro.cli(Options, description=__doc__))
