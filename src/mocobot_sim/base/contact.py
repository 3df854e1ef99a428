"""How wheels stand on the floor: load, friction and slip of every one."""

import mujoco
import numpy as np

from estimator.arrays import Array
from mocobot_sim.base.design import HAND, BaseDesign
from mocobot_sim.base.index import BaseIndex


class WheelContacts:
    """Contacts of rollers and floor, as MuJoCo solved them in its last step.

    Slip is taken along the roller's axle (as it lies on the floor while it carries the wheel with its middle): across
    it, a roller that takes over from the last one slides for some milliseconds until it turns, which costs nothing.
    While one hands over to the next, both touch: loads and friction forces add up, and the slip is their mean, weighed
    by load.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, index: BaseIndex, design: BaseDesign
    ) -> None:
        self._data, self._index = data, index
        sin, cos = np.sin(design.roller_angle_rad), np.cos(design.roller_angle_rad)
        self._axle = np.stack([np.full(4, sin), HAND * cos, np.zeros(4)], axis=1)  # in the chassis

    def measure(self) -> tuple[Array, Array, Array]:
        """Slip [m/s] of the contact on the floor, load [N] and friction [N] of every wheel, shapes (N, 4).

        0 where a wheel is in the air; friction is the size of the force in the floor.
        """
        data, robots = self._data, self._index.robots
        slip, load, grip = np.zeros(4 * robots), np.zeros(4 * robots), np.zeros((4 * robots, 3))
        axle = (self._axle @ data.xmat[self._index.chassis].reshape(-1, 3, 3).transpose(0, 2, 1)).reshape(
            -1, 3
        )
        contact = data.contact
        for geoms, row, frame in zip(contact.geom, contact.efc_address, contact.frame, strict=True):
            wheel = self._index.geom_wheel[geoms].max()
            if wheel < 0 or row < 0:
                continue
            # Elliptic cone: rows along the normal and two tangents, which are the frame's rows.
            tangents = frame.reshape(3, 3)[1:]
            force = data.efc_force[row]
            slip[wheel] += force * (axle[wheel] @ (data.efc_vel[row + 1 : row + 3] @ tangents))
            load[wheel] += force
            grip[wheel] += data.efc_force[row + 1 : row + 3] @ tangents
        slip = np.divide(slip, load, out=slip, where=load > 0)
        shape = (robots, 4)
        return slip.reshape(shape), load.reshape(shape), np.linalg.norm(grip, axis=1).reshape(shape)
