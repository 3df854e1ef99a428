"""Errors of readings that nobody lists."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from mocobot_sim.trial.actors import Misreading, Reader, RobotReadings
from sealed.form import BoucWen, Form, Ground, Place, Play

SCRATCH_RAD = 0.05
"""Width of a scratch on an encoder's disc."""
SOFT_NM = 8.0
"""Torque at which a soft saturation is half way."""
YIELD_NM = 0.4
"""Torque over which a loose gauge changes sides."""
HELD_S = (0.05, 0.2)
"""Shortest and longest time for which an encoder holds its last value."""


@dataclass(frozen=True, eq=False)
class Instant:
    """What a misreading may depend on.

    Attributes:
        readings, seen: all readings of the robot, and what is seen of them.
        value: the true value [rad or N m].
        time: [s].
    """

    readings: RobotReadings
    seen: np.ndarray
    value: float
    time: float

    def tau(self, joint: int) -> float:
        """Torque of a joint of the robot [N m]."""
        return self.readings.tau(self.seen, joint)


Error = Callable[[Instant], float]
"""Reading minus truth [rad or N m]."""


@dataclass(frozen=True)
class Misread(Form):
    """One reading of one joint is off, by a function of the instant or with a memory."""

    channel: ClassVar[Literal["phi", "theta", "tau"]]
    robot: int
    joint: int

    def error(self, now: Instant) -> float:
        """Reading minus truth [rad or N m] of one that has no memory."""
        raise NotImplementedError

    def error_of_trial(self) -> Error:
        """What the reading is off by in a trial; it may remember."""
        return self.error

    def readers(self, trial_number: int | None) -> Sequence[Reader]:
        error = self.error_of_trial()

        def change(readings: RobotReadings, seen: np.ndarray, time: float) -> None:
            if self.channel == "tau":
                tau = readings.tau(seen, self.joint)
                readings.set_tau(seen, self.joint, tau + error(Instant(readings, seen, tau, time)))
                return
            phi = self.channel == "phi"
            angle = (readings.phi if phi else readings.theta)(seen, self.joint)
            add = readings.add_phi if phi else readings.add_theta
            add(seen, self.joint, error(Instant(readings, seen, angle, time)))

        return [Misreading(self.robot, change)]

    def law(self) -> dict[str, Any] | None:
        law = super().law()
        return law and law | {"of": f"{self.channel} reading"}


@dataclass(frozen=True)
class EccentricPhi(Misread):
    """A driven joint's encoder disc sits off its axis."""

    channel, size = "phi", "amplitude_rad"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.5)}
    draws: ClassVar = {"phase_rad": (-np.pi, np.pi)}
    formula: ClassVar = (["own phi, from home"], "a sin(phi + {phase_rad:.3g})", "rad")
    times: ClassVar = 1
    amplitude_rad: float
    phase_rad: float

    def error(self, now: Instant) -> float:
        return self.amplitude_rad * math.sin(self.times * now.value + self.phase_rad)


@dataclass(frozen=True)
class EccentricTheta(EccentricPhi):
    """A gimbal encoder's disc sits off its axis."""

    channel = "theta"
    formula: ClassVar = (["own theta, from home"], "a sin(theta + {phase_rad:.3g})", "rad")


@dataclass(frozen=True)
class CyclicPhi(EccentricPhi):
    """An error that comes again with every pole of a magnetic encoder."""

    formula: ClassVar = (["own phi, from home"], "a sin(16 phi + {phase_rad:.3g})", "rad")
    times: ClassVar = 16


@dataclass(frozen=True)
class FineInterpolation(EccentricPhi):
    """A gimbal encoder whose interpolation errs 64 times a turn."""

    channel = "theta"
    ranges: ClassVar = {"amplitude_rad": (0.0, 0.1)}
    formula: ClassVar = (["own theta"], "a sin(64 theta + {phase_rad:.3g})", "rad")
    times: ClassVar = 64


@dataclass(frozen=True)
class EncoderBacklash(Misread):
    """A driven joint's encoder sits behind a gear with play: it follows only once the truth has crossed a gap."""

    channel, size = "phi", "half_width_rad"
    ranges: ClassVar = {"half_width_rad": (0.0, 0.1)}
    formula: ClassVar = (["own phi, its history"], "play of half width a", "rad")
    half_width_rad: float

    def error_of_trial(self) -> Error:
        play = Play(self.half_width_rad)
        return lambda now: play.step(now.value) - now.value


@dataclass(frozen=True)
class TorqueBacklash(Misread):
    """A loose gauge moves only once the torque has crossed a gap; its law is that of friction beside the spring.

    Either reading stays behind the torque by a number whose sign is that of its change.
    """

    answer = "sea_hysteresis"
    channel, size = "tau", "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 5.0)}
    half_width_Nm: float

    def known(self) -> dict[str, float]:
        return {"friction_Nm": self.half_width_Nm}

    def error_of_trial(self) -> Error:
        play = Play(self.half_width_Nm)
        return lambda now: play.step(now.value) - now.value


@dataclass(frozen=True)
class SoftEncoderMount(Misread):
    """A driven joint's encoder gives way to the joint's torque."""

    channel, size, either_sign = "phi", "rad_per_Nm", True
    ranges: ClassVar = {"rad_per_Nm": (-0.1, 0.1)}
    formula: ClassVar = (["own tau"], "a tau", "rad/(N m)")
    rad_per_Nm: float

    def error(self, now: Instant) -> float:
        return self.rad_per_Nm * now.tau(self.joint)


@dataclass(frozen=True)
class SlippingZero(Misread):
    """A gimbal encoder's zero slips steadily, in every trial anew."""

    channel, size, either_sign = "theta", "rate_radps", True
    ranges: ClassVar = {"rate_radps": (-0.1, 0.1)}
    formula: ClassVar = (["t"], "a t", "rad/s")
    rate_radps: float

    def error(self, now: Instant) -> float:
        return self.rate_radps * now.time


@dataclass(frozen=True)
class ScratchedDisc(Misread):
    """A driven joint's encoder errs where its disc is scratched, and nowhere else."""

    channel, size, either_sign = "phi", "depth_rad", True
    ranges: ClassVar = {"depth_rad": (-0.1, 0.1)}
    draws: ClassVar = {"at_rad": (-0.1, 0.1)}
    formula: ClassVar = (
        ["own phi, from home"], f"a exp(-((phi - {{at_rad:.3g}}) / {SCRATCH_RAD})^2)", "rad"
    )  # fmt: skip
    depth_rad: float
    at_rad: float

    def error(self, now: Instant) -> float:
        return self.depth_rad * math.exp(-(((now.value - self.at_rad) / SCRATCH_RAD) ** 2))


@dataclass(frozen=True)
class CrossTalk(Misread):
    """A torque sensor that also feels its neighbour's load."""

    channel, size = "tau", "share"
    ranges: ClassVar = {"share": (-0.9, 0.9)}
    neighbour: float
    share: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        neighbour = rng.choice([k for k in (1, 2, 3) if k != place["joint"]])
        return cls(**place, neighbour=float(neighbour), share=float(rng.choice([-1.0, 1.0]) * size))

    @property
    def formula(self) -> tuple[list[str], str, str]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """It names the neighbour."""
        return [f"tau of robot {self.robot}, joint {int(self.neighbour)}"], "a x", "1"

    def error(self, now: Instant) -> float:
        return self.share * now.tau(int(self.neighbour))


@dataclass(frozen=True)
class WarmingScale(Misread):
    """A torque sensor's scale drifts while the electronics warm up, in every trial anew."""

    channel, size, either_sign = "tau", "scale", True
    ranges: ClassVar = {"scale": (-0.9, 0.9), "time_s": (0.1, 1e4)}
    draws: ClassVar = {"time_s": (6.0, 20.0)}
    formula: ClassVar = (["t", "own tau"], "a tau (1 - exp(-t / {time_s:.3g} s))", "1")
    scale: float
    time_s: float

    def error(self, now: Instant) -> float:
        return self.scale * (1.0 - math.exp(-now.time / self.time_s)) * now.value


@dataclass(frozen=True)
class WarmingZero(Misread):
    """A torque sensor's zero drifts with the temperature, in every trial anew."""

    channel, size, either_sign = "tau", "zero_Nm", True
    ranges: ClassVar = {"zero_Nm": (-20.0, 20.0), "time_s": (0.1, 1e4)}
    draws: ClassVar = {"time_s": (6.0, 20.0)}
    formula: ClassVar = (["t"], "a (1 - exp(-t / {time_s:.3g} s))", "N m")
    zero_Nm: float
    time_s: float

    def error(self, now: Instant) -> float:
        return self.zero_Nm * (1.0 - math.exp(-now.time / self.time_s))


@dataclass(frozen=True)
class Saturation(Misread):
    """Above a knee a torque sensor passes a part of the torque only: an amplifier near its end."""

    channel, size = "tau", "lost_share"
    ranges: ClassVar = {"knee_Nm": (0.0, 20.0), "lost_share": (0.0, 1.0)}
    formula: ClassVar = (["own tau"], "-a max(tau - {knee_Nm:.3g} N m, 0)", "1")
    knee_Nm: float
    lost_share: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        knee = float(ground.torque_Nm[place["robot"] - 1, place["joint"] - 1])
        return cls(**place, knee_Nm=knee, lost_share=min(size, 1.0))

    def error(self, now: Instant) -> float:
        return -self.lost_share * (max(now.value - self.knee_Nm, 0.0) + min(now.value + self.knee_Nm, 0.0))


@dataclass(frozen=True)
class SoftSaturation(Misread):
    """A torque sensor that passes ever less of its torque, without a knee."""

    channel, size = "tau", "lost_share"
    ranges: ClassVar = {"lost_share": (0.0, 1.0)}
    formula: ClassVar = (["own tau"], f"-a (tau - {SOFT_NM:g} tanh(tau / {SOFT_NM:g}))", "1")
    lost_share: float

    def error(self, now: Instant) -> float:
        return -self.lost_share * (now.value - SOFT_NM * math.tanh(now.value / SOFT_NM))


@dataclass(frozen=True)
class QuadraticReading(Misread):
    """A torque sensor's scale grows with the load: a bridge that is not linear."""

    channel, size, either_sign = "tau", "per_Nm", True
    ranges: ClassVar = {"per_Nm": (-0.05, 0.05)}
    formula: ClassVar = (["own tau"], "a tau^2", "1/(N m)")
    per_Nm: float

    def error(self, now: Instant) -> float:
        return self.per_Nm * now.value**2


@dataclass(frozen=True)
class AngleInTorque(Misread):
    """A torque sensor feels where the joint stands: a cable that pulls at the sensor, once a turn."""

    channel, size = "tau", "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0)}
    formula: ClassVar = (["own phi, from home"], "a sin({times:.0f} phi + {phase_rad:.3g})", "N m")
    amplitude_Nm: float
    times: float
    phase_rad: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"times": float(rng.integers(4, 13)), "phase_rad": float(rng.uniform(-np.pi, np.pi))}

    def error(self, now: Instant) -> float:
        phi = now.readings.phi(now.seen, self.joint)
        return self.amplitude_Nm * math.sin(self.times * phi + self.phase_rad)


@dataclass(frozen=True)
class TorqueHum(Misread):
    """A hum of one frequency on a torque sensor, out of step with the motion."""

    channel, size = "tau", "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 20.0), "frequency_hz": (0.01, 500.0)}
    draws: ClassVar = {"frequency_hz": (0.9, 3.5)}
    formula: ClassVar = (["t"], "a sin(2 pi {frequency_hz:.4g} Hz t)", "N m")
    amplitude_Nm: float
    frequency_hz: float

    def error(self, now: Instant) -> float:
        return self.amplitude_Nm * math.sin(2.0 * np.pi * self.frequency_hz * now.time)


@dataclass(frozen=True)
class LooseBridge(Misread):
    """A torque sensor with the hysteresis of Bouc and Wen in its reading."""

    channel, size = "tau", "amplitude_Nm"
    ranges: ClassVar = {"amplitude_Nm": (0.0, 5.0)}
    formula: ClassVar = (["own tau, its history"], f"a z(tau), Bouc-Wen over {YIELD_NM:g} N m", "N m")
    amplitude_Nm: float

    def error_of_trial(self) -> Error:
        wen, last = BoucWen(self.amplitude_Nm, YIELD_NM, 0.5, 1.0), [math.nan]

        def error(now: Instant) -> float:
            rate = 0.0 if math.isnan(last[0]) else now.value - last[0]
            last[0] = now.value
            return wen.step(rate, 1.0)

        return error


@dataclass(frozen=True)
class DropoutsPhi(Misread):
    """A driven joint's encoder holds its last value for a while, again and again; the controller gets the same."""

    channel, size = "phi", "share"
    ranges: ClassVar = {"share": (0.0, 0.5), "draw": (0.0, 2.0**32)}
    formula: ClassVar = (["own phi, its history"], "the last value, held for a while", "1")
    share: float
    draw: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"draw": float(rng.integers(2**32))}

    def error_of_trial(self) -> Error:
        rng, mean_s = np.random.default_rng(int(self.draw)), 0.5 * sum(HELD_S)
        free_s = mean_s * (1.0 / self.share - 1.0)
        begin, until, held = float(rng.exponential(free_s)), 0.0, 0.0

        def error(now: Instant) -> float:
            nonlocal begin, until, held
            if now.time >= begin:
                until, held = begin + float(rng.uniform(*HELD_S)), now.value
                begin = until + float(rng.exponential(free_s))
            return held - now.value if now.time < until else 0.0

        return error


@dataclass(frozen=True)
class DropoutsTheta(DropoutsPhi):
    """The same of a gimbal's encoder."""

    channel = "theta"
    formula: ClassVar = (["own theta, its history"], "the last value, held for a while", "1")


@dataclass(frozen=True)
class TorqueRamp(Misread):
    """A torque sensor's zero drifts steadily, in every trial anew."""

    channel, size, either_sign = "tau", "rate_Nmps", True
    ranges: ClassVar = {"rate_Nmps": (-1.0, 1.0)}
    formula: ClassVar = (["t"], "a t", "N m/s")
    rate_Nmps: float

    def error(self, now: Instant) -> float:
        return self.rate_Nmps * now.time


@dataclass(frozen=True)
class TorqueWalk(Misread):
    """A torque sensor's zero walks at random, each trial's way its own."""

    channel, size = "tau", "walk_Nm_per_sqrt_s"
    ranges: ClassVar = {"walk_Nm_per_sqrt_s": (0.0, 1.0), "draw": (0.0, 2.0**32)}
    formula: ClassVar = (["t"], "a random walk", "N m/s^0.5")
    walk_Nm_per_sqrt_s: float
    draw: float

    @classmethod
    def others(cls, ground: Ground, place: Place, rng: np.random.Generator) -> dict[str, float]:
        return {"draw": float(rng.integers(2**32))}

    def error_of_trial(self) -> Error:
        rng, at, walked = np.random.default_rng(int(self.draw)), 0.0, 0.0

        def error(now: Instant) -> float:
            nonlocal at, walked
            walked += self.walk_Nm_per_sqrt_s * float(np.sqrt(now.time - at) * rng.standard_normal())
            at = now.time
            return walked

        return error


@dataclass(frozen=True)
class DeadBand(Misread):
    """A torque sensor that does not answer to a change within a band around the torque at home, and to less beyond."""

    channel, size = "tau", "half_width_Nm"
    ranges: ClassVar = {"half_width_Nm": (0.0, 10.0), "centre_Nm": (-20.0, 20.0)}
    formula: ClassVar = (["own tau"], "-(tau - {centre_Nm:.3g} N m), and beyond +-a no more than that", "N m")
    half_width_Nm: float
    centre_Nm: float

    @classmethod
    def drawn(cls, size: float, ground: Ground, place: Place, rng: np.random.Generator) -> Form:
        centre = float(ground.torque_Nm[place["robot"] - 1, place["joint"] - 1])
        return cls(**place, half_width_Nm=size, centre_Nm=centre)

    def error(self, now: Instant) -> float:
        return -min(max(now.value - self.centre_Nm, -self.half_width_Nm), self.half_width_Nm)
