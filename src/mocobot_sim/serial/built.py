"""A model with effects in it, in memory, ready to be rolled out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from estimator.errors import InputError
from mocobot_sim.serial.effects import LAWS, RobotEffect
from mocobot_sim.serial.law import ActingLaw, JointLaw
from mocobot_sim.serial.mjcf import SOLIMP, SOLREF, into_mjcf

Effect = RobotEffect | JointLaw


@dataclass(frozen=True, eq=False)
class Built:
    """A robot that a reference stepper can step.

    Attributes:
        model: compiled, with what MJCF can say; contacts, limits and actuators off, MuJoCo's ``implicitfast``, and
            dry friction that hardly depends on the speed.
        stepped: effects that the stepper adds.
        left_out: which of the given effects are in neither, numbers from 0.
    """

    model: mujoco.MjModel
    stepped: tuple[Effect, ...]
    left_out: tuple[int, ...]

    def running(self) -> list[RobotEffect | ActingLaw]:
        """The stepper's effects for one run: laws may remember."""
        return [ActingLaw(e) if isinstance(e, JointLaw) else e for e in self.stepped]


def build(spec: mujoco.MjSpec, effects: Sequence[Effect], step_s: float) -> Built:
    """Put effects into a model.

    Args:
        spec: the nominal model; changed.
        effects: what is off.
        step_s: of the integration [s].

    Raises:
        InputError: MuJoCo refuses the model with the effects in it.
    """
    try:
        inside = [isinstance(e, RobotEffect) and into_mjcf(spec, e) for e in effects]
        model = spec.compile()
    except (ValueError, RuntimeError) as error:
        raise refused(error) from error
    off = mujoco.mjtDisableBit
    for bit in (off.mjDSBL_CONTACT, off.mjDSBL_LIMIT, off.mjDSBL_ACTUATION, off.mjDSBL_AUTORESET):
        model.opt.disableflags |= int(bit)
    model.opt.integrator, model.opt.timestep = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST), step_s
    model.dof_solref[:], model.dof_solimp[:] = SOLREF, SOLIMP
    stepped = [e for e, said in zip(effects, inside, strict=True) if not said and steps(e)]
    left_out = [
        k for k, (e, said) in enumerate(zip(effects, inside, strict=True)) if not said and not steps(e)
    ]
    return Built(model, tuple(stepped), tuple(left_out))


def steps(effect: Effect) -> bool:
    """Whether the stepper simulates an effect: errors of the log it does not."""
    return effect.acts if isinstance(effect, JointLaw) else effect.cause in LAWS


def refused(error: BaseException) -> InputError:
    """What is said where MuJoCo does not compile a model with effects."""
    return InputError(f"MuJoCo refuses the model with the causes in it ({' '.join(str(error).split())})")
