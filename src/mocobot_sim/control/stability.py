"""Whether a team's control is stable: the eigenvalues of one control period at the pose where a trial starts.

MuJoCo linearises the physics, central differences linearise the controllers; the load is taken up. Left out are dry
friction, which stops small swings but no large ones, and actors and sensors that misread.
"""

from __future__ import annotations

import copy
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from estimator.arrays import Array
from mocobot_sim.control.control import ControlGains, TeamController
from mocobot_sim.scene.design import omnid_design
from mocobot_sim.scene.team_index import Index, TeamIndex

if TYPE_CHECKING:
    from mocobot_sim.scene.scene import TeamScene

STEP = 1e-6  # of all differences, in SI units
HARDLY_DAMPED = 0.02  # damping ratio: a swing is amplified 25 times in resonance
AT_REST_PER_S = 0.05  # slower modes are none: what nothing holds in place, such as a gimbal without load


@dataclass(frozen=True)
class Stability:
    """The least damped mode of the closed loop.

    Attributes:
        damping_ratio: minus growth over undamped angular frequency; below 0 the control is unstable.
        frequency_Hz: how fast it swings.
        growth_per_s: how fast it grows; below 0 if it decays.
    """

    damping_ratio: float
    frequency_Hz: float
    growth_per_s: float

    @property
    def stable(self) -> bool:
        """Whether every swing decays."""
        return self.growth_per_s < 0

    @property
    def warning(self) -> str | None:
        """What is wrong with it in a sentence, if anything."""
        swing = f"a swing of {self.frequency_Hz:.2g} Hz"
        if not self.stable:
            return (
                f"The control is unstable: {swing} grows by a factor of e every {1 / self.growth_per_s:.2g} s, "
                "so torques and angles oscillate whatever is commanded."
            )
        hardly = f"The control is stable, but {swing} is hardly damped (ratio {self.damping_ratio:.2g})."
        return hardly if self.damping_ratio < HARDLY_DAMPED else None

    def to_dict(self) -> dict[str, Any]:
        """JSON-able form."""
        return {"stable": self.stable, **asdict(self)}


def control_stability(
    scene: TeamScene, model: mujoco.MjModel, data: mujoco.MjData, gains: ControlGains, ref_b: Array
) -> Stability:
    """Judge the control of a team with parked bases, at rest as ``data`` is, wrists commanded to ``ref_b`` (N, 3)."""
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
    # The whole state: physics, then controllers, which read driven angles and springs.
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
    """Slopes of (``ctrl``, next state) by (positions ``read``, state) of controllers at rest, the load taken up."""
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
