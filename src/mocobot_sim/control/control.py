"""Wrist impedance control of a team with an inner SEA torque loop, and the stability of the closed loop.

Each robot uses only the readings of its own joint sensors (with their calibration errors) and the design geometry. Per
robot, at the control rate:

    F     = K (ref - h) + D (ref_dot - h_dot) + F_ff               wrist force, in {b}
    tau_d = (dh/dphi)^T F + tau_gravity(phi)                        desired spring torque
    u     = tau_d + k_p (tau_d - tau) - k_d tau_dot                 motor torque

h is the wrist position by forward kinematics. F_ff follows the measured wrist force during the first seconds (load
take-up) and is then constant, so the controller needs no model of the payload.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from estimator.arm.design import OmnidDesign
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.strict import is_number
from mocobot_sim.scene.as_built import AsBuilt, SensorEffects, units_of
from mocobot_sim.scene.models import omnid_design

if TYPE_CHECKING:
    import mujoco

    from mocobot_sim.scene.scene import TeamScene
    from mocobot_sim.scene.team_index import Index, TeamIndex


TAKE_UP_TICKS = 15
"""Index of the number of take-up ticks among the constants of the controller."""


RANGES = {
    "rate_hz": (1.0, 1e5), "stiffness_N_per_m": (0.0, 1e6), "damping_Ns_per_m": (0.0, 1e5),
    "torque_gain": (0.0, 1e3), "torque_rate_gain_s": (0.0, 10.0), "rate_filter_s": (0.0, 10.0),
    "take_up_s": (0.0, 3600.0), "take_up_time_constant_s": (1e-6, 3600.0), "motor_torque_limit_Nm": (1e-3, 1e5),
}  # fmt: skip
"""Allowed ranges of the gains. Chosen wide; ``control_stability`` tests whether a team is stable with them."""


@dataclass(frozen=True)
class ControlGains:
    """Gains of the wrist impedance and of the SEA torque loop, each within its range in ``RANGES``.

    Attributes:
        rate_hz: control rate [Hz].
        stiffness_N_per_m: isotropic stiffness K [N/m].
        damping_Ns_per_m: isotropic damping D [N s/m].
        torque_gain: k_p [-].
        torque_rate_gain_s: k_d [s].
        rate_filter_s: time constant of the first-order filter on differenced phi and tau [s].
        take_up_s: duration of the load take-up, in which F_ff follows the measured wrist force [s].
        take_up_time_constant_s: time constant of the load take-up [s].
        motor_torque_limit_Nm: saturation limit of u [N m].
    """

    rate_hz: float = 1000.0
    stiffness_N_per_m: float = 400.0
    damping_Ns_per_m: float = 50.0
    torque_gain: float = 4.0
    torque_rate_gain_s: float = 0.05
    rate_filter_s: float = 0.002
    take_up_s: float = 1.0
    take_up_time_constant_s: float = 0.3
    motor_torque_limit_Nm: float = 40.0

    def __post_init__(self) -> None:
        """Check every gain.

        Raises:
            InputError: a gain is not a number or is out of range.
        """
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            if not is_number(value) or not low <= value <= high:
                raise InputError(
                    f"control.{name} is {value!r:.40}; it must be a number from {low:g} to {high:g}"
                )

    def to_dict(self) -> dict[str, float]:
        """Convert to plain numbers with the keys of ``control`` in a recording's metadata."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> ControlGains:
        """Read the gains from ``control`` in a recording's metadata; other keys are ignored.

        Raises:
            InputError: a gain is missing, not a number or out of range.
        """
        gains: dict[str, Any] = {entry.name: values.get(entry.name) for entry in fields(cls)}
        return cls(**{name: float(value) if is_number(value) else value for name, value in gains.items()})


class TeamController:
    """Controllers of all robots, with their filter states and feed-forward forces.

    Args:
        index: addresses in the model.
        design: nominal geometry and masses that the controllers use.
        gains: control gains.
        data: MuJoCo data of the trial; the controller reads ``qpos`` and writes ``ctrl`` in place.
        as_built: sensor zeros of every robot; empty for robots as designed.
        sensors: timing faults; only the lag of the torque sensors affects the controller.
        feed_forward: constant F_ff of every robot in its {b} [N], shape (N, 3); None for load take-up.
        commands: wrist positions [m] and velocities [m/s] in every robot's {b}, one row per tick, shape
            (T, 2, N, 3); None if they are passed to ``update``.
        sensed: output array for the sensor signals phi, theta and torque, one row per tick, shape (T, N, 3, 3).
        qpos: positions as the sensors see them, instead of ``data.qpos``, shape (nq,); the caller updates the array.

    Attributes:
        state: state of the controllers, shape (N, 7, 3), changed in place.

    Raises:
        InputError: ``as_built`` or ``feed_forward`` does not match the number of robots.
    """

    def __init__(
        self,
        index: TeamIndex,
        design: OmnidDesign,
        gains: ControlGains,
        data: mujoco.MjData,
        as_built: Sequence[AsBuilt] = (),
        sensors: SensorEffects | None = None,
        feed_forward: Array | None = None,
        commands: Array | None = None,
        sensed: Array | None = None,
        qpos: Array | None = None,
    ) -> None:
        units = units_of(as_built, index.robots)
        phi_zero = np.array([unit.phi_zero_rad for unit in units])
        # addresses of motors, springs, actuators and gimbals, shape (N, 4, 3)
        address = np.stack([index.motor_qpos, index.spring_qpos, index.actuator, index.gimbal_qpos], axis=1)
        lag = (sensors or SensorEffects()).of("torque_lag_s", index.robots)
        filters = np.array([lag_filter(time_constant, 1.0 / gains.rate_hz) for time_constant in lag])
        # zeros of phi and tau, and the coefficients of the lag filter
        own = np.stack([home_phi(design) + phi_zero, [unit.tau_zero_Nm for unit in units], filters], axis=1)
        constants = (
            design.base_radius_m - design.platform_radius_m,
            design.proximal_length_m,
            design.rod_length_m,
            design.sea_stiffness_Nm_per_rad,
            # gravity torque over cos(phi) of a driven link with half the rod's mass at the knee [N m]
            design.gravity_mps2
            * (
                design.proximal_mass_kg * design.proximal_com_m
                + 0.5 * design.rod_mass_kg * design.proximal_length_m
            ),
            # weight at the wrist: platform, gimbal and half of each rod [N]
            design.gravity_mps2 * (design.wrist_mass_kg + 1.5 * design.rod_mass_kg),
            gains.stiffness_N_per_m,
            gains.damping_Ns_per_m,
            gains.torque_gain,
            gains.torque_rate_gain_s,
            1.0 / gains.rate_hz,
            1.0 / (1.0 + gains.rate_filter_s * gains.rate_hz),
            1.0 / (gains.take_up_time_constant_s * gains.rate_hz),
            gains.motor_torque_limit_Nm,
            home_phi(design),
            # ticks of the load take-up
            round(gains.take_up_s * gains.rate_hz) if feed_forward is None else 0,
        )
        self._constants = np.array(constants)
        # phi, tau, their filtered rates, F_ff, torque before and after the lag of the sensor
        self.state = np.zeros((index.robots, 7, 3))
        if feed_forward is not None:
            if np.shape(feed_forward) != (index.robots, 3) or not np.isfinite(feed_forward).all():
                raise InputError(f"feed-forward is not {index.robots} x 3 finite forces; it must be, in N")
            self.state[:, 4] = feed_forward
        self._commands = np.zeros((1, 2, index.robots, 3)) if commands is None else commands
        self._arrays = (
            data.qpos if qpos is None else qpos, data.ctrl, address, own, self._constants, self.state,
            self._commands, np.empty((1, index.robots, 3, 3)) if sensed is None else sensed,
        )  # fmt: skip
        self._tick = 0
        from mocobot_sim.kernels import update_team  # numba takes half a second to load

        self._update = update_team

    @property
    def feed_forward(self) -> Array:
        """F_ff of every robot in its {b} [N], shape (N, 3)."""
        return self.state[:, 4].copy()

    @feed_forward.setter
    def feed_forward(self, force: Array) -> None:
        """Set F_ff and end the load take-up."""
        self.state[:, 4] = force
        self._constants[TAKE_UP_TICKS] = 0

    def update(self, ref: Array, ref_dot: Array) -> None:
        """Run one control tick with given wrist positions [m] and velocities [m/s] in each {b}, shapes (N, 3)."""
        self._commands[self._tick % len(self._commands)] = ref, ref_dot
        self.tick()

    def tick(self) -> None:
        """Run one control tick with the stored commands: read ``qpos``, write ``ctrl``."""
        self._update(*self._arrays, self._tick)
        self._tick += 1


def home_phi(design: OmnidDesign) -> float:
    """Driven angle of every leg at the home height [rad], which is ``qpos`` = 0 in the MJCF."""
    reach = design.base_radius_m - design.platform_radius_m
    height = design.home_height_m
    distance = np.hypot(reach, height)
    # Triangle of motor axis, knee and platform joint; the knee lies on its outer side.
    cosine = (design.proximal_length_m**2 + distance**2 - design.rod_length_m**2) / (
        2.0 * design.proximal_length_m * distance
    )
    return float(np.arctan2(height, -reach) - np.arccos(cosine))


def lag_filter(time_constant_s: float, period_s: float) -> tuple[float, float, float]:
    """Coefficients (a, b_old, b_new) of a first-order lag y = a y + b_old x_old + b_new x_new.

    They are exact for an input that is linear between ticks. With a time constant of zero all are zero, which means
    no lag (y = x).
    """
    if not time_constant_s:
        return 0.0, 0.0, 0.0
    a = float(np.exp(-period_s / time_constant_s))
    held = time_constant_s / period_s * (1.0 - a)
    return a, held - a, 1.0 - held


STEP = 1e-6  # step of all finite differences, in SI units; chosen
HARDLY_DAMPED = 0.02  # damping ratio below which a warning is given; chosen: resonance amplifies 25 times
# Slower modes are ignored [1/s]. Chosen: nothing holds them, such as a gimbal without load.
AT_REST_PER_S = 0.05


@dataclass(frozen=True)
class Stability:
    """The least damped mode of the closed loop."""

    damping_ratio: float  # minus growth rate over undamped angular frequency; below 0 the control is unstable
    frequency_Hz: float  # frequency of the oscillation
    growth_per_s: float  # growth rate; below 0 if the mode decays

    @property
    def stable(self) -> bool:
        """Whether every mode decays."""
        return self.growth_per_s < 0

    @property
    def warning(self) -> str | None:
        """A sentence about unstable or weakly damped control; None if the control is well damped."""
        swing = f"a swing of {self.frequency_Hz:.2g} Hz"
        if not self.stable:
            return (
                f"The control is unstable: {swing} grows by a factor of e every {1 / self.growth_per_s:.2g} s, "
                "so torques and angles oscillate whatever is commanded."
            )
        hardly = f"The control is stable, but {swing} is hardly damped (ratio {self.damping_ratio:.2g})."
        return hardly if self.damping_ratio < HARDLY_DAMPED else None

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON values."""
        return {"stable": self.stable, **asdict(self)}


def control_stability(
    scene: TeamScene, model: mujoco.MjModel, data: mujoco.MjData, gains: ControlGains, ref_b: Array
) -> Stability:
    """Compute the least damped mode of the closed loop of a team with parked bases.

    MuJoCo linearises the physics and central differences linearise the controllers, after the load take-up. The
    linearisation ignores dry friction, which damps only small oscillations, and all actors and readers.

    Args:
        scene: the team.
        model, data: its compiled model, and data at the equilibrium.
        gains: control gains.
        ref_b: commanded wrist positions in each {b} [m], shape (N, 3).
    """
    import mujoco

    from mocobot_sim.scene.team_index import TeamIndex

    index, model = TeamIndex.of(model, scene.carries), copy.copy(model)
    model.dof_frictionloss[:] = 0.0
    rest = mujoco.MjData(model)
    rest.qpos[:], rest.ctrl[:] = data.qpos, data.ctrl
    size = 2 * model.nv + model.na
    step, push = np.zeros((size, size)), np.zeros((size, model.nu))
    mujoco.mjd_transitionFD(model, rest, STEP, True, step, push, None, None)
    free, pushed = np.eye(size), np.zeros_like(push)
    for _ in range(round(1.0 / (gains.rate_hz * model.opt.timestep))):
        free, pushed = step @ free, step @ pushed + push
    still = np.stack([ref_b, np.zeros_like(ref_b)])[None]
    controller = TeamController(
        index, omnid_design(), gains, rest, scene.units, scene.sensors, commands=still
    )
    answer = _linear(controller, rest, np.concatenate([index.motor_qpos.ravel(), index.spring_qpos.ravel()]))
    # Full state: physics, then controllers. The controllers read motor and spring coordinates.
    read = np.concatenate([index.motor_dof.ravel(), index.spring_dof.ravel()])
    read = np.concatenate([read, size + np.arange(controller.state.size)])
    loop = np.zeros((size + controller.state.size,) * 2)
    loop[:size, :size] = free
    loop[:, read] += np.concatenate([pushed @ answer[: model.nu], answer[model.nu :]])
    values = np.linalg.eigvals(loop).astype(complex)
    rates = np.log(values[np.abs(values) > 1e-12]) * gains.rate_hz
    rates = rates[np.abs(rates) > AT_REST_PER_S]
    worst = rates[np.argmin(-rates.real / np.abs(rates))]
    return Stability(
        float(-worst.real / abs(worst)), float(abs(worst.imag) / (2.0 * np.pi)), float(worst.real)
    )


def _linear(controller: TeamController, rest: mujoco.MjData, read: Index) -> Array:
    """Jacobian of (``ctrl``, next state) of the controllers with respect to (positions ``read``, state), at rest."""
    controller.tick()
    controller.feed_forward = controller.feed_forward
    controller.tick()
    state = controller.state

    def answer(x: Array) -> Array:
        rest.qpos[read], state[:] = x[: len(read)], x[len(read) :].reshape(state.shape)
        controller.tick()
        return np.concatenate([rest.ctrl, state.ravel()])

    at = np.concatenate([rest.qpos[read], state.ravel()])
    return np.array([(answer(at + e) - answer(at - e)) / (2.0 * STEP) for e in STEP * np.eye(len(at))]).T
