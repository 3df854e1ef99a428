"""Places of a team where something may be wrong that no catalogue lists."""

from __future__ import annotations

from discrepancy.team.laws.place import Place
from discrepancy.team.laws.variable import Variable
from discrepancy.team.laws.variables import joint_variable, payload_felt, payload_variable

XYZ = ("x", "y", "z")
READINGS = {"phi reading": "phi", "theta reading": "theta", "tau reading": "tau"}


def places_of(robots: int) -> list[Place]:
    """Places of N robots and their payload, in the order in which they are tried."""
    out = []
    for i in range(1, robots + 1):
        for j in (1, 2, 3):
            driven = tuple(joint_variable(n, i, j) for n in ("phi", "phi_rate", "phi_acceleration", "tau"))
            gimbal = tuple(joint_variable(n, i, j) for n in ("theta", "theta_rate", "theta_acceleration"))
            out += [
                _joint("tau reading", i, j, "tau", "N m", "reading of the torque sensor of {driven joint}", driven,
                       twin="driven torque"),
                _joint("phi reading", i, j, "phi", "rad", "reading of the angle of {driven joint}", driven),
                _joint("theta reading", i, j, "theta", "rad", "reading of the angle of {gimbal axis}", gimbal),
                _joint("gimbal torque", i, j, "gimbal_torque", "N m", "torque in {gimbal axis}", gimbal, offset=True),
            ]  # fmt: skip
        out.append(
            Place("base position", i, None, tuple(f"base_position_{i}_{a}" for a in XYZ), XYZ, "m",
                  "displacement of {base}")
        )  # fmt: skip
        out.append(
            Place("grasp position", i, None, tuple(f"grasp_position_{i}_{a}" for a in XYZ), XYZ, "m",
                  "displacement of {grasp}")
        )  # fmt: skip
    own = tuple(payload_variable(n, a) for n in ("payload_position", "payload_velocity") for a in XYZ)
    inner = tuple(
        payload_variable(n, a)
        for n in ("payload_felt", "payload_acceleration", "payload_rate", "payload_up")
        for a in XYZ
    )
    inner += (payload_felt(),)
    out += [
        _payload("force on payload", (*(f"payload_force_{a}" for a in XYZ), *(f"payload_moment_{a}" for a in XYZ)),
                 ("force x", "force y", "force z", "moment x", "moment y", "moment z"), "N",
                 "force and moment on the payload, in the world", own, units=("N",) * 3 + ("N m",) * 3),
        _payload("payload mass", ("payload_mass",), ("",), "kg", "mass of the payload", ()),
        _payload("payload centre", tuple(f"payload_first_moment_{a}" for a in XYZ), XYZ, "kg m",
                 "first moment of the payload's mass", inner),
        _payload("payload spin", tuple(f"payload_spin_{a}" for a in XYZ), XYZ, "kg m^2/s",
                 "angular momentum inside the payload", ()),
    ]  # fmt: skip
    return out


def _joint(
    name: str, robot: int, joint: int, target: str, unit: str, title: str, own: tuple[Variable, ...], *,
    offset: bool = False, twin: str | None = None,
) -> Place:  # fmt: skip
    return Place(
        name, robot, joint, (f"{target}_{robot}_{joint}",), ("",), unit, title, own, offset, twin=twin
    )


def _payload(
    name: str,
    targets: tuple[str, ...],
    axes: tuple[str, ...],
    unit: str,
    title: str,
    own: tuple[Variable, ...],
    units: tuple[str, ...] = (),
) -> Place:
    return Place(name, None, None, targets, axes, unit, title, own, units=units)
