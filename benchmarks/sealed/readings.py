"""Errors of readings that nobody lists."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from mocobot_sim.trial.actors import Reader
from mocobot_sim.trial.readings import Misreading, RobotReadings
from sealed.form import Form, Ground, Place, Play

Error = Callable[[RobotReadings, np.ndarray, float, float], float]
"""Reading minus truth [rad or N m]: of all readings of the robot, what is seen, the true value and the time [s]."""


@dataclass(frozen=True)
class Misread(Form):
    """One reading of one joint is off."""

    channel: ClassVar[Literal["phi", "theta", "tau"]]
    robot: int
    joint: int

    @abstractmethod
    def error_of_trial(self) -> Error:
        """What the reading is off by in a trial; it may remember."""

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        error = self.error_of_trial()

        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            if self.channel == "tau":
                tau = readings.tau(seen, self.joint)
                readings.set_tau(seen, self.joint, tau + error(readings, seen, tau, time))
                return
            phi = self.channel == "phi"
            angle = (readings.phi if phi else readings.theta)(seen, self.joint)
            add = readings.add_phi if phi else readings.add_theta
            add(seen, self.joint, error(readings, seen, angle, time))

        return [Misreading(self.robot, change)]

    def _law(self, variables: list[str], formula: str, unit: str) -> dict[str, Any]:
        return self.told(f"{self.channel} reading", variables, formula, unit)


@dataclass(frozen=True)
class MisreadNow(Misread):
    """Off by a function of this instant."""

    @abstractmethod
    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        """Reading minus truth [rad or N m]."""

    def error_of_trial(self) -> Error:
        return self.error


@dataclass(frozen=True)
class Gap(Misread):
    """It follows only once the truth has crossed a gap, ``size`` being half of its width."""

    def law(self) -> dict[str, Any] | None:
        unit = "N m" if self.channel == "tau" else "rad"
        return self._law([f"own {self.channel}, its history"], "play of half width a", unit)

    def error_of_trial(self) -> Error:
        play = Play(getattr(self, self.size))
        return lambda readings, seen, value, time: play.step(value) - value


@dataclass(frozen=True)
class _Eccentric(MisreadNow):
    size = "amplitude_rad"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.5)}
    amplitude_rad: float
    phase_rad: float
    times: ClassVar[int]

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        times = "" if self.times == 1 else f"{self.times} "
        formula = f"a sin({times}{self.channel} + {self.phase_rad:.3g})"
        return self._law([f"own {self.channel}, from home"], formula, "rad")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_rad * math.sin(self.times * value + self.phase_rad)


@dataclass(frozen=True)
class EccentricPhi(_Eccentric):
    """A driven joint's encoder disc sits off its axis."""

    channel = "phi"
    times = 1


@dataclass(frozen=True)
class EccentricTheta(_Eccentric):
    """A gimbal encoder's disc sits off its axis."""

    channel = "theta"
    times = 1


@dataclass(frozen=True)
class CyclicPhi(_Eccentric):
    """An error that comes again with every pole of a magnetic encoder."""

    channel = "phi"
    times = 16


@dataclass(frozen=True)
class EncoderBacklash(Gap):
    """A driven joint's encoder sits behind a gear with play."""

    channel = "phi"
    size = "half_width_rad"
    ranges: ClassVar = {"half_width_rad": (0.0, 0.1)}
    half_width_rad: float


@dataclass(frozen=True)
class SoftEncoderMount(MisreadNow):
    """A driven joint's encoder gives way to the joint's torque."""

    channel = "phi"
    size, either_sign = "rad_per_Nm", True
    ranges: ClassVar = {"rad_per_Nm": (-0.1, 0.1)}
    rad_per_Nm: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], "a tau", "rad/(N m)")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.rad_per_Nm * readings.tau(seen, self.joint)


@dataclass(frozen=True)
class SlippingZero(MisreadNow):
    """A gimbal encoder's zero slips steadily, in every trial anew."""

    channel = "theta"
    size, either_sign = "rate_radps", True
    ranges: ClassVar = {"rate_radps": (-0.1, 0.1)}
    rate_radps: float

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a t", "rad/s")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.rate_radps * time


@dataclass(frozen=True)
class _Torque(MisreadNow):
    channel = "tau"


@dataclass(frozen=True)
class CrossTalk(_Torque):
    """A torque sensor that also feels its neighbour's load."""

    size = "share"
    ranges: ClassVar = {"share": (-0.9, 0.9)}
    neighbour: float
    share: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        neighbour = rng.choice([k for k in (1, 2, 3) if k != place["joint"]])
        return cls(**place, neighbour=float(neighbour), share=float(rng.choice([-1.0, 1.0]) * size))

    def law(self) -> dict[str, Any]:
        other = int(self.neighbour)
        return self._law([f"tau of robot {self.robot}, joint {other}"], "a x", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.share * readings.tau(seen, int(self.neighbour))


@dataclass(frozen=True)
class WarmingScale(_Torque):
    """Its scale drifts while the electronics warm up, in every trial anew."""

    size, either_sign = "scale", True
    ranges: ClassVar = {"scale": (-0.9, 0.9), "time_s": (0.1, 1e4)}
    scale: float
    time_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"time_s": float(rng.uniform(6.0, 20.0))}

    def law(self) -> dict[str, Any]:
        return self._law(["t", "own tau"], f"a tau (1 - exp(-t / {self.time_s:.3g} s))", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.scale * (1.0 - math.exp(-time / self.time_s)) * value


@dataclass(frozen=True)
class WarmingZero(_Torque):
    """Its zero drifts with the temperature, in every trial anew."""

    size, either_sign = "zero_Nm", True
    ranges: ClassVar = {"zero_Nm": (-20.0, 20.0), "time_s": (0.1, 1e4)}
    zero_Nm: float
    time_s: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"time_s": float(rng.uniform(6.0, 20.0))}

    def law(self) -> dict[str, Any]:
        return self._law(["t"], f"a (1 - exp(-t / {self.time_s:.3g} s))", "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.zero_Nm * (1.0 - math.exp(-time / self.time_s))


@dataclass(frozen=True)
class Saturation(_Torque):
    """Above a knee it passes a part of the torque only: an amplifier near its end."""

    size = "lost_share"
    ranges: ClassVar = {"knee_Nm": (0.0, 20.0), "lost_share": (0.0, 1.0)}
    knee_Nm: float
    lost_share: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        return cls(
            **place,
            knee_Nm=float(ground.torque_Nm[place["robot"] - 1, place["joint"] - 1]),
            lost_share=min(size, 1.0),
        )

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], f"-a max(tau - {self.knee_Nm:.3g} N m, 0)", "1")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return -self.lost_share * (max(value - self.knee_Nm, 0.0) + min(value + self.knee_Nm, 0.0))


@dataclass(frozen=True)
class QuadraticReading(_Torque):
    """Its scale grows with the load: a bridge that is not linear."""

    size, either_sign = "per_Nm", True
    ranges: ClassVar = {"per_Nm": (-0.05, 0.05)}
    per_Nm: float

    def law(self) -> dict[str, Any]:
        return self._law(["own tau"], "a tau^2", "1/(N m)")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.per_Nm * value**2


@dataclass(frozen=True)
class AngleInTorque(_Torque):
    """It feels where the joint stands: a cable that pulls at the sensor, once a turn."""

    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0)}
    amplitude_Nm: float
    times: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"times": float(rng.integers(4, 13)), "phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def law(self) -> dict[str, Any]:
        formula = f"a sin({self.times:.0f} phi + {self.phase_rad:.3g})"
        return self._law(["own phi, from home"], formula, "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(self.times * readings.phi(seen, self.joint) + self.phase_rad)


@dataclass(frozen=True)
class TorqueBacklash(Gap):
    """It moves only once the torque has crossed a gap: a loose gauge, whose law is that of friction beside the spring.

    Either reading stays behind the torque by a number whose sign is that of its change.
    """

    answer = "sea_hysteresis"
    channel = "tau"
    size = "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 5.0)}
    half_width_Nm: float

    def known(self) -> dict[str, float]:
        return {"friction_Nm": self.half_width_Nm}

    def law(self) -> dict[str, Any] | None:
        return None


@dataclass(frozen=True)
class TorqueHum(_Torque):
    """A hum of one frequency on it, out of step with the motion."""

    size = "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0), "frequency_hz": (0.01, 500.0)}
    amplitude_Nm: float
    frequency_hz: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"frequency_hz": float(rng.uniform(0.9, 3.5))}

    def law(self) -> dict[str, Any]:
        return self._law(["t"], f"a sin(2 pi {self.frequency_hz:.4g} Hz t)", "N m")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.amplitude_Nm * math.sin(2.0 * np.pi * self.frequency_hz * time)


HELD_S = (0.05, 0.2)
"""Shortest and longest time for which an encoder holds its last value."""


@dataclass(frozen=True)
class _Dropouts(Misread):
    """An encoder that holds its last value for a while, again and again; the controller gets the same."""

    size = "share"
    ranges: ClassVar = {"share": (0.0, 0.5), "draw": (0.0, 2.0**32)}
    share: float
    draw: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"draw": float(rng.integers(2**32))}

    def law(self) -> dict[str, Any]:
        return self._law([f"own {self.channel}, its history"], "the last value, held for a while", "1")

    def error_of_trial(self) -> Error:
        rng, mean_s = np.random.default_rng(int(self.draw)), 0.5 * sum(HELD_S)
        free_s = mean_s * (1.0 / self.share - 1.0)
        begin, until, held = float(rng.exponential(free_s)), 0.0, 0.0

        def error(readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
            nonlocal begin, until, held
            if time >= begin:
                until, held = begin + float(rng.uniform(*HELD_S)), value
                begin = until + float(rng.exponential(free_s))
            return held - value if time < until else 0.0

        return error


@dataclass(frozen=True)
class DropoutsPhi(_Dropouts):
    """A driven joint's encoder."""

    channel = "phi"


@dataclass(frozen=True)
class DropoutsTheta(_Dropouts):
    """A gimbal's encoder."""

    channel = "theta"


@dataclass(frozen=True)
class TorqueRamp(MisreadNow):
    """A torque sensor's zero drifts steadily, in every trial anew."""

    channel = "tau"
    size, either_sign = "rate_Nmps", True
    ranges: ClassVar = {"rate_Nmps": (-1.0, 1.0)}
    rate_Nmps: float

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a t", "N m/s")

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return self.rate_Nmps * time


@dataclass(frozen=True)
class TorqueWalk(Misread):
    """A torque sensor's zero walks at random, each trial's way its own."""

    channel = "tau"
    size = "walk_Nm_per_sqrt_s"
    ranges: ClassVar = {"walk_Nm_per_sqrt_s": (0.0, 1.0), "draw": (0.0, 2.0**32)}
    walk_Nm_per_sqrt_s: float
    draw: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"draw": float(rng.integers(2**32))}

    def law(self) -> dict[str, Any]:
        return self._law(["t"], "a random walk", "N m/s^0.5")

    def error_of_trial(self) -> Error:
        rng, at, walked = np.random.default_rng(int(self.draw)), 0.0, 0.0

        def error(readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
            nonlocal at, walked
            walked += self.walk_Nm_per_sqrt_s * float(np.sqrt(time - at) * rng.standard_normal())
            at = time
            return walked

        return error


@dataclass(frozen=True)
class DeadBand(MisreadNow):
    """A torque sensor that does not answer to a change within a band around the torque at home, and to less beyond."""

    channel = "tau"
    size = "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 10.0), "centre_Nm": (-20.0, 20.0)}
    half_width_Nm: float
    centre_Nm: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        centre = float(ground.torque_Nm[place["robot"] - 1, place["joint"] - 1])
        return cls(**place, half_width_Nm=size, centre_Nm=centre)

    def law(self) -> dict[str, Any]:
        return self._law(
            ["own tau"], f"-(tau - {self.centre_Nm:.3g} N m), and beyond +-a no more than that", "N m"
        )

    def error(self, readings: RobotReadings, seen: np.ndarray, value: float, time: float) -> float:
        return -min(max(value - self.centre_Nm, -self.half_width_Nm), self.half_width_Nm)
