"""Wrist level against MuJoCo's compiled arm, power, and the joint level that it must equal."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from estimator.delta import forward_kinematics, inverse_kinematics, is_in_reach, leg_geometry
from estimator.errors import InputError
from estimator.estimate import estimate_payload
from estimator.recording import Recording, read_recording, write_recording
from estimator.wrist_level import driven_motion, joints_of, wrist_fault, wrist_of
from mujoco_arm import Arm, random_motion
from omnid_design import DESIGN
from recorded_team import MASS, Sines, carry
from recordings import small_recording

HOME_Z = DESIGN.home_height_m


@pytest.fixture(scope="module")
def arm() -> Arm:
    return Arm()


@pytest.fixture(scope="module")
def weightless() -> Arm:
    """An arm that weighs nothing once it does not move: the springs' torques are all for the wrist."""
    arm = Arm()
    arm.model.opt.gravity[:] = 0.0
    return arm


def anywhere(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Driven angles all over their range and torques up to their limit."""
    rng = np.random.default_rng(seed)
    phi = rng.uniform(DESIGN.phi_min_rad, DESIGN.phi_max_rad, (count, 3))
    return phi, rng.uniform(-DESIGN.torque_limit_Nm, DESIGN.torque_limit_Nm, (count, 3))


# The formulas


@pytest.mark.parametrize("seed", range(10))
def test_the_force_is_mujocos_static_equilibrium(weightless: Arm, seed: int) -> None:
    rng, still = np.random.default_rng(seed), (np.zeros(3), np.zeros(3))
    (phi, *_), (theta, *_) = random_motion(rng)
    weightless.set_motion((phi, *still), (theta, *still), rng)
    weightless.data.qvel[:], weightless.data.qacc[:] = 0.0, 0.0
    f_b = rng.normal(0.0, 30.0, 3)
    tau, _ = weightless.balance(f_b)
    h, force = wrist_of(phi, tau, DESIGN)
    assert force == pytest.approx(f_b, abs=1e-9)
    assert h == pytest.approx(
        weightless.data.site("grasp").xpos - weightless.data.site("base").xpos, abs=1e-12
    )
    back_phi, back_tau = joints_of(h, f_b, DESIGN)
    assert back_phi == pytest.approx(phi, abs=1e-12)
    assert back_tau == pytest.approx(tau, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_power_goes_through_the_wrist_of_mujocos_chain(arm: Arm, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    phi, theta = random_motion(rng)
    arm.set_motion(phi, theta, rng)
    h_dot = arm.site_jacobian("grasp")[0] @ arm.data.qvel
    tau = rng.normal(0.0, 5.0, 3)
    _, force = wrist_of(phi[0], tau, DESIGN)
    assert force @ h_dot == pytest.approx(tau @ phi[1], abs=1e-11)


def test_power_by_finite_differences_all_over_the_joints_range() -> None:
    phi, tau = anywhere(500, seed=1)
    rate = np.random.default_rng(2).normal(size=phi.shape)
    step = 1e-3
    h = [forward_kinematics(phi + k * step * rate, DESIGN) for k in (-2, -1, 1, 2)]
    h_dot = (h[0] - 8 * h[1] + 8 * h[2] - h[3]) / (12 * step)
    power = np.sum(tau * rate, axis=-1)
    assert np.sum(wrist_of(phi, tau, DESIGN)[1] * h_dot, axis=-1) == pytest.approx(power, abs=1e-6)
    assert np.abs(power).max() > 20.0


def test_round_trip() -> None:
    phi, tau = (array.reshape(50, 10, 4, 3) for array in anywhere(2000, seed=3))
    h, force = wrist_of(phi, tau, DESIGN)
    assert h.shape == force.shape == phi.shape
    back_phi, back_tau = joints_of(h, force, DESIGN)
    assert np.abs(back_phi - phi).max() < 1e-12
    assert np.abs(back_tau - tau).max() < 1e-12 * np.abs(force).max()
    assert wrist_of(np.zeros((0, 3)), np.zeros((0, 3)), DESIGN)[0].shape == (0, 3)
    assert joints_of(np.zeros((0, 3)), np.zeros((0, 3)), DESIGN)[1].shape == (0, 3)


def test_driven_motion_of_a_wrist_along_a_path() -> None:
    """By fourth-order differences of inverse kinematics alone."""
    rng = np.random.default_rng(6)
    h = np.array([0.0, 0.0, HOME_Z]) + rng.uniform(-0.07, 0.07, (50, 3))
    velocity, acceleration = rng.normal(0.0, 0.3, h.shape), rng.normal(0.0, 2.0, h.shape)
    step = 1e-3
    phi = [
        inverse_kinematics(h + t * velocity + t**2 / 2 * acceleration, DESIGN)
        for t in step * np.arange(-2, 3)
    ]
    rate, rate_dot = driven_motion(leg_geometry(phi[2], DESIGN), velocity, acceleration)
    assert rate == pytest.approx((phi[0] - 8 * phi[1] + 8 * phi[3] - phi[4]) / (12 * step), abs=1e-8)
    second = (-phi[0] + 16 * phi[1] - 30 * phi[2] + 16 * phi[3] - phi[4]) / (12 * step**2)
    assert rate_dot == pytest.approx(second, abs=1e-6)
    assert np.abs(second).max() > 10.0


# What has no driven angles


def stretched(gap: float) -> np.ndarray:
    """Leg 1 in line up to ``gap`` [m], pointing 110 deg up from outward."""
    axis = np.array([DESIGN.base_radius_m - DESIGN.platform_radius_m, 0.0, 0.0])
    reach = DESIGN.proximal_length_m + DESIGN.rod_length_m - gap
    return axis + reach * np.array([np.cos(np.deg2rad(110.0)), 0.0, np.sin(np.deg2rad(110.0))])


@pytest.mark.parametrize(
    ("h", "words"),
    [
        ([0.0, 0.0, 0.7], "leg 1 cannot reach the wrist position (0, 0, 0.7) m"),
        ([0.0, 0.5, 0.3], "cannot reach the wrist position (0, 0.5, 0.3) m"),
        ([np.nan, 0.0, 0.3], "cannot reach the wrist position (nan, 0, 0.3) m"),
        ([0.0, 0.0, np.inf], "leg 1 cannot reach"),
        ([1e300, 0.0, 0.3], "leg 1 cannot reach"),
        # The wrist on a driven axis: its direction from there is undefined.
        ([DESIGN.base_radius_m - DESIGN.platform_radius_m, 0.0, 0.0], "leg 1 cannot reach"),
        ([0.0, 0.0, -HOME_Z], "lies below the arm"),
        (stretched(1e-12), "the arm is singular at the wrist position"),
    ],
)
def test_wrist_positions_without_driven_angles(h: list[float], words: str) -> None:
    good = np.array([0.0, 0.0, HOME_Z])
    many = np.stack([[good, good], [good, np.array(h)], [np.array(h), good]])
    fault = wrist_fault(many, DESIGN)
    assert fault is not None
    assert fault[0] == (1, 1)
    assert words in fault[1]
    with pytest.raises(InputError) as caught:
        joints_of(many, np.zeros_like(many), DESIGN)
    assert str(caught.value) == fault[1]


def test_only_the_singular_posture_is_refused_not_its_neighbours() -> None:
    h = stretched(1e-5)
    phi, _ = joints_of(h, np.zeros(3), DESIGN)
    assert forward_kinematics(phi, DESIGN) == pytest.approx(h, abs=1e-12)


def test_driven_angles_without_a_wrist_position() -> None:
    short = dataclasses.replace(DESIGN, rod_length_m=0.25)
    with pytest.raises(InputError, match=r"no wrist position reaches .* phi = \(0\.1, 0\.2, 0\.3\) rad"):
        wrist_of([[1.4, 1.4, 1.4], [0.1, 0.2, 0.3]], np.zeros((2, 3)), short)
    with pytest.raises(InputError, match=r"no wrist position .* phi = \(nan, 0\.2, 0\.3\) rad"):
        wrist_of([np.nan, 0.2, 0.3], np.zeros(3), DESIGN)
    with pytest.raises(
        InputError, match=r"a leg is folded past its stretched position at phi = \(3, 0\.6, 0\.6\) rad"
    ):
        wrist_of([3.0, 0.6, 0.6], np.zeros(3), DESIGN)
    long = dataclasses.replace(DESIGN, base_radius_m=0.113, rod_length_m=0.6614)
    with pytest.raises(InputError, match="the wrist lies below the driven axes at phi"):
        wrist_of([2.795, 2.5894, -1.4641], np.zeros(3), long)
    with pytest.raises(InputError, match="the arm is singular at phi"):
        wrist_of(
            inverse_kinematics(stretched(1e-12), DESIGN) - 1e-7 * np.array([1, 0, 0]), np.zeros(3), DESIGN
        )


def test_rods_that_lie_flat_are_singular() -> None:
    """All three in one plane: they cannot carry a load across it."""
    phi = np.full(3, 0.6)
    radius = DESIGN.base_radius_m - DESIGN.platform_radius_m + DESIGN.proximal_length_m * np.cos(0.6)
    for longer, flat in ((1e-12, True), (1e-4, False)):
        design = dataclasses.replace(DESIGN, rod_length_m=radius + longer)
        if flat:
            with pytest.raises(InputError, match=r"the arm is singular at phi = \(0\.6, 0\.6, 0\.6\) rad"):
                wrist_of(phi, np.ones(3), design)
        else:
            assert joints_of(*wrist_of(phi, np.ones(3), design), design)[1] == pytest.approx(np.ones(3))
    exactly = dataclasses.replace(DESIGN, rod_length_m=radius)
    with pytest.raises(InputError, match="the arm is singular at the wrist position"):
        joints_of([0.0, 0.0, DESIGN.proximal_length_m * np.sin(0.6)], np.zeros(3), exactly)


def test_reach_says_which_leg() -> None:
    assert is_in_reach([[0.0, 0.0, HOME_Z], [0.25, 0.0, 0.45]], DESIGN).tolist() == [
        [True] * 3,
        [True, False, False],
    ]


# Files


def at_wrist(recording: Recording) -> Recording:
    return dataclasses.replace(recording, metadata=dataclasses.replace(recording.metadata, level="wrist"))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "trial.parquet"


@pytest.mark.parametrize("ref", [True, False])
def test_the_file_is_the_documented_one(path, ref: bool) -> None:
    recording = at_wrist(small_recording(rows=20, robots=2, ref=ref))
    write_recording(recording, path)
    table = pq.read_table(path)
    of_one = ["h_x", "h_y", "h_z", "theta_z", "theta_y", "theta_x", "force_x", "force_y", "force_z"]
    of_one += ["ref_x", "ref_y", "ref_z"] if ref else []
    assert table.column_names == ["time"] + [f"omnid{i}.{name}" for i in (1, 2) for name in of_one]
    values = json.loads(table.schema.metadata[b"mocobot"])
    assert (values["version"], values["level"]) == (2, "wrist")
    h = np.array([table[f"omnid2.h_{axis}"].to_pylist() for axis in "xyz"]).T
    assert h == pytest.approx(forward_kinematics(recording.phi[:, 1], DESIGN), abs=1e-15)
    read = read_recording(path)
    assert read.metadata == recording.metadata
    assert np.array_equal(read.theta, recording.theta)
    assert read.phi == pytest.approx(recording.phi, abs=1e-12)
    assert read.tau == pytest.approx(recording.tau, abs=1e-10)
    assert (read.ref is not None) == ref


def test_joint_level_may_be_said_in_version_2(path) -> None:
    write_recording(small_recording(rows=20), path)
    table = pq.read_table(path)
    values = json.loads(table.schema.metadata[b"mocobot"]) | {"version": 2, "level": "joint"}
    pq.write_table(table.replace_schema_metadata({"mocobot": json.dumps(values)}), path)
    assert np.array_equal(read_recording(path).phi, small_recording(rows=20).phi)


def spoiled(path, column: str, change) -> str:
    """What is said about a file of 50 rows whose row 7 is changed in one column."""
    write_recording(at_wrist(small_recording(rows=50)), path)
    table = pq.read_table(path)
    values = table[column].to_numpy().copy()
    values[7] = change(values[7])
    table = table.set_column(table.column_names.index(column), column, pa.array(values))
    pq.write_table(table, path)
    with pytest.raises(InputError) as caught:
        read_recording(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message[len(f"{path}: ") :]


@pytest.mark.parametrize(
    ("column", "change", "words"),
    [
        (
            "omnid2.h_z",
            lambda _: 0.7,
            "omnid2.h_x, .h_y, .h_z in row 7: leg 1 cannot reach the wrist position (",
        ),
        ("omnid2.h_z", lambda _: -0.2, "omnid2.h_x, .h_y, .h_z in row 7: the wrist position ("),
        ("omnid3.h_x", lambda _: np.nan, "column 'omnid3.h_x' is nan in 1 of 50 rows, first in row 7"),
        (
            "omnid3.force_x",
            lambda _: np.inf,
            "column 'omnid3.force_x' is inf in 1 of 50 rows, first in row 7",
        ),
        (
            "omnid1.force_z",
            lambda _: 1e4,
            "tau1 of omnid1, which follows from its force_x, force_y, force_z and",
        ),
        ("omnid1.theta_y", lambda _: 1.2, "column 'omnid1.theta_y' reaches 1.2 rad"),
        ("time", lambda _: 0.0, "time goes back in row 7"),
    ],
)
def test_faults_name_the_files_own_columns(path, column: str, change, words: str) -> None:
    assert words in spoiled(path, column, change)


def test_driven_angles_out_of_range_are_said_of_the_position(path) -> None:
    recording = at_wrist(small_recording(rows=20))
    recording.phi[3, 1, 2] = -0.9
    write_recording(recording, path)
    with pytest.raises(
        InputError, match=r"phi3 of omnid2, which follows from its h_x, h_y, h_z, reaches -0\.9 rad"
    ):
        read_recording(path)


def test_millimetres_are_recognised(path) -> None:
    write_recording(at_wrist(small_recording(rows=20)), path)
    table = pq.read_table(path)
    for name in table.column_names:
        if ".h_" in name:
            index = table.column_names.index(name)
            table = table.set_column(index, name, pa.array(1e3 * table[name].to_numpy()))
    pq.write_table(table, path)
    with pytest.raises(InputError, match=r"omnid1.h_x, .h_y, .h_z in row 0: leg .* - .* millimetres$"):
        read_recording(path)


def test_columns_of_the_other_level_are_unknown(path) -> None:
    write_recording(at_wrist(small_recording(rows=20)), path)
    table = pq.read_table(path)
    names = [name.replace("h_x", "phi1") for name in table.column_names]
    pq.write_table(table.rename_columns(names).replace_schema_metadata(table.schema.metadata), path)
    with pytest.raises(
        InputError, match=r"unknown column 'omnid1.phi1'.*; the columns at wrist level are .* h_x"
    ):
        read_recording(path)


def test_what_has_no_wrist_position_is_not_written(path) -> None:
    recording = at_wrist(small_recording(rows=20))
    recording.phi[4, 1] = [3.0, 0.6, 0.6]
    with pytest.raises(
        InputError,
        match=r"recording: omnid2: a leg is folded past its stretched position at phi = \(3, 0\.6, 0\.6\) rad",
    ):
        write_recording(recording, path)
    assert not path.exists()


def test_estimates_are_those_of_the_joint_level(path) -> None:
    """Exact sensors; what differs is the rounding of the conversion, through differences and least squares."""
    rng = np.random.default_rng(4)
    motion = Sines.draw(rng, [0.05, 0.06, 0.04, 0.02, 0.02, 0.02], 20, 0.1, 1.5)
    carried = carry(motion, Sines.draw(rng, [5.0] * 3, 8, 0.1, 1.5), 30.0)
    wrist, joint = at_wrist(carried.recording), carried.recording
    write_recording(wrist, path)
    wrist, joint = estimate_payload([read_recording(path)]), estimate_payload([joint])
    assert wrist.flags == joint.flags
    assert wrist.mass.mass == pytest.approx(joint.mass.mass, rel=1e-9)
    assert wrist.p_1c == pytest.approx(joint.p_1c, abs=1e-9)
    assert wrist.grasps.p_1i == pytest.approx(joint.grasps.p_1i, abs=1e-9)
    assert wrist.inertia.inertia == pytest.approx(joint.inertia.inertia, abs=1e-7)
    assert joint.mass.mass == pytest.approx(MASS, rel=1e-3)
