"""One Omnid alone on a floor, its arm locked at home: to see what its base does."""

from collections.abc import Sequence

import mujoco

from estimator.arrays import Array
from mocobot_sim.base.design import WHEELS, BaseDesign, base_design
from mocobot_sim.base.drive import BaseDrive, DriveLog
from mocobot_sim.base.rollers import release, rough_floor
from mocobot_sim.scene.models import models_dir
from mocobot_sim.scene.omnid import load_omnid, stand
from mocobot_sim.scene.pymjcf import compiled, mjcf
from mocobot_sim.scene.scene import TIMESTEP_S
from mocobot_sim.trial.actors import Stage
from mocobot_sim.trial.trajectories import RATE_HZ


class Snapshots:
    """Keeps ``qpos`` at given times: an actor of a trial that does nothing.

    Args:
        times_s: when [s]; each is kept at the first control tick from then on.
    """

    def __init__(self, times_s: Sequence[float]) -> None:
        self.times_s = tuple(sorted(times_s))
        self.qpos: list[Array] = []

    def start(self, stage: Stage) -> None:
        """Get ready."""
        self.begin(stage.data, stage.rate_hz)

    def begin(self, data: mujoco.MjData, rate_hz: float) -> None:
        """The same without a trial."""
        self._data, self._rate_hz, self.qpos = data, rate_hz, []

    def act(self, tick: int) -> None:
        """Look, and keep what is due."""
        while (
            len(self.qpos) < len(self.times_s) and tick >= self.times_s[len(self.qpos)] * self._rate_hz - 1e-6
        ):
            self.qpos.append(self._data.qpos.copy())


def build_solo(design: BaseDesign | None = None, timestep_s: float = TIMESTEP_S) -> "mjcf.RootElement":
    """One released Omnid at the world's origin, heading along x; its arm is rigid.

    Args:
        design: of its base; None for the shipped one.
        timestep_s: integration step [s].

    Raises:
        InputError: the base cannot be built.
    """
    design = design or base_design()
    root = mjcf.from_path(str(models_dir() / "team.xml"))
    root.model = "solo"
    root.option.timestep = timestep_s
    omnid = load_omnid(1)
    release(omnid, design)
    wheels = {f"wheel_{wheel}" for wheel in WHEELS}
    for element in [*omnid.equality.all_children(), *omnid.actuator.all_children()]:
        if element.name.startswith(("rod", "motor")):
            element.remove()
    for joint in omnid.find_all("joint"):
        if not any(joint.name.startswith(wheel) for wheel in wheels):
            joint.remove()
    stand(root, omnid, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]).add("freejoint")
    rough_floor(root, design)
    return root


def compile_solo(root: "mjcf.RootElement") -> mujoco.MjModel:
    """Compile what ``build_solo`` returned."""
    return compiled(root)


def drive_solo(
    model: mujoco.MjModel,
    drive: BaseDrive,
    duration_s: float,
    rate_hz: float = 1000.0,
    snapshots: Snapshots | None = None,
) -> DriveLog:
    """Let the robot follow its plan.

    Args:
        model: of ``compile_solo``.
        drive: its base's.
        duration_s: how long [s].
        rate_hz: control rate [Hz].
        snapshots: to take on the way.

    Raises:
        InputError: the plan does not fit the model.
    """
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    ticks, substeps = round(rate_hz / RATE_HZ), round(1.0 / (rate_hz * model.opt.timestep))
    drive.begin(model, data, rate_hz, ticks)
    snapshots = snapshots or Snapshots(())
    snapshots.begin(data, rate_hz)
    for tick in range(round(duration_s * rate_hz) + 1):
        drive.act(tick)
        snapshots.act(tick)
        mujoco.mj_step(model, data, nstep=substeps)
    return drive.log()
