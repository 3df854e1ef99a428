"""The composed team and its ground truth, read back from the compiled MuJoCo model."""

import dataclasses
import json
import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from closed_loop import BASE_HEIGHT_M, ClosedLoop
from estimator.errors import InputError
from mocobot_sim.paper.scoring import payload_truth
from mocobot_sim.scene.as_built import AsBuilt, CalibrationSpread
from mocobot_sim.scene.models import omnid_design, payload_path
from mocobot_sim.scene.scene import build_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.truth import GroundTruth, truth_path, write_truth
from payload_mjcf import FIVE, ONE, TEAMS, TWO

OMNID_XML = Path(__file__).parents[3] / "models" / "omnid" / "omnid.xml"
SHIPPED = ("a", "b", "c", "d")
RADIAN = '<compiler angle="radian"/>'
INERTIAL = '<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/>'
BASE_JOINTS = {"base_x", "base_y", "base_yaw"} | {
    f"wheel_{end}_{side}" for end in ("front", "rear") for side in ("left", "right")
}


def _joints(model: mujoco.MjModel) -> list[str]:
    return [model.joint(j).name for j in range(model.njnt)]


def _state(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_one_parked_omnid_per_grasp(teams, robots):
    scene = teams[robots]
    model = scene.compile()
    assert scene.robots == TeamIndex.of(model).robots == robots
    alone = _joints(mujoco.MjModel.from_xml_path(str(OMNID_XML)))
    assert set(alone) >= BASE_JOINTS, "the model itself can roll"
    parked = [name for name in alone if name not in BASE_JOINTS]
    assert sorted(_joints(model)) == sorted(f"omnid{i + 1}/{name}" for i in range(robots) for name in parked)
    assert model.nv == model.nq == 18 * robots
    assert model.neq == 3 * robots + robots - 1
    assert model.nu == 3 * robots


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_flanges_hold_the_grasps_the_payload_file_asks_for(teams, robots):
    loop = ClosedLoop(teams[robots])
    site = loop.data.site
    R_W1 = site("omnid1/grasp").xmat.reshape(3, 3)
    for i, grasp in enumerate(TEAMS[robots].grasps, start=1):
        flange, held = site(f"omnid{i}/grasp"), site(f"omnid1/payload/grasp{i}")
        np.testing.assert_allclose(flange.xpos, held.xpos, rtol=0, atol=1e-12)
        np.testing.assert_allclose(flange.xmat, held.xmat, rtol=0, atol=1e-12)
        p_1i = R_W1.T @ (flange.xpos - site("omnid1/grasp").xpos)
        np.testing.assert_allclose(p_1i, grasp.position, rtol=0, atol=1e-12)
        R_1i = R_W1.T @ flange.xmat.reshape(3, 3)
        np.testing.assert_allclose(R_1i, grasp.pose().rotation.as_matrix(), rtol=0, atol=1e-12)
        X_1i = teams[robots].X_1i[i - 1]
        np.testing.assert_allclose(X_1i.as_matrix(), grasp.pose().as_matrix(), rtol=0, atol=1e-12)


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_bases_stand_on_one_floor_under_their_grasps_and_gimbals_start_unturned(teams, robots):
    loop = ClosedLoop(teams[robots])
    for i in range(1, robots + 1):
        base, chassis = loop.data.body(f"omnid{i}/base"), loop.data.body(f"omnid{i}/chassis")
        grasp = loop.data.site(f"omnid{i}/grasp")
        assert abs(chassis.xpos[2]) < 1e-12
        assert abs(base.xpos[2] - BASE_HEIGHT_M) < 1e-12
        np.testing.assert_allclose(base.xmat.reshape(3, 3)[:, 2], [0, 0, 1], rtol=0, atol=1e-12)
        np.testing.assert_allclose(base.xpos[:2], grasp.xpos[:2], rtol=0, atol=1e-12)
        assert abs(loop.data.joint(f"omnid{i}/gimbal_z").qpos[0]) < 1e-12
    np.testing.assert_allclose(loop.wrist(), teams[robots].wrist_home_b, rtol=0, atol=1e-12)


def test_heights_of_payload_d_spread_around_home():
    """Its second grasp is 38 mm below the other two."""
    scene = build_team("d")
    loop = ClosedLoop(scene)
    expected = 0.355 + np.array([1, -2, 1]) * 0.038 / 3
    np.testing.assert_allclose(loop.wrist()[:, 2], expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(loop.wrist()[:, :2], 0, rtol=0, atol=1e-12)
    floor = [loop.data.body(f"omnid{i}/chassis").xpos[2] for i in (1, 2, 3)]
    np.testing.assert_allclose(floor, 0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", SHIPPED)
def test_team_weighs_robots_plus_payload(name):
    model = build_team(name).compile()
    alone = mujoco.MjModel.from_xml_path(str(OMNID_XML)).body_mass.sum()
    payload = mujoco.MjModel.from_xml_path(str(payload_path(name))).body_mass.sum()
    np.testing.assert_allclose(model.body_mass.sum(), 3 * alone + payload, rtol=1e-14)


def test_xml_loads_in_plain_mujoco(teams, tmp_path):
    path = tmp_path / "team.xml"
    path.write_text(teams[5].to_xml(), encoding="utf-8")
    plain, ours = mujoco.MjModel.from_xml_path(str(path)), teams[5].compile()
    np.testing.assert_array_equal(plain.body_mass, ours.body_mass)
    np.testing.assert_array_equal(plain.body_pos, ours.body_pos)
    np.testing.assert_array_equal(plain.eq_solref, ours.eq_solref)


def test_every_equality_is_stiff(teams):
    """MuJoCo's default softness opens the rods by millimetres."""
    model = teams[5].compile()
    assert model.neq == 19
    np.testing.assert_array_equal(model.eq_solref, np.tile([0.004, 1.0], (19, 1)))
    np.testing.assert_array_equal(model.eq_solimp[:, :2], 0.9999)


def _lengths(model: mujoco.MjModel, robot: int) -> dict[str, np.ndarray]:
    """Measured in the model, whatever its constraints say."""
    data = _state(model)
    body = [
        {name: data.body(f"omnid{robot}/{name}{k}").xpos for name in ("proximal", "rod")} for k in (1, 2, 3)
    ]
    base, platform = data.body(f"omnid{robot}/base").xpos, data.body(f"omnid{robot}/platform").xpos
    norm = np.linalg.norm
    tip = [data.site(f"omnid{robot}/rod{k}_tip").xpos for k in (1, 2, 3)]
    joint = [data.site(f"omnid{robot}/platform{k}").xpos for k in (1, 2, 3)]
    return {
        "base_radius_m": np.array([norm(leg["proximal"] - base) for leg in body]),
        "proximal_length_m": np.array([norm(leg["rod"] - leg["proximal"]) for leg in body]),
        "rod_length_m": np.array([norm(end - leg["rod"]) for end, leg in zip(tip, body, strict=True)]),
        "platform_radius_m": np.array([norm(end - platform) for end in joint]),
        "stiffness": np.array([model.joint(f"omnid{robot}/spring{k}").stiffness[0] for k in (1, 2, 3)]),
    }


def test_deviations_change_what_they_should_and_nothing_else(tmp_path):
    path = TWO.write(tmp_path)
    unit = CalibrationSpread(0.02, 0.03, 1e-3, 0.05).draw(1, np.random.default_rng(5))[0]
    nominal = build_team(path).compile()
    built = build_team(path, [AsBuilt(), unit]).compile()
    before, after = _lengths(nominal, 2), _lengths(built, 2)
    for name in ("base_radius_m", "proximal_length_m", "rod_length_m", "platform_radius_m"):
        assert np.abs(getattr(unit, name)).min() > 1e-6
        np.testing.assert_allclose(after[name] - before[name], getattr(unit, name), rtol=0, atol=1e-14)
    np.testing.assert_allclose(after["stiffness"], 100.0 * (1.0 + unit.stiffness_ratio), rtol=1e-14)
    for name, values in _lengths(nominal, 1).items():
        np.testing.assert_array_equal(values, _lengths(built, 1)[name])
    for name in ("body_mass", "dof_armature", "jnt_axis", "eq_solref", "body_quat"):
        np.testing.assert_array_equal(getattr(nominal, name), getattr(built, name), err_msg=name)
    # Rods stay uniform: the centre in the middle, m l^2 / 12 about it.
    rods = [built.body(f"omnid2/rod{k + 1}").id for k in range(3)]
    others = np.setdiff1d(np.arange(built.nbody), rods)
    for name in ("body_inertia", "body_ipos"):
        np.testing.assert_array_equal(
            getattr(nominal, name)[others], getattr(built, name)[others], err_msg=name
        )
    design, lengths = omnid_design(), after["rod_length_m"]
    np.testing.assert_allclose(built.body_ipos[rods, 0], lengths / 2, rtol=1e-14)
    across = np.sort(built.body_inertia[rods], axis=1)[:, 1:]
    np.testing.assert_allclose(
        across, np.tile(design.rod_mass_kg * lengths[:, None] ** 2 / 12, 2), rtol=1e-12
    )
    # The legs stay in their planes: the deviations are along the links.
    data = _state(built)
    R_Wb = data.body("omnid2/base").xmat.reshape(3, 3)
    for k in range(3):
        azimuth = 2 * np.pi * k / 3
        normal = R_Wb @ [-np.sin(azimuth), np.cos(azimuth), 0.0]
        for point in (data.body(f"omnid2/rod{k + 1}").xpos, data.site(f"omnid2/platform{k + 1}").xpos):
            assert abs(normal @ (point - data.body("omnid2/base").xpos)) < 1e-14


def test_drawn_units_have_the_stated_spread_and_do_not_depend_on_the_teams_size():
    spread = CalibrationSpread(encoder_zero_rad=0.1, stiffness_ratio=0.2, geometry_m=0.3, tau_zero_Nm=0.4)
    units = spread.draw(2000, np.random.default_rng(11))
    expected = {
        "base_radius_m": 0.3, "proximal_length_m": 0.3, "rod_length_m": 0.3, "platform_radius_m": 0.3,
        "stiffness_ratio": 0.2, "phi_zero_rad": 0.1, "theta_zero_rad": 0.1, "tau_zero_Nm": 0.4,
    }  # fmt: skip
    masses = {"proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio"}  # see test_free
    assert set(expected) | masses == {entry.name for entry in dataclasses.fields(AsBuilt)}
    assert not any(np.any(getattr(units[0], name)) for name in masses)
    drawn = {name: np.array([getattr(unit, name) for unit in units]) for name in expected}
    for name, sigma in expected.items():
        # 6000 draws: the standard deviation is good to 0.9 %, the mean to 1.3 % of it (4.5 sigma below).
        assert abs(drawn[name].std() / sigma - 1) < 0.042, name
        assert abs(drawn[name].mean() / sigma) < 0.06, name
    correlation = np.corrcoef(np.hstack([drawn[name] for name in expected]).T)
    assert np.abs(correlation - np.eye(24)).max() < 0.12
    first = spread.draw(1, np.random.default_rng(11))[0]
    np.testing.assert_array_equal(first.phi_zero_rad, units[0].phi_zero_rad)
    assert not np.any(
        [getattr(CalibrationSpread().draw(1, np.random.default_rng(1))[0], n) for n in expected]
    )


def _write(folder: Path, text: str) -> Path:
    path = folder / "bad.xml"
    path.write_text(text, encoding="utf-8")
    return path


def _payload(body: str, compiler: str = RADIAN, extra: str = "") -> str:
    return f"<mujoco>{compiler}{extra}<worldbody>{body}</worldbody></mujoco>"


GRASP1 = '<site name="grasp1"/>'
LOAD = f'<body name="payload">{INERTIAL}{GRASP1}'
BAD = {
    "not xml": ("hello", "bad.xml: not a readable MJCF"),
    "empty": ("", "bad.xml: not a readable MJCF"),
    "no text": ("<mujoco>\0</mujoco>", "bad.xml: not a readable MJCF .*line 1"),
    "two lines": ("<mujoco><!-- one\ntwo -- three --></mujoco>", "bad.xml: not a readable MJCF .* one two"),
    "unprintable": ("<mujoco><!-- \x7f -- three --></mujoco>", r"bad.xml: not a readable MJCF .*\\x7f"),
    "not mjcf": ("<robot/>", "bad.xml: not a readable MJCF"),
    "attribute": (_payload('<body name="payload" mood="1"/>'), "bad.xml: not a readable MJCF .*mood"),
    "degree": (_payload("", '<compiler angle="degree"/>'), 'compiler angle is degree; it must be "radian"'),
    "default": (_payload("", ""), 'compiler angle is degree; it must be "radian"'),
    "compiler": (
        _payload("", '<compiler angle="radian" settotalmass="5"/>'),
        "'settotalmass' would act on the robots too",
    ),
    "physics": (
        _payload(f'<body name="payload"><inertial pos="0 0 0" mass="1" diaginertia="1 1 5"/>{GRASP1}</body>'),
        "MuJoCo cannot compile the payload",
    ),
    "no grasp": (_payload(f'<body name="payload">{INERTIAL}</body>'), "no site 'grasp1'; it needs grasp1"),
    "gap": (
        _payload(f'<body name="payload">{INERTIAL}{GRASP1}<site name="grasp3" pos="1 0 0"/></body>'),
        "no site 'grasp2'",
    ),
    "no body": (_payload(f'<body name="load">{INERTIAL}{GRASP1}</body>'), "no body 'payload'"),
    "grasp off origin": (
        _payload(f'<body name="payload">{INERTIAL}<site name="grasp1" pos="0.1 0 0"/></body>'),
        "site 'grasp1' must be at the origin",
    ),
    "body off origin": (
        _payload(f'<body name="payload" pos="0 0 0.05">{INERTIAL}{GRASP1}</body>'),
        "site 'grasp1' must be at the origin",
    ),
    "turned": (
        _payload(f'<body name="payload" quat="1 0 0 0.1">{INERTIAL}{GRASP1}</body>'),
        "site 'grasp1' must be at the origin",
    ),
    "joint": (_payload(f'<body name="payload"><freejoint/>{INERTIAL}{GRASP1}</body>'), "it must be rigid"),
    "massless": (_payload(f'<body name="payload">{GRASP1}</body>'), "weighs 0 kg of 0 kg"),
    "second mass": (
        _payload(f'<body name="payload">{INERTIAL}{GRASP1}<body pos="0 0 -0.2">{INERTIAL}</body></body>'),
        "weighs 1 kg of 2 kg",
    ),
    "visual": (
        _payload(f"{LOAD}</body>", extra='<visual><global offwidth="7"/></visual>'),
        "does not fit into the team's scene .*offwidth",
    ),
    "gravity": (_payload(f"{LOAD}</body>", extra='<option gravity="0 0 -1"/>'), "<option> would act on the"),
    "flag": (
        _payload(f"{LOAD}</body>", extra='<option><flag gravity="disable"/></option>'),
        "<option> would act on the whole team",
    ),
    "wind": (
        _payload(f"{LOAD}</body>", extra='<option wind="9 0 0" density="1"/>'),
        "<option> would act on the",
    ),
    "weld to the world": (
        _payload(f"{LOAD}</body>", extra='<equality><weld body1="payload"/></equality>'),
        "<equality> would act on the whole team",
    ),
    "memory": (_payload(f"{LOAD}</body>", extra='<size memory="1K"/>'), "<size> would act on the whole team"),
    "weightless": (
        _payload(f'<body name="payload" gravcomp="1">{INERTIAL}{GRASP1}</body>'),
        "no mocap, no gravcomp",
    ),
    "mocap": (
        _payload(f'<body name="payload" mocap="true">{INERTIAL}{GRASP1}</body>'),
        "no mocap, no gravcomp",
    ),
    "mass in the world": (
        _payload(f'{LOAD}</body><geom size="0.1" mass="5"/>'),
        "a geom stands in the world",
    ),
    "nan": (
        _payload(f'{LOAD}<site name="grasp2" pos="nan 0 0"/></body>'),
        "every number must be a finite one",
    ),
    "infinite mass": (
        _payload(f"{LOAD}</body>".replace('mass="1"', 'mass="inf"')),
        "not finite",
    ),
    "tilted": (
        _payload(f'{LOAD}<site name="grasp2" pos="1 0 0" euler="0 1.5 0"/></body>'),
        r"grasp2 asks for gimbal angles \(y, x\) of \(85\.9, 0\.0\) deg at home; the gimbal ends at 57\.3",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_payload_is_refused_in_one_sentence(tmp_path, case):
    text, sentence = BAD[case]
    with pytest.raises(InputError, match=sentence) as caught:
        build_team(_write(tmp_path, text))
    assert "bad.xml" in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_team_that_does_not_compile_is_refused_in_one_sentence(tmp_path):
    plane = _payload(f'{LOAD}<body><geom type="plane" size="1 1 1"/></body></body>')
    with pytest.raises(InputError, match=r"MuJoCo cannot compile the team .*plane") as caught:
        build_team(_write(tmp_path, plane)).compile()
    assert "\n" not in str(caught.value)


def test_what_does_not_exist_is_named(tmp_path):
    with pytest.raises(InputError, match=r"payload 'z' does not exist; the payloads are a, b, c, d"):
        build_team("z")
    with pytest.raises(InputError, match=r"nowhere\.xml: not a readable MJCF"):
        build_team(tmp_path / "nowhere.xml")


@pytest.mark.parametrize("units", [1, 2, 4])
def test_wrong_number_of_units_is_refused(units):
    with pytest.raises(InputError, match=f"as_built has {units} units; the payload has 3 grasps"):
        build_team("a", [AsBuilt()] * units)


def test_a_path_works_like_a_name():
    assert build_team(payload_path("b")).to_xml() == build_team("b").to_xml()


def test_models_say_what_is_missing(teams):
    with pytest.raises(KeyError):
        TeamIndex.of(mujoco.MjModel.from_xml_string(teams[2].to_xml().replace("motor2", "engine2")))


@pytest.mark.parametrize(("setting", "before"), [(None, "sys.modules['OpenGL'] = None"), ("egl", "")])
def test_import_needs_no_renderer_and_leaves_the_choice_alone(setting, before):
    """A machine without a display or EGL can compose; a program that renders keeps its own setting."""
    code = (
        f"import os, sys; {before}\n"
        "from mocobot_sim.scene.scene import build_team\n"
        "print(build_team('a').compile().nv, os.environ.get('MUJOCO_GL'))"
    )
    environment = {k: v for k, v in os.environ.items() if k not in ("MUJOCO_GL", "DISPLAY")}
    environment |= {"MUJOCO_GL": setting} if setting else {}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout.split() == ["54", str(setting)], done.stderr


def test_tilted_and_turned_grasps_compile_from_any_orientation_attribute(tmp_path):
    text = ONE.xml().replace("</body>", '<site name="grasp2" pos="1 0 0" euler="0.1 -0.05 0.7"/></body>')
    scene = build_team(_write(tmp_path, text))
    # MuJoCo's default euler sequence is intrinsic xyz: R = Rx Ry Rz.
    a, b, c = 0.1, -0.05, 0.7
    Rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    Rz = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    np.testing.assert_allclose(scene.X_1i[1].rotation.as_matrix(), Rx @ Ry @ Rz, rtol=0, atol=1e-12)


EACH = pytest.mark.parametrize("name", list("abcd"))


@pytest.fixture(scope="module")
def truths() -> dict[str, GroundTruth]:
    return {name: GroundTruth.of(build_team(name)) for name in "abcd"}


@EACH
def test_the_truth_is_table_one(truths, name):
    truth, printed = truths[name], payload_truth(name)
    np.testing.assert_allclose(truth.R_1i, printed.R_1i, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.p_1i, printed.p_1i, rtol=0, atol=1e-12)
    assert truth.mass_kg == printed.mass
    np.testing.assert_allclose(truth.p_1c, printed.p_1c, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.principal_kgm2, printed.principal_moments, rtol=1e-12)
    np.testing.assert_allclose(truth.R_1c, printed.R_1c, rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(truth.R_1c), 1.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    "moments", [(0.08, 0.05, 0.06), (0.06, 0.08, 0.05), (0.05, 0.08, 0.06), (0.08, 0.06, 0.05)]
)
def test_moments_come_ascending_with_their_axes(tmp_path, moments):
    payload = dataclasses.replace(ONE, inertia_kgm2=moments)
    truth = GroundTruth.of(build_team(payload.write(tmp_path)))
    np.testing.assert_allclose(truth.principal_kgm2, (0.05, 0.06, 0.08), rtol=1e-12)
    assert abs(np.linalg.det(truth.R_1c) - 1) < 1e-12
    whole = truth.R_1c @ np.diag(truth.principal_kgm2) @ truth.R_1c.T
    np.testing.assert_allclose(whole, np.diag(moments), rtol=0, atol=1e-12)


@pytest.mark.parametrize("robots", [1, 2, 5])
def test_any_number_of_grasps(teams, robots):
    truth = GroundTruth.of(teams[robots])
    payload = TEAMS[robots]
    np.testing.assert_allclose(truth.p_1i, [grasp.position for grasp in payload.grasps], rtol=0, atol=1e-12)
    R_1i = [grasp.pose().rotation.as_matrix() for grasp in payload.grasps]
    np.testing.assert_allclose(truth.R_1i, R_1i, rtol=0, atol=1e-12)
    assert truth.mass_kg == payload.mass_kg
    np.testing.assert_allclose(truth.p_1c, payload.com_m, rtol=0, atol=1e-12)
    np.testing.assert_allclose(truth.principal_kgm2, payload.inertia_kgm2, rtol=1e-12)


def test_as_built_robots_carry_the_same_payload(truths):
    units = CalibrationSpread(0.02, 0.02, 1e-3, 0.02).draw(3, np.random.default_rng(0))
    other = GroundTruth.of(build_team("d", units))
    assert other.units == units
    for entry in dataclasses.fields(GroundTruth)[:6]:
        np.testing.assert_allclose(
            getattr(other, entry.name), getattr(truths["d"], entry.name), rtol=0, atol=1e-12
        )


def test_sidecar_holds_the_truth_in_plain_json(tmp_path):
    units = CalibrationSpread(0.02, 0.02, 1e-3, 0.02).draw(5, np.random.default_rng(0))
    truth = GroundTruth.of(build_team(FIVE.write(tmp_path), units))
    recording = tmp_path / "rec.parquet"
    write_truth(truth, recording)
    assert truth_path(recording) == tmp_path / "rec.truth.json"
    values = json.loads((tmp_path / "rec.truth.json").read_text(encoding="utf-8"))
    assert values["mass_kg"] == 16.0
    np.testing.assert_allclose(values["p_1c_m"], FIVE.com_m, rtol=0, atol=1e-12)
    np.testing.assert_allclose(values["principal_inertia_kgm2"], FIVE.inertia_kgm2, rtol=1e-12)
    np.testing.assert_allclose(values["R_1c_rotvec_deg"], 0, atol=1e-9)
    assert len(values["grasps"]) == 5
    for entry, grasp in zip(values["grasps"], FIVE.grasps, strict=True):
        np.testing.assert_allclose(entry["p_1i_m"], grasp.position, rtol=0, atol=1e-12)
        turn = Rotation.from_rotvec(entry["R_1i_rotvec_deg"], degrees=True)
        assert (turn.inv() * grasp.pose().rotation).magnitude() < 1e-12
    assert len(values["as_built"]) == 5
    for entry, unit in zip(values["as_built"], units, strict=True):
        assert entry == {f.name: np.asarray(getattr(unit, f.name)).tolist() for f in dataclasses.fields(unit)}


def test_sidecar_that_cannot_be_written_is_refused(tmp_path, truths):
    (tmp_path / "rec.truth.json").mkdir()
    with pytest.raises(InputError, match=r"rec\.truth\.json: cannot be written"):
        write_truth(truths["a"], tmp_path / "rec.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["rec.truth.json"]
