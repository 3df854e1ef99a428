"""All forms by name: other forms of listed causes, and what no catalogue lists."""

from __future__ import annotations

from sealed.forms.base import Form
from sealed.forms.cables import PayloadCable, RobotCable, RubberCord, StiffeningStrap
from sealed.forms.creep import LateCreep
from sealed.forms.drags import PowerDrag, QuadraticDrag, TurningDrag
from sealed.forms.friction import DrivenDahl, DrivenLugre, GimbalDahl, GimbalLugre
from sealed.forms.grasps import SlowBaseCompliance, SlowGrasp, SoftPlay, TurningGrasp
from sealed.forms.lags import SecondOrderTorqueLag, SingleTorqueLag
from sealed.forms.masses import MassDrift, MassOfTrials
from sealed.forms.pendulums import DoublePendulum, UnequalPendulum
from sealed.forms.pushes import HalfSinePush, RampPush
from sealed.forms.springs import BoucWenSpring
from sealed.unlisted.encoders import (
    CyclicPhi,
    EccentricPhi,
    EccentricTheta,
    EncoderBacklash,
    SlippingZero,
    SoftEncoderMount,
)
from sealed.unlisted.faults import DeadBand, DropoutsPhi, DropoutsTheta, TorqueRamp, TorqueWalk
from sealed.unlisted.outside import FineInterpolation, LooseBridge, ScratchedDisc, SlackHose, SoftSaturation
from sealed.unlisted.readings import (
    AngleInTorque,
    CrossTalk,
    QuadraticReading,
    Saturation,
    TorqueBacklash,
    TorqueHum,
    WarmingScale,
    WarmingZero,
)
from sealed.unlisted.torques import CableSpring, Cogging, CubicSpring, DoorCloser
from sealed.unlisted.wrenches import GrowingPush, Gyroscope, Shaker, ShiftingLoad, SinkingBase

LISTED: tuple[type[Form], ...] = (
    DrivenLugre,
    DrivenDahl,
    GimbalLugre,
    GimbalDahl,
    BoucWenSpring,
    SoftPlay,
    SlowGrasp,
    TurningGrasp,
    SlowBaseCompliance,
    LateCreep,
    RampPush,
    HalfSinePush,
    DoublePendulum,
    UnequalPendulum,
    SecondOrderTorqueLag,
    SingleTorqueLag,
    PayloadCable,
    RobotCable,
    StiffeningStrap,
    RubberCord,
    TurningDrag,
    PowerDrag,
    MassDrift,
    MassOfTrials,
)
UNLISTED: tuple[type[Form], ...] = (
    CrossTalk,
    WarmingScale,
    WarmingZero,
    Saturation,
    QuadraticReading,
    AngleInTorque,
    TorqueHum,
    EccentricPhi,
    EccentricTheta,
    CyclicPhi,
    EncoderBacklash,
    SoftEncoderMount,
    SlippingZero,
    Cogging,
    CubicSpring,
    CableSpring,
    DoorCloser,
    GrowingPush,
    Shaker,
    Gyroscope,
    ShiftingLoad,
    SinkingBase,
)
OUTSIDE: tuple[type[Form], ...] = (ScratchedDisc, SoftSaturation, LooseBridge, FineInterpolation, SlackHose)
"""Unlisted ones whose formula the dictionary of laws does not have either."""
FAULTY: tuple[type[Form], ...] = (DropoutsPhi, DropoutsTheta, TorqueRamp, TorqueWalk, DeadBand)
"""Unlisted ones of which sensors wear out."""
FAULTS = (*FAULTY, CrossTalk, EccentricPhi, EccentricTheta, MassDrift, HalfSinePush)
"""These, and others that come with use: drawn by themselves."""
KNOWN: tuple[type[Form], ...] = (QuadraticDrag, TorqueBacklash)
"""Listed ones whose law the catalogue has by now: hidden by name only."""
FORMS: dict[str, type[Form]] = {form.cause: form for form in (*LISTED, *KNOWN, *UNLISTED, *OUTSIDE, *FAULTY)}
