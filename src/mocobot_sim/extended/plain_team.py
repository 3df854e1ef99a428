"""A team at rest as plain MJCF with sensors and a keyframe: python -m mocobot_sim.extended.plain_team PAYLOAD FOLDER

It makes the files of ``models/team_a`` but for README and CHANGELOG. ``team.xml`` and ``effects.json`` are an extended
model, so ``mocobot simulate --model FOLDER`` runs trials with it. ``scene.xml`` is the same team with its motors locked
where they hold the payload.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco

from mocobot_sim.effects.payload import PAYLOAD
from mocobot_sim.extended.extended import NUMBERS, SCENE, write_extended
from mocobot_sim.scene.models import GIMBAL_AXES, omnid_design
from mocobot_sim.scene.scene import TeamScene, build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home

BRAKE = 'solref="0.004 1" solimp="0.9999 0.9999 0.001 0.5 2"'
"""Stiffness of the locked motors in ``scene.xml``, that of the rods."""


def plain_team(payload: str | Path) -> TeamScene:
    """Build a team with sensors and the keyframe ``hold``, in which constant motor torques balance the payload.

    Sensors of robot N are those of a recording: ``omnidN/phi1`` to ``phi3`` (driven angle minus its value at home
    [rad]), ``omnidN/theta_z``, ``theta_y``, ``theta_x`` (gimbal angles [rad]), and ``omnidN/tau1`` to ``tau3`` (torque
    of the spring on the link [N m]). ``payload_position`` and ``payload_orientation`` are the pose of {1} in the world.

    Raises:
        InputError: as in ``build_team`` and ``assemble_at_home``.
    """
    scene = build_team(payload)
    root = scene.root
    for i in range(1, scene.robots + 1):
        omnid = root.find("joint", f"omnid{i}/motor1").root
        for k in (1, 2, 3):
            motor, spring = (omnid.find("joint", f"{part}{k}") for part in ("motor", "spring"))
            # The length of a fixed tendon is the sum of its joints, each times its coefficient.
            for name, parts in (
                (f"phi{k}", ((motor, 1.0), (spring, 1.0))),
                (f"tau{k}", ((spring, -omnid_design().sea_stiffness_Nm_per_rad),)),
            ):
                tendon = omnid.tendon.add("fixed", name=name)
                for joint, coefficient in parts:
                    tendon.add("joint", joint=joint, coef=coefficient)
                omnid.sensor.add("tendonpos", name=name, tendon=tendon)
        for axis in GIMBAL_AXES:
            omnid.sensor.add("jointpos", name=f"theta_{axis}", joint=omnid.find("joint", f"gimbal_{axis}"))
    body = root.find("body", PAYLOAD)
    root.sensor.add("framepos", name="payload_position", objtype="xbody", objname=body)
    root.sensor.add("framequat", name="payload_orientation", objtype="xbody", objname=body)
    model = scene.compile()
    data = mujoco.MjData(model)
    assemble_at_home(scene, model, data, TeamIndex.of(model))
    root.keyframe.add("key", name="hold", qpos=data.qpos.tolist(), ctrl=data.ctrl.tolist())
    return scene


def locked(scene: TeamScene) -> str:
    """Write an MJCF that includes ``team.xml`` and locks all motors at the keyframe ``hold``."""
    model = scene.compile()
    held, rows = model.key("hold").qpos, []
    for name in (model.actuator(k).name for k in range(model.nu)):
        at = held[model.joint(name).qposadr[0]]
        rows.append(
            f'    <joint name="{name.replace("/", "_")}_brake" joint1="{name}" polycoef="{at:.17g} 0 0 0 0"\n'
            f"           {BRAKE}/>"
        )
    return "\n".join(
        [
            "<!-- The team with its motors locked where they hold the payload, for a look in plain MuJoCo. -->",
            '<mujoco model="team scene">', f'  <include file="{SCENE}"/>', "  <equality>", *rows, "  </equality>",
            "</mujoco>", "",
        ]
    )  # fmt: skip


def write_plain_team(payload: str | Path, folder: Path) -> None:
    """Write ``team.xml``, ``effects.json``, ``scene.xml`` and the payload's files to a folder.

    Raises:
        InputError: as in ``plain_team``.
    """
    scene = plain_team(payload)
    folder.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory() as temporary:
        write_extended(scene, (), Path(temporary) / "team", {"payload": Path(payload).stem})
        for name in (SCENE, NUMBERS, *scene.root.get_assets()):
            (folder / name).write_bytes((Path(temporary) / "team" / name).read_bytes())
    (folder / "scene.xml").write_text(locked(scene), encoding="utf-8")


if __name__ == "__main__":
    write_plain_team(sys.argv[1], Path(sys.argv[2]))
