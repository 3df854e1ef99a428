"""MJCF of the two machines: the hung front legs of a quadruped and a six-axis arm of hobby servos."""

from __future__ import annotations

from dataclasses import dataclass

# mujoco's compiled modules come without types.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

STEP_S = 5e-4
"""Step of the simulation. With RK4 it has the continuous robot's motion: an Euler step of this length shifts the
damping of the drive by half a step, which reads as 2 % of a rotor's inertia."""
TRUNK_KG, TRUNK_KGM2 = 6.9, (0.025, 0.098, 0.107)
PLATE_KG, PLATE_KGM2 = 1.5, (0.004, 0.004, 0.006)
HEAD = """<mujoco model="{name}">
  <compiler angle="radian" autolimits="true"/>
  <option timestep="0.0005" integrator="RK4"><flag contact="disable"/></option>
  <default><joint solreffriction="0.002 1" solimpfriction="0.99 0.999 0.001 0.5 2" solreflimit="0.004 1"/></default>
  <worldbody><body name="base" pos="0 0 {height}">{base}
"""


@dataclass(frozen=True)
class Kind:
    """A kind of machine.

    Attributes:
        joints: names of the logged joints.
        xml: MJCF without actuators; ``{base}`` is what holds the base.
        rest: pose that motions go around [rad], shape (J,).
        reach: largest amplitude of a motion [rad], shape (J,).
        most_hz: highest frequency of a motion.
        range: limits of the joints [rad], shape (J, 2).
    """

    joints: tuple[str, ...]
    xml: str
    rest: np.ndarray
    reach: np.ndarray
    most_hz: float
    range: np.ndarray


def _leg_xml(side: str, sign: float) -> str:
    """One front leg of about a Go2's sizes and masses; ``sign`` is 1 on the left."""
    return f"""
    <body name="{side}_hip" pos="0.193 {0.0465 * sign} 0">
      <inertial mass="0.68" pos="-0.0054 {0.0019 * sign} 0" diaginertia="4.8e-4 8.8e-4 6e-4"/>
      <joint name="{side}_hip_joint" axis="1 0 0" range="-1.0472 1.0472"/>
      <body name="{side}_thigh" pos="0 {0.0955 * sign} 0">
        <inertial mass="1.15" pos="-0.0037 {-0.0223 * sign} -0.0327" diaginertia="5.9e-3 5.8e-3 9e-4"/>
        <joint name="{side}_thigh_joint" axis="0 1 0" range="-1.5708 3.4907"/>
        <body name="{side}_calf" pos="0 0 -0.213">
          <inertial mass="0.24" pos="0.0063 {-0.0006 * sign} -0.1414" diaginertia="1.49e-3 1.46e-3 6e-5"/>
          <joint name="{side}_calf_joint" axis="0 1 0" range="-2.7227 -0.8378"/>
        </body></body></body>"""


LEG = Kind(
    tuple(f"{side}_{part}_joint" for side in ("FL", "FR") for part in ("hip", "thigh", "calf")),
    HEAD.format(name="hung legs", height=0.6, base="{base}")
    + _leg_xml("FL", 1.0)
    + _leg_xml("FR", -1.0)
    + "</body></worldbody></mujoco>",
    np.array([0.0, 1.1, -1.8] * 2),
    np.array([0.35, 0.45, 0.45] * 2),
    8.0,
    np.array([(-1.0472, 1.0472), (-1.5708, 3.4907), (-2.7227, -0.8378)] * 2),
)
ARM = Kind(
    ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"),
    HEAD.format(name="servo arm", height=0.06, base="{base}")
    + """
    <body name="turret">
      <inertial mass="0.10" pos="-0.01 0 0.03" diaginertia="7e-5 8e-5 6e-5"/>
      <joint name="shoulder_pan" axis="0 0 1" range="-1.9 1.9"/>
      <body name="upper_arm" pos="0.02 0 0.054">
        <inertial mass="0.103" pos="0.07 0.005 0.015" diaginertia="4e-5 2.2e-4 2.3e-4"/>
        <joint name="shoulder_lift" axis="0 1 0" range="-2.2 1.2"/>
        <body name="forearm" pos="0.116 0 0.02">
          <inertial mass="0.104" pos="0.062 -0.004 0.008" diaginertia="3.5e-5 2e-4 2.1e-4"/>
          <joint name="elbow_flex" axis="0 1 0" range="-1.2 2.2"/>
          <body name="wrist" pos="0.135 0 0">
            <inertial mass="0.079" pos="0.024 0.003 0.004" diaginertia="3e-5 4.5e-5 4.8e-5"/>
            <joint name="wrist_flex" axis="0 1 0" range="-1.7 1.7"/>
            <body name="hand" pos="0.06 0 0">
              <inertial mass="0.087" pos="0.025 0.006 0.008" diaginertia="4e-5 5.5e-5 6e-5"/>
              <joint name="wrist_roll" axis="1 0 0" range="-2.8 2.8"/>
              <body name="jaw" pos="0.03 0.018 0">
                <inertial mass="0.03" pos="0.035 0.006 0" diaginertia="4e-6 1.6e-5 1.7e-5"/>
                <joint name="gripper" axis="0 0 1" range="-0.3 1.8"/>
              </body></body></body></body></body></body></body></worldbody></mujoco>""",
    np.array([0.0, -0.7, 0.9, 0.2, 0.0, 0.6]),
    np.array([0.7, 0.45, 0.45, 0.5, 0.8, 0.5]),
    3.0,
    np.array([(-1.9, 1.9), (-2.2, 1.2), (-1.2, 2.2), (-1.7, 1.7), (-2.8, 2.8), (-0.3, 1.8)]),
)
KINDS = {"leg": LEG, "arm": ARM}


def spec_of(kind: str, stand: np.ndarray | None = None) -> mujoco.MjSpec:
    """A machine without actuators.

    Args:
        kind: ``leg`` or ``arm``.
        stand: stiffness and damping of the stand in x, y, z [N/m, N s/m] and about x, y, z [N m/rad, N m s/rad], shape
            (6, 2); none for a fixed base.
    """
    held = ""
    if stand is not None:
        mass, inertia = (TRUNK_KG, TRUNK_KGM2) if kind == "leg" else (PLATE_KG, PLATE_KGM2)
        moments = " ".join(map(str, inertia))
        held = f'<inertial mass="{mass}" pos="0 0 0" diaginertia="{moments}"/>'
        for k, (stiffness, damping) in enumerate(stand):
            axis = " ".join("1" if i == k % 3 else "0" for i in range(3))
            held += (
                f'<joint name="stand_{k}" type="{"slide" if k < 3 else "hinge"}" axis="{axis}" '
                f'stiffness="{stiffness:.9g}" damping="{damping:.9g}"/>'
            )
    return mujoco.MjSpec.from_string(KINDS[kind].xml.replace("{base}", held))


def stand_of(kind: str, rng: np.random.Generator) -> np.ndarray:
    """A stand that yields: the base alone rocks at 2.5 to 6 Hz (legs) or 6 to 12 Hz (arms), lightly damped."""
    mass, inertia = (TRUNK_KG, TRUNK_KGM2) if kind == "leg" else (PLATE_KG, PLATE_KGM2)
    low, high = (2.5, 6.0) if kind == "leg" else (6.0, 12.0)
    own = np.array([mass] * 3 + list(inertia))
    w = 2.0 * np.pi * rng.uniform(low, high, 6)
    return np.column_stack([own * w**2, 2.0 * rng.uniform(0.03, 0.1, 6) * own * w])


def add_play(spec: mujoco.MjSpec, joint: str, play_rad: float) -> None:
    """Put play between a drive and its link: the link turns on what the joint turns, between two stops."""
    own = spec.joint(joint)
    play = own.parent.add_joint(name=f"{joint}_play", axis=np.array(own.axis))
    play.range, play.limited = [-0.5 * play_rad, 0.5 * play_rad], mujoco.mjtLimited.mjLIMITED_TRUE
    play.armature, play.damping = 1e-5, [2e-3, 0.0, 0.0]
    play.solref_limit = [0.003, 1.0]
