"""Sensor model of the robots' joints: calibration errors, noise, quantisation."""

from dataclasses import dataclass, field

import numpy as np

from estimator.arrays import Array
from estimator.errors import InputError
from estimator.recording.metadata import RecordingMetadata
from estimator.recording.model import Recording
from mocobot_sim.scene.as_built import CalibrationSpread
from mocobot_sim.scene.models import omnid_design
from mocobot_sim.trial.trajectories import RATE_HZ
from mocobot_sim.trial.trial_log import TrialLog


@dataclass(frozen=True)
class SensorPreset:
    """Quality of the sensors and of the calibration.

    Attributes:
        name: name on the command line.
        encoder_bits: resolution of every phi and theta encoder, in bits per turn; None for no quantisation.
        tau_step_Nm: torque resolution [N m]; 0 for no quantisation.
        tau_noise_Nm: standard deviation of the white torque noise before quantisation [N m].
        spread: standard deviations of the calibration errors.
    """

    name: str
    encoder_bits: int | None = None
    tau_step_Nm: float = 0.0
    tau_noise_Nm: float = 0.0
    spread: CalibrationSpread = field(default_factory=CalibrationSpread)

    @property
    def calibrated(self) -> bool:
        """Whether robots and sensors are exactly as designed."""
        return self.spread == CalibrationSpread()


# Sensor presets by name, from ideal sensors to robots without calibration. Chosen.
PRESETS = {
    preset.name: preset
    for preset in (
        SensorPreset("ideal"),
        SensorPreset("nominal", encoder_bits=16, tau_step_Nm=0.01, tau_noise_Nm=0.01),
        SensorPreset(
            "uncalibrated",
            encoder_bits=16,
            tau_step_Nm=0.01,
            tau_noise_Nm=0.01,
            spread=CalibrationSpread(
                encoder_zero_rad=float(np.deg2rad(1.0)),
                stiffness_ratio=0.02,
                geometry_m=1e-3,
                tau_zero_Nm=0.02,
            ),
        ),
    )
}


def sensor_preset(name: str) -> SensorPreset:
    """Look up a preset by name.

    Raises:
        InputError: there is no such preset.
    """
    if name not in PRESETS:
        raise InputError(f"preset {name!r} does not exist; the presets are {', '.join(PRESETS)}")
    return PRESETS[name]


def measure(
    log: TrialLog,
    preset: SensorPreset,
    rng: np.random.Generator,
    payload: str | None = None,
    seed: int | None = None,
    name: str = "simulated",
) -> Recording:
    """Make a recording of a trial with simulated sensors.

    A torque reading is the deflection of the spring times its design stiffness, so a stiffer spring reads low. Each
    quantised channel has a random offset of its quantisation grid, so that robots in equal postures do not have equal
    rounding errors.

    Args:
        log: log of the trial.
        preset: quality of the sensors.
        rng: random generator for noise and grid offsets.
        payload: name of the payload, for the metadata.
        seed: seed, for the metadata.
        name: name of the recording in messages.
    """
    units = log.units
    clock_s = np.array(log.sensors.of("clock_delay_s", log.robots))
    torque_s = clock_s + log.sensors.of("torque_delay_s", log.robots)
    phi = log.sensed.sampled("phi", clock_s) + np.array([unit.phi_zero_rad for unit in units])
    theta = log.sensed.sampled("theta", clock_s) + np.array([unit.theta_zero_rad for unit in units])
    tau = log.sensed.sampled("tau", torque_s) + np.array([unit.tau_zero_Nm for unit in units])
    encoder_step = 2.0 * np.pi / 2**preset.encoder_bits if preset.encoder_bits else 0.0
    grids = [_grid(step, log.robots, rng) for step in (encoder_step, encoder_step, preset.tau_step_Nm)]
    if preset.tau_noise_Nm:
        tau = tau + preset.tau_noise_Nm * rng.standard_normal(tau.shape)
    return Recording(
        time=log.time,
        phi=_round_to(phi, encoder_step, grids[0]),
        theta=_round_to(theta, encoder_step, grids[1]),
        tau=_round_to(tau, preset.tau_step_Nm, grids[2]),
        ref=log.ref_b,
        metadata=RecordingMetadata(
            robots=log.robots,
            rate_hz=RATE_HZ,
            trial=log.trial,
            source=f"mocobot simulation, {preset.name} sensors",
            payload=payload,
            seed=seed,
            design=omnid_design(),
            control=log.gains.to_dict() | {"feed_forward_N": log.feed_forward.tolist()},
        ),
        name=name,
    )


def _grid(step: float, robots: int, rng: np.random.Generator) -> Array:
    """Random offset of the quantisation grid of each channel, within half a step, shape (N, 3)."""
    return step * rng.uniform(-0.5, 0.5, (robots, 3)) if step else np.zeros((robots, 3))


def _round_to(values: Array, step: float, grid: Array) -> Array:
    # C order, as in a recording read from a file, so that sums over it are bit-identical.
    return np.ascontiguousarray(np.round((values + grid) / step) * step - grid if step else values)
