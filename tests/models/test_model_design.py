"""Every number of models/omnid/design.toml against the compiled model: one truth, two readers."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from estimator.arm.design import OmnidDesign, load_design

OMNID = Path(__file__).resolve().parents[2] / "models" / "omnid"
LEGS = (1, 2, 3)
AZIMUTH = {1: 0.0, 2: 2 * np.pi / 3, 3: 4 * np.pi / 3}


class Robot:
    """The compiled Omnid in its home pose, with positions expressed in {b}."""

    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(OMNID / "omnid.xml"))
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.R_Wb = self.data.body("base").xmat.reshape(3, 3)

    def in_base(self, position: np.ndarray) -> np.ndarray:
        return self.R_Wb.T @ (position - self.data.body("base").xpos)

    def body(self, name: str) -> np.ndarray:
        return self.in_base(self.data.body(name).xpos)

    def site(self, name: str) -> np.ndarray:
        return self.in_base(self.data.site(name).xpos)

    def inertia_about_axis(self, body: str, joint: str) -> float:
        """Moment of inertia of one body about the axis of a joint [kg m^2]."""
        view, axis = self.data.body(body), self.data.joint(joint).xaxis
        R = view.ximat.reshape(3, 3)
        arm = view.xipos - self.data.joint(joint).xanchor
        arm = arm - axis * (axis @ arm)
        return (
            axis @ R @ np.diag(self.model.body(body).inertia) @ R.T @ axis
            + self.model.body(body).mass[0] * arm @ arm
        )


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot()


@pytest.fixture(scope="module")
def design() -> OmnidDesign:
    return load_design(OMNID / "design.toml")


def _direction(leg: int) -> np.ndarray:
    return np.array([np.cos(AZIMUTH[leg]), np.sin(AZIMUTH[leg]), 0.0])


def _phi_home(design: OmnidDesign) -> float:
    """Driven angle at home from the triangle axis, knee, platform joint (law of cosines)."""
    inward = design.platform_radius_m - design.base_radius_m
    reach = np.hypot(inward, design.home_height_m)
    cosine = (design.proximal_length_m**2 + reach**2 - design.rod_length_m**2) / (
        2 * design.proximal_length_m * reach
    )
    return np.arctan2(design.home_height_m, inward) - np.arccos(cosine)


def _phi(design: OmnidDesign, wrist: np.ndarray, leg: int) -> float:
    """Driven angle that puts the wrist at a position in {b}, knee outward; NaN out of reach."""
    u = _direction(leg)
    target = wrist + (design.platform_radius_m - design.base_radius_m) * u
    x, z = target @ u, target[2]
    side = target @ np.cross([0, 0, 1], u)
    k = (x**2 + z**2 + side**2 + design.proximal_length_m**2 - design.rod_length_m**2) / (
        2 * design.proximal_length_m
    )
    ratio = k / np.hypot(x, z)
    return np.nan if abs(ratio) > 1 else np.arctan2(z, x) - np.arccos(ratio)


def _base_radius(robot, design):
    for leg in LEGS:
        for joint in (f"motor{leg}", f"spring{leg}"):
            anchor = robot.in_base(robot.data.joint(joint).xanchor)
            np.testing.assert_allclose(anchor, design.base_radius_m * _direction(leg), rtol=0, atol=1e-12)
            # Positive phi raises the knee: axis = u x z.
            axis = robot.R_Wb.T @ robot.data.joint(joint).xaxis
            np.testing.assert_allclose(axis, np.cross(_direction(leg), [0, 0, 1]), rtol=0, atol=1e-12)


def _platform_radius(robot, design):
    for leg in LEGS:
        offset = robot.site(f"platform{leg}") - robot.body("platform")
        np.testing.assert_allclose(offset, design.platform_radius_m * _direction(leg), rtol=0, atol=1e-12)


def _proximal_length(robot, design):
    phi = _phi_home(design)
    for leg in LEGS:
        u = _direction(leg)
        knee = design.base_radius_m * u + design.proximal_length_m * (np.cos(phi) * u + [0, 0, np.sin(phi)])
        np.testing.assert_allclose(robot.body(f"rod{leg}"), knee, rtol=0, atol=1e-12)
        for joint in (f"knee{leg}_swing", f"knee{leg}_tilt"):
            np.testing.assert_allclose(
                robot.in_base(robot.data.joint(joint).xanchor), knee, rtol=0, atol=1e-12
            )


def _rod_length(robot, design):
    for leg in LEGS:
        tip = robot.site(f"rod{leg}_tip")
        assert abs(np.linalg.norm(tip - robot.body(f"rod{leg}")) - design.rod_length_m) < 1e-12
        # Home closes the loops: the rod ends where the platform holds it.
        np.testing.assert_allclose(tip, robot.site(f"platform{leg}"), rtol=0, atol=1e-12)
        equality = robot.model.equality(f"rod{leg}")
        assert equality.type[0] == mujoco.mjtEq.mjEQ_CONNECT
        assert equality.obj1id[0] == robot.model.site(f"rod{leg}_tip").id
        assert equality.obj2id[0] == robot.model.site(f"platform{leg}").id


def _phi_range(robot, design):
    # No stop in the model: a trial checks phi against the range and fails. Home and workspace lie inside.
    assert design.phi_min_rad < _phi_home(design) < design.phi_max_rad
    for leg in LEGS:
        assert not robot.model.joint(f"motor{leg}").limited[0]
        assert not robot.model.joint(f"spring{leg}").limited[0]


def _home_height(robot, design):
    for body in ("platform", "yoke", "ring", "flange"):
        np.testing.assert_allclose(robot.body(body), [0, 0, design.home_height_m], rtol=0, atol=1e-12)
    np.testing.assert_allclose(robot.site("grasp"), [0, 0, design.home_height_m], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(robot.data.qpos, 0)


def _workspace_radius(robot, design):
    """The commanded sphere around the compiled grasp site is reachable within the range of phi."""
    polar, azimuth = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, 2 * np.pi, 49))
    sphere = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1)
    wrists = robot.site("grasp") + design.workspace_radius_m * sphere.reshape(-1, 3)
    phi = np.array([[_phi(design, wrist, leg) for leg in LEGS] for wrist in wrists])
    assert np.isfinite(phi).all()
    assert design.phi_min_rad < phi.min()
    assert phi.max() < design.phi_max_rad


def _gimbal_limit(robot, design):
    previous = robot.model.body("platform").id
    for joint, body, axis in (
        ("gimbal_z", "yoke", [0, 0, 1]), ("gimbal_y", "ring", [0, 1, 0]), ("gimbal_x", "flange", [1, 0, 0]),
    ):  # fmt: skip
        view = robot.model.joint(joint)
        np.testing.assert_array_equal(view.range, [-design.gimbal_limit_rad, design.gimbal_limit_rad])
        np.testing.assert_array_equal(view.axis, axis)
        # R = Rz Ry Rx: each body is the child of the one before, turned by one joint about the wrist centre.
        assert robot.model.body(body).parentid[0] == previous
        assert view.bodyid[0] == robot.model.body(body).id
        np.testing.assert_allclose(
            robot.in_base(robot.data.joint(joint).xanchor), robot.site("grasp"), rtol=0, atol=1e-12
        )
        previous = robot.model.body(body).id


def _sea_stiffness(robot, design):
    for leg in LEGS:
        assert robot.model.joint(f"spring{leg}").stiffness[0] == design.sea_stiffness_Nm_per_rad
        assert robot.model.joint(f"motor{leg}").stiffness[0] == 0
        assert robot.model.qpos_spring[robot.model.joint(f"spring{leg}").qposadr[0]] == 0


def _torque_limit(robot, design):
    assert robot.model.nu == len(LEGS)
    for leg in LEGS:
        actuator = robot.model.actuator(f"motor{leg}")
        assert actuator.trnid[0] == robot.model.joint(f"motor{leg}").id
        assert actuator.ctrllimited[0]
        # The motor has twice the spring's torque limit, so that the torque loop can accelerate the rotor.
        np.testing.assert_array_equal(
            actuator.ctrlrange, [-2 * design.torque_limit_Nm, 2 * design.torque_limit_Nm]
        )
        assert actuator.gear[0] == 1
        assert actuator.gainprm[0] == 1


def _rotor_inertia(robot, design):
    for leg in LEGS:
        motor, spring = robot.model.joint(f"motor{leg}"), robot.model.joint(f"spring{leg}")
        assert robot.model.dof_armature[motor.dofadr[0]] == design.rotor_inertia_kgm2
        assert robot.model.dof_armature[spring.dofadr[0]] == 0
        # phi = phi_home + motor + spring: both hinges on the proximal body, motor first.
        proximal = robot.model.body(f"proximal{leg}")
        assert proximal.jntadr[0] == motor.id
        assert spring.id == motor.id + 1
        assert proximal.jntnum[0] == 2


def _proximal_mass(robot, design):
    for leg in LEGS:
        assert robot.model.body(f"proximal{leg}").mass[0] == design.proximal_mass_kg


def _proximal_com(robot, design):
    for leg in LEGS:
        com = robot.in_base(robot.data.body(f"proximal{leg}").xipos) - robot.body(f"proximal{leg}")
        along = (robot.body(f"rod{leg}") - robot.body(f"proximal{leg}")) / design.proximal_length_m
        np.testing.assert_allclose(com, design.proximal_com_m * along, rtol=0, atol=1e-12)


def _proximal_inertia(robot, design):
    for leg in LEGS:
        about_axis = robot.inertia_about_axis(f"proximal{leg}", f"motor{leg}")
        assert abs(about_axis - design.proximal_inertia_kgm2) < 1e-12


def _rod_mass(robot, design):
    for leg in LEGS:
        rod = robot.model.body(f"rod{leg}")
        assert rod.mass[0] == design.rod_mass_kg
        # Uniform slender rod: centre of mass in the middle, m l^2 / 12 about both cross axes.
        np.testing.assert_allclose(rod.ipos, [design.rod_length_m / 2, 0, 0], rtol=0, atol=1e-12)
        slender = design.rod_mass_kg * design.rod_length_m**2 / 12
        np.testing.assert_allclose(rod.inertia[1:], slender, rtol=1e-9)
        assert rod.inertia[0] < 1e-3 * slender


def _platform_mass(robot, design):
    assert robot.model.body("platform").mass[0] == design.platform_mass_kg
    # Translates only, so where its centre of mass lies and how it is spread cannot matter to the sensors.
    assert [robot.model.joint(robot.model.body("platform").jntadr[0] + k).type[0] for k in range(3)] == [
        mujoco.mjtJoint.mjJNT_SLIDE
    ] * 3


def _gimbal_mass(body):
    def check(robot, design):
        assert robot.model.body(body).mass[0] == getattr(design, f"{body}_mass_kg")
        np.testing.assert_array_equal(robot.model.body(body).ipos, 0)  # balanced about the wrist centre

    return check


def _gimbal_inertia(body):
    def check(robot, design):
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, robot.model.body(body).iquat)
        R = R.reshape(3, 3)
        inertia = R @ np.diag(robot.model.body(body).inertia) @ R.T
        np.testing.assert_allclose(
            inertia, np.diag(getattr(design, f"{body}_inertia_kgm2")), rtol=0, atol=1e-15
        )

    return check


def _gravity(robot, design):
    np.testing.assert_array_equal(robot.model.opt.gravity, [0, 0, -design.gravity_mps2])


CHECKS = {
    "base_radius_m": _base_radius,
    "platform_radius_m": _platform_radius,
    "proximal_length_m": _proximal_length,
    "rod_length_m": _rod_length,
    "phi_min_rad": _phi_range,
    "phi_max_rad": _phi_range,
    "home_height_m": _home_height,
    "workspace_radius_m": _workspace_radius,
    "gimbal_limit_rad": _gimbal_limit,
    "sea_stiffness_Nm_per_rad": _sea_stiffness,
    "torque_limit_Nm": _torque_limit,
    "rotor_inertia_kgm2": _rotor_inertia,
    "proximal_mass_kg": _proximal_mass,
    "proximal_com_m": _proximal_com,
    "proximal_inertia_kgm2": _proximal_inertia,
    "rod_mass_kg": _rod_mass,
    "platform_mass_kg": _platform_mass,
    "yoke_mass_kg": _gimbal_mass("yoke"),
    "yoke_inertia_kgm2": _gimbal_inertia("yoke"),
    "ring_mass_kg": _gimbal_mass("ring"),
    "ring_inertia_kgm2": _gimbal_inertia("ring"),
    "flange_mass_kg": _gimbal_mass("flange"),
    "flange_inertia_kgm2": _gimbal_inertia("flange"),
    "gravity_mps2": _gravity,
}


def test_every_design_number_has_a_check(design):
    assert sorted(CHECKS) == sorted(design.to_dict())


@pytest.mark.parametrize("key", list(CHECKS))
def test_compiled_model_has_the_design_number(key, robot, design):
    CHECKS[key](robot, design)


def test_rod_constraints_are_stiff(robot):
    """MuJoCo's default softness opens the rods by millimetres, which would read as a sensor error."""
    assert robot.model.neq == len(LEGS)
    for leg in LEGS:
        equality = robot.model.equality(f"rod{leg}")
        np.testing.assert_array_equal(equality.solref, [0.004, 1])
        np.testing.assert_array_equal(equality.solimp[:3], [0.9999, 0.9999, 0.001])


def test_no_damping_or_friction_hides_in_the_joints(robot):
    assert (robot.model.dof_damping == 0).all()
    assert (robot.model.dof_frictionloss == 0).all()
