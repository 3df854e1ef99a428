"""The log of a trial."""

from dataclasses import dataclass

from scipy.spatial.transform import Rotation

from estimator.arrays import Array
from mocobot_sim.control.control import ControlGains
from mocobot_sim.control.stability import Stability
from mocobot_sim.scene.as_built import AsBuilt
from mocobot_sim.scene.sensor_effects import SensorEffects
from mocobot_sim.trial.sensed import SensedLog


@dataclass(frozen=True)
class TrialLog:
    """What truly happened, at ``RATE_HZ``; nothing here has passed a sensor.

    All quantities of one row belong to one instant.

    Attributes:
        trial: kind of trajectory.
        time: [s], shape (Q,).
        phi: driven angles [rad], shape (Q, N, 3).
        theta: gimbal angles (z, y, x) [rad], shape (Q, N, 3).
        tau: true torque of the springs on the proximal links, positive raising them [N m], shape (Q, N, 3).
        ref_b: commanded wrist positions in {b} [m], shape (Q, N, 3).
        p_W1: origin of {1} in the world [m], shape (Q, 3).
        R_W1: orientation of {1} (the payload, or robot 1's flange that holds nothing) in the world, shape (Q, 3, 3).
        feed_forward: the controller's frozen load force in {b} [N], shape (N, 3).
        gains: control gains.
        units: how each robot deviates from the design, N entries.
        sensors: timing faults of the sensors.
        sensed: what the joint sensors see, at the control rate.
        rod_error_m: largest distance between a rod's tip and its platform joint [m].
        weld_error_m: largest distance between a flange and its grasp [m].
        weld_error_rad: largest angle between a flange and its grasp [rad].
        stability: whether the control was stable; None where bases drove or others acted on the arms.
    """

    trial: str
    time: Array
    phi: Array
    theta: Array
    tau: Array
    ref_b: Array
    p_W1: Array
    R_W1: Array
    feed_forward: Array
    gains: ControlGains
    units: tuple[AsBuilt, ...]
    sensors: SensorEffects
    sensed: SensedLog
    rod_error_m: float
    weld_error_m: float
    weld_error_rad: float
    stability: Stability | None

    @property
    def robots(self) -> int:
        """Number of robots N."""
        return self.phi.shape[1]

    def payload_rotation(self) -> Array:
        """Rotation vector of the payload from its pose at the first sample, in {1} then [rad], shape (Q, 3)."""
        return (Rotation.from_matrix(self.R_W1[0]).inv() * Rotation.from_matrix(self.R_W1)).as_rotvec()
