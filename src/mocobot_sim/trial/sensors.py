"""What the robots' joint sensors make of the truth: calibration, noise, quantisation."""

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
        name: how the command line calls it.
        encoder_bits: resolution of every phi and theta encoder, per turn; None for continuous.
        tau_step_Nm: torque resolution [N m]; 0 for continuous.
        tau_noise_Nm: standard deviation of white torque noise before rounding [N m].
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
    """Look a preset up by name.

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
    """Read a trial through the sensors.

    A torque reading is the spring's deflection times its design stiffness, so a stiffer spring reads low.
    Every encoder and torque channel that rounds has a grid of its own, placed at random, so that robots which stand
    alike do not round alike.

    Args:
        log: the trial.
        preset: quality of the sensors.
        rng: source of the noise and of the grids.
        payload: name of the payload, for the metadata.
        seed: seed, for the metadata.
        name: how messages call the recording.
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
    """Where each channel's grid lies relative to zero, within half a step, shape (N, 3)."""
    return step * rng.uniform(-0.5, 0.5, (robots, 3)) if step else np.zeros((robots, 3))


def _round_to(values: Array, step: float, grid: Array) -> Array:
    # In C order like a recording from a file or another process, so that sums over it have the same bits.
    return np.ascontiguousarray(np.round((values + grid) / step) * step - grid if step else values)
