"""Robots that hold nothing: their springs carry the arm and nothing else, whatever the arm weighs."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from effect_cases import example
from estimator.arm.design import OmnidDesign
from estimator.arm.dynamics import arm_torque
from estimator.arm.unit import AT, COUNT, ArmUnit
from estimator.arm.unit import Arms as Arm
from estimator.errors import InputError
from mocobot_sim.control.control import home_phi
from mocobot_sim.effects import EFFECTS, apply_effects
from mocobot_sim.scene.as_built import AsBuilt, CalibrationSpread
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.scene.scene import build_free_team
from mocobot_sim.scene.team_index import TeamIndex
from mocobot_sim.trial.assemble import assemble_at_home, close
from mocobot_sim.trial.resimulate import resimulate
from mocobot_sim.trial.sensors import PRESETS
from mocobot_sim.trial.simulate import TrialRequest, draw_units, simulate
from mocobot_sim.trial.trajectories import RATE_HZ, SETTLE_S, free_motion
from mocobot_sim.trial.trial import run_trial
from mocobot_sim.trial.trial_log import TrialLog

DESIGN = omnid_design()
HOME = np.array([[0.0, 0.0, DESIGN.home_height_m]])
ON_PAYLOAD = {"grasp_flex", "grasp_play", "tether", "payload_tether", "push", "drag", "slosh", "payload_mass"}
HEAVIER = {"proximal": 0.10, "rod": -0.08, "wrist": 0.06}


def unit(proximal: float, rod: float, wrist: float) -> AsBuilt:
    """Masses off alike in all legs, as a design can say them, too."""
    return AsBuilt(
        proximal_mass_ratio=np.full(3, proximal), rod_mass_ratio=np.full(3, rod), wrist_mass_ratio=wrist
    )


def design_of(proximal: float, rod: float, wrist: float) -> OmnidDesign:
    return replace(
        DESIGN,
        proximal_mass_kg=DESIGN.proximal_mass_kg * (1.0 + proximal),
        proximal_inertia_kgm2=DESIGN.proximal_inertia_kgm2 * (1.0 + proximal),
        rod_mass_kg=DESIGN.rod_mass_kg * (1.0 + rod),
        **{
            f"{part}_mass_kg": getattr(DESIGN, f"{part}_mass_kg") * (1.0 + wrist)
            for part in ("platform", "yoke", "ring", "flange")
        },
    )


def residual(log: TrialLog, design: Arm) -> np.ndarray:
    """Spring torques less inverse dynamics, at the control rate, once the arm has left home [N m], (T, N, 3)."""
    rate, phi = log.sensed.rate_hz, log.sensed.phi
    phi_dot = (phi[2:] - phi[:-2]) * rate / 2.0
    phi_ddot = (phi[2:] - 2.0 * phi[1:-1] + phi[:-2]) * rate**2
    start = round(SETTLE_S * rate)
    return (log.sensed.tau[1:-1] - arm_torque(phi[1:-1], phi_dot, phi_ddot, design))[start:]


@pytest.fixture(scope="module")
def trials() -> dict[str, TrialLog]:
    """One arm as designed and one with other masses, on the same way: one hold and four vias."""
    trajectory = free_motion(HOME, np.random.default_rng(4), vias=4)
    return {
        "design": run_trial(build_free_team(1, theta=[[0.2, -0.1, 0.3]]), trajectory),
        "heavier": run_trial(build_free_team(1, [unit(**HEAVIER)]), trajectory),
    }


def test_springs_carry_the_arm_and_nothing_else(trials: dict[str, TrialLog]) -> None:
    """Inverse dynamics of the estimator, derivation of its own, against MuJoCo's spring torques in closed loop."""
    error = residual(trials["design"], DESIGN)
    inertial = trials["design"].tau - arm_torque(trials["design"].phi, *[np.zeros(3)] * 2, DESIGN)
    assert np.abs(inertial).max() > 0.3, "the motion is fast enough to show inertia"
    # Measured: 1.4e-5 rms, 1.0e-4 at most (2.3e-4 in a default trial of 109 s).
    assert np.sqrt(np.mean(error**2)) < 3e-5
    assert np.abs(error).max() < 3e-4


def test_other_masses_show_in_the_springs_as_they_should(trials: dict[str, TrialLog]) -> None:
    error = residual(trials["heavier"], design_of(**HEAVIER))
    assert np.sqrt(np.mean(error**2)) < 3e-5
    assert np.abs(error).max() < 3e-4
    for part in HEAVIER:  # each of the three is needed
        partly = design_of(**(HEAVIER | {part: 0.0}))
        assert np.sqrt(np.mean(residual(trials["heavier"], partly) ** 2)) > 0.01, part


def test_masses_springs_and_lengths_of_every_leg_show_as_an_arm_as_it_is_has_them() -> None:
    spread = CalibrationSpread(stiffness_ratio=0.02, geometry_m=1e-3, arm_mass_ratio=0.05)
    built = spread.draw(1, np.random.default_rng(3))[0]
    x = np.zeros(COUNT)
    for name in ("stiffness_ratio", "proximal_mass_ratio", "rod_mass_ratio", "wrist_mass_ratio"):
        x[AT[name]] = getattr(built, name)
    x[AT["radius"]] = built.base_radius_m - built.platform_radius_m
    x[AT["proximal_length"]], x[AT["rod_length"]] = built.proximal_length_m, built.rod_length_m
    arm = ArmUnit(DESIGN, x)
    log = run_trial(build_free_team(1, [built]), free_motion(HOME, np.random.default_rng(4), vias=2))
    # A reading is the design's stiffness times the deflection.
    error = residual(replace(log, sensed=replace(log.sensed, tau=arm.true_tau(log.sensed.tau))), arm)
    assert np.sqrt(np.mean(error**2)) < 3e-5
    assert np.abs(error).max() < 3e-4
    assert np.sqrt(np.mean(residual(log, DESIGN) ** 2)) > 0.01


def test_weight_of_every_part_by_virtual_work() -> None:
    """Static torques with masses off leg by leg: MuJoCo's rest against m g dz/dphi of its own closed loops."""
    masses = AsBuilt(
        proximal_mass_ratio=np.array([0.1, -0.05, 0.2]),
        rod_mass_ratio=np.array([-0.2, 0.15, 0.05]),
        wrist_mass_ratio=-0.12,
    )
    phi = np.array([[0.75, 0.5, 0.6]])
    initial = (phi, np.array([[0.1, 0.4, -0.2]]))
    torque = {}
    for name, units in (("design", ()), ("built", [masses])):
        scene = replace(build_free_team(1, units), initial=initial)
        model = scene.compile()
        data = mujoco.MjData(model)
        torque[name] = assemble_at_home(scene, model, data, TeamIndex.of(model, scene.carries))[0]
    model = build_free_team(1).compile()
    ratios = {f"proximal{k + 1}": masses.proximal_mass_ratio[k] for k in range(3)}
    ratios |= {f"rod{k + 1}": masses.rod_mass_ratio[k] for k in range(3)}
    ratios |= dict.fromkeys(("platform", "yoke", "ring", "flange"), masses.wrist_mass_ratio)
    ids = np.array([model.body(f"omnid1/{name}").id for name in ratios])
    extra = model.body_mass[ids] * np.array(list(ratios.values()))

    def height_of_mass(angles: np.ndarray) -> float:
        """Sum of m z over what is added, with the loops closed at these driven angles [kg m]."""
        data, index = mujoco.MjData(model), TeamIndex.of(model, False)
        data.qpos[index.motor_qpos] = angles - home_phi(DESIGN)
        dofs = np.concatenate([index.knee_dof.ravel(), index.slide_dof.ravel()])
        assert close(model, data, dofs) < 1e-12
        return float(extra @ data.xipos[ids, 2])

    step = 1e-5
    work = [(height_of_mass(phi + d) - height_of_mass(phi - d)) / (2 * step) for d in step * np.eye(3)]
    np.testing.assert_allclose(torque["built"] - torque["design"], 9.81 * np.array(work), atol=1e-7)
    assert np.abs(torque["built"] - torque["design"]).min() > 0.01
    np.testing.assert_allclose(
        torque["design"], arm_torque(phi[0], np.zeros(3), np.zeros(3), DESIGN), atol=1e-9
    )


def test_gimbals_stay_as_they_were_left(trials: dict[str, TrialLog]) -> None:
    log = trials["design"]
    np.testing.assert_allclose(log.theta, np.broadcast_to([0.2, -0.1, 0.3], log.theta.shape), atol=1e-9)
    assert not log.feed_forward.any()
    assert log.weld_error_m == log.weld_error_rad == 0.0
    np.testing.assert_allclose(log.R_W1 - log.R_W1[0], 0.0, atol=1e-9)


def test_the_units_are_those_of_the_seeds_carrying_trials() -> None:
    preset = PRESETS["uncalibrated"]
    done = simulate(TrialRequest("c", "free", seed=5, vias=1, robots=2), [preset])
    for one, other in zip(done.truth.units, draw_units("c", preset, 5)[:2], strict=True):
        assert one.to_dict() == other.to_dict()
    assert np.any(done.truth.units[0].phi_zero_rad)
    assert set(done.truth.to_dict()) == {"as_built", "effects", "control"}
    recording = done.recordings["uncalibrated"]
    metadata = recording.metadata
    assert (metadata.trial, metadata.payload, metadata.robots, metadata.seed) == ("free", None, 2, 5)
    # Zeros and springs act on what is read, as in every trial.
    expected = done.log.phi + np.array([u.phi_zero_rad for u in done.truth.units])
    assert 1e-5 < np.abs(recording.phi - expected).max() < 1e-4
    again = resimulate(recording, build_free_team(2, done.truth.units))
    late = slice(round(SETTLE_S * RATE_HZ), None)
    np.testing.assert_allclose(again.tau[late], done.log.tau[late], atol=1e-6)


def test_masses_change_mass_and_inertia_together_and_nothing_else() -> None:
    before = build_free_team(2).compile()
    after = build_free_team(2, [AsBuilt(), unit(**HEAVIER)]).compile()
    wrist = dict.fromkeys(("platform", "yoke", "ring", "flange"), 1.06)
    scale = {"proximal1": 1.10, "rod3": 0.92, "base": 1.0} | wrist
    for name, factor in scale.items():
        for robot, by in ((1, 1.0), (2, factor)):
            body = before.body(f"omnid{robot}/{name}").id
            assert after.body_mass[body] == pytest.approx(by * before.body_mass[body], rel=1e-12)
            np.testing.assert_allclose(after.body_inertia[body], by * before.body_inertia[body], rtol=1e-9)
    for name in ("body_ipos", "body_pos", "body_quat", "dof_armature", "jnt_stiffness"):
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name), err_msg=name)


@pytest.mark.parametrize("cause", EFFECTS)
def test_effects_on_a_payload_are_refused(cause: str) -> None:
    team = build_free_team(1)
    if cause in ON_PAYLOAD:
        with pytest.raises(
            InputError, match=f"{cause}: acts on a payload; robots of a free trial hold nothing"
        ):
            apply_effects(team, [example(cause)])
    else:
        assert apply_effects(team, [example(cause)]).compile().nv >= 18


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: build_free_team(0), "robots is 0; it must be at least 1 and at most 100"),
        (lambda: build_free_team(2, [AsBuilt()]), "as_built has 1 units"),
        (lambda: build_free_team(1, theta=[[0.0, 0.0, 1.1]]), "theta is not 1 x 3 angles of at most 1 rad"),
        (lambda: build_free_team(1, theta=[[0.0, 0.0, np.nan]]), "theta is not 1 x 3 angles"),
        (
            lambda: simulate(TrialRequest("a", "random", robots=2), [PRESETS["ideal"]]),
            "robots is for a free trial; a random one has a robot for each grasp",
        ),
        (
            lambda: simulate(TrialRequest("a", "free"), [PRESETS["ideal"]], scene=build_free_team(1)),
            "a model carries a payload; robots of a free trial hold nothing",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(make, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        make()
