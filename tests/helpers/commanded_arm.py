"""A small arm whose drives follow position commands and tell no torque: MuJoCo simulates it, files have its log."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from commanded.machine import arriving

STEP_S, SETTLE_S = 5e-4, 0.3
ARM = """<mujoco><compiler angle="radian"/><worldbody>
<body name="upper" pos="0 0 0.6"><joint name="shoulder" axis="0 1 0"/>
  <inertial pos="0.01 0.01 -0.09" mass="1.1" diaginertia="0.006 0.006 0.001"/>
<body name="fore" pos="0 0 -0.21"><joint name="elbow" axis="0 1 0"/>
  <inertial pos="0.006 0 -0.11" mass="0.4" diaginertia="0.003 0.003 0.0002"/>
</body></body></worldbody></mujoco>"""
LIFT = """<mujoco><compiler angle="radian"/><worldbody>
<body name="carriage" pos="0 0 0.3"><joint name="lift" type="slide" axis="0 0 1"/>
  <inertial pos="0 0 0" mass="1.5" diaginertia="0.004 0.004 0.004"/>
<body name="boom" pos="0.1 0 0"><joint name="swing" axis="0 1 0"/>
  <inertial pos="0.11 0 0.01" mass="0.5" diaginertia="0.0004 0.003 0.003"/>
</body></body></worldbody></mujoco>"""


@dataclass(frozen=True)
class Arm:
    """What MuJoCo simulates: a model, its loops and friction, shape (J,) each.

    Attributes:
        xml: model without rotors, friction and actuators.
        kp, kd: gains of the position loops [N m/rad, N m s/rad; N/m, N s/m].
        rotor: reflected inertia [kg m^2 or kg].
        dry, viscous: Coulomb and viscous friction [N m, N m s/rad; N, N s/m].
        reach: largest motion about ``rest`` [rad or m].
        rest: middle of the motion [rad or m].
        late_s: from the stamp of a command until the loop follows it [s].
        most: largest torque of the drives [N m or N]; 0: they have no limit.
    """

    xml: str = ARM
    kp: tuple[float, ...] = (30.0, 20.0)
    kd: tuple[float, ...] = (1.0, 0.6)
    rotor: tuple[float, ...] = (0.02, 0.012)
    dry: tuple[float, ...] = (0.4, 0.25)
    viscous: tuple[float, ...] = (0.25, 0.15)
    reach: tuple[float, ...] = (0.6, 0.7)
    rest: tuple[float, ...] = (0.4, -0.5)
    late_s: float = 0.006
    most: tuple[float, ...] = (0.0, 0.0)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(joint.name for joint in mujoco.MjSpec.from_string(self.xml).joints)

    def spec(self, factor: float = 1.0, mass: float = 1.0) -> mujoco.MjSpec:
        """The model without loops; rotors and friction off by a factor, up and down in turn, and masses by another."""
        spec = mujoco.MjSpec.from_string(self.xml)
        for j, joint in enumerate(spec.joints):
            up = factor ** (1 - 2 * (j % 2))
            joint.armature, joint.frictionloss = self.rotor[j] * up, self.dry[j] / up
            joint.damping = [self.viscous[j] * up, 0.0, 0.0]
            joint.solref_friction, joint.solimp_friction = [0.002, 1.0], [0.99, 0.999, 0.001, 0.5, 2.0]
        for body in spec.bodies[1:]:
            body.mass, body.inertia = body.mass * mass, np.array(body.inertia) * mass
        return spec

    def commands(self, stamps: np.ndarray, kind: int = 0) -> np.ndarray:
        """Sums of sines with steps in the second half, shape (n, J); another motion for each ``kind``."""
        out = np.empty((len(stamps), len(self.kp)))
        rng = np.random.default_rng(7 + kind)
        for j in range(len(self.kp)):
            f = np.array([0.23, 0.6, 1.1, 1.9, 3.1]) * rng.uniform(0.85, 1.15, 5)
            size = np.array([0.35, 0.35, 0.3, 0.2, 0.12])
            wave = (size * np.sin(2.0 * np.pi * np.outer(stamps, f) + rng.uniform(0.0, 6.0, 5))).sum(axis=1)
            level = rng.uniform(-0.5, 0.5, 40)[np.floor(stamps / 0.8).astype(int) % 40]
            late = (stamps > 0.5 * stamps[-1]) & (stamps < 0.75 * stamps[-1])
            out[:, j] = self.rest[j] + self.reach[j] * np.where(late, 0.5 * wave + level, wave)
        return out

    def positions(
        self,
        stamps: np.ndarray,
        commands: np.ndarray,
        on: np.ndarray | None = None,
        added: np.ndarray | None = None,
    ) -> np.ndarray:
        """True positions at the stamps, shape (n, J).

        Args:
            stamps: even, from 0 [s].
            commands: each holds until the next, shape (n, J).
            on: whether the drives are on from each stamp, shape (n,).
            added: torques told beside the commands, shape (n, J).
        """
        spec = self.spec()
        for name, kp, kd, most in zip(self.joints, self.kp, self.kd, self.most, strict=True):
            actuator = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            actuator.gainprm[0], actuator.biasprm[:3] = kp, [0.0, -kp, -kd]
            if most:
                actuator.forcelimited, actuator.forcerange = True, [-most, most]
        spec.option.timestep, spec.option.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
        model = spec.compile()
        data, told = mujoco.MjData(model), commands if added is None else commands + added / np.array(self.kp)
        times = np.arange(-SETTLE_S, stamps[-1] + STEP_S, STEP_S)
        control = arriving(stamps, told, self.late_s, np.append(times, times[-1] + STEP_S))
        alive = np.ones(len(times), bool)
        if on is not None:
            alive = on[np.searchsorted(stamps, times + 1e-9, side="right").clip(1) - 1]
        gains, q = (
            (model.actuator_gainprm.copy(), model.actuator_biasprm.copy()),
            np.empty((len(times), len(self.kp))),
        )
        data.qpos[:] = control[0]
        for k in range(len(times)):
            q[k] = data.qpos
            model.actuator_gainprm[:], model.actuator_biasprm[:] = gains[0] * alive[k], gains[1] * alive[k]
            data.ctrl[:] = control[k]
            mujoco.mj_step(model, data)
        return np.column_stack([np.interp(stamps, times, x) for x in q.T])

    def map(self, control: str = "", channels: str = "", **gains: object) -> str:
        """The log's map; ``position_gain`` and ``velocity_gain`` are the true ones if not given."""
        slides = [
            joint.type == mujoco.mjtJoint.mjJNT_SLIDE for joint in mujoco.MjSpec.from_string(self.xml).joints
        ]
        own = "".join(
            f'[joint.{name}.channels]\nq.unit = "m"\ncommand.unit = "m"\n'
            for name, slide in zip(self.joints, slides, strict=True)
            if slide
        )
        told = {"position_gain": list(self.kp), "velocity_gain": list(self.kd)} | gains
        lines = "".join(f"{name} = {value}\n" for name, value in told.items())
        return (
            f'version = 1\njoints = {list(self.joints)}\ntime = {{ column = "t", unit = "s" }}\n[channels]\n'
            'q = { column = "{joint} q", unit = "rad" }\n'
            f'command = {{ column = "{{joint}} command", unit = "rad" }}\n{channels}{own}'
            f'[control]\ncommand = "position"\ngain_of = "torque"\n{lines}{control}'
        )

    def write(self, folder: Path, text: str | None = None, name: str = "log", **columns: np.ndarray) -> Path:
        """Write a log of columns ``t``, ``q``, ``command`` and more, with its map; cells of NaN are empty."""
        heads, cells = [], []
        for what, values in columns.items():
            heads += [what] if values.ndim == 1 else [f"{joint} {what}" for joint in self.joints]
            cells.append(values)
        rows = [",".join("" if np.isnan(x) else f"{x:.9g}" for x in row) for row in np.column_stack(cells)]
        path = folder / f"{name}.csv"
        path.write_text("\n".join([",".join(heads), *rows]) + "\n", encoding="utf-8")
        (folder / "log.toml").write_text(self.map() if text is None else text, encoding="utf-8")
        return path

    def truth(self) -> dict[tuple[str, str], float]:
        """True values by place and parameter."""
        out = {}
        for j, name in enumerate(self.joints):
            slide = mujoco.MjSpec.from_string(self.xml).joints[j].type == mujoco.mjtJoint.mjJNT_SLIDE
            units = ("kg", "N", "Ns_per_m") if slide else ("kgm2", "Nm", "Nms_per_rad")
            out[name, f"armature_{units[0]}"] = self.rotor[j]
            out[name, f"coulomb_{units[1]}"] = self.dry[j]
            out[name, f"viscous_{units[2]}"] = self.viscous[j]
            out[name, "command_delay_s"] = self.late_s
        return out
