"""Simulate mobile cobots that carry an unknown payload, estimate it, and find out what the simulation gets wrong.

The names in ``__all__`` are the public ones (docs/api.md); each is imported when it is first used, so that
``import mocobot`` costs nothing.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any


def _one_thread() -> None:
    """One thread for matrices: how many there are decides how sums round.

    The matrices are small, too: threads that fight over them make a diagnosis several times slower on a busy machine.
    OpenBLAS reads the variable when it is loaded; where numpy or scipy is there already, its own must be told.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    for name in ("numpy.linalg._umath_linalg", "scipy.linalg._fblas"):
        if name.partition(".")[0] in sys.modules:
            import ctypes  # takes longer than the rest of ``import mocobot``

            library = ctypes.CDLL(import_module(name).__file__)  # names are looked up in what it links, too
            for kind in ("scipy_openblas_%s64_", "scipy_openblas_%s", "openblas_%s64_", "openblas_%s"):
                if hasattr(library, kind % "set_num_threads"):
                    getattr(library, kind % "set_num_threads")(1)


_one_thread()

if TYPE_CHECKING:
    from estimator.errors import InputError as InputError
    from estimator.inputs import set_max_unpacked as set_max_unpacked
    from estimator.recording.model import Recording as Recording
    from estimator.recording.parquet import read_recording as read_recording
    from estimator.recording.parquet import write_recording as write_recording
    from mocobot import bases as bases
    from mocobot import guiding as guiding
    from mocobot import pictures as pictures
    from mocobot import robots as robots
    from mocobot import serial as serial
    from mocobot import trajectories as trajectories
    from mocobot.api.calibration import Calibration as Calibration
    from mocobot.api.calibration import calibrate as calibrate
    from mocobot.api.calibration import read_calibration as read_calibration
    from mocobot.api.comparison import Comparison as Comparison
    from mocobot.api.comparison import compare as compare
    from mocobot.api.conversion import Conversion as Conversion
    from mocobot.api.conversion import MapDraft as MapDraft
    from mocobot.api.conversion import convert as convert
    from mocobot.api.conversion import convert_parts as convert_parts
    from mocobot.api.conversion import map as map
    from mocobot.api.diagnosis import Cause as Cause
    from mocobot.api.diagnosis import Diagnosis as Diagnosis
    from mocobot.api.diagnosis import diagnose as diagnose
    from mocobot.api.estimation import Estimate as Estimate
    from mocobot.api.estimation import estimate as estimate
    from mocobot.api.estimation import read_estimate as read_estimate
    from mocobot.api.inspection import Inspection as Inspection
    from mocobot.api.inspection import inspect as inspect
    from mocobot.api.replay import replay as replay
    from mocobot.api.simulation import SimulatedRecording as SimulatedRecording
    from mocobot.api.simulation import simulate as simulate
    from mocobot.api.simulation import simulate_trials as simulate_trials
    from mocobot.api.watch import Watched as Watched
    from mocobot.api.watch import report as report
    from mocobot.api.watch import watch as watch
    from mocobot.options import CalibrateOptions as CalibrateOptions
    from mocobot.options import ConvertOptions as ConvertOptions
    from mocobot.options import DiagnoseOptions as DiagnoseOptions
    from mocobot.options import EstimateOptions as EstimateOptions
    from mocobot.options import InspectOptions as InspectOptions
    from mocobot.options import MapOptions as MapOptions
    from mocobot.options import ReplayOptions as ReplayOptions
    from mocobot.options import SimulateOptions as SimulateOptions
    from mocobot.options import WatchOptions as WatchOptions
    from mocobot_sim.effects.base import Effect as Effect
    from mocobot_sim.effects.catalogue import EFFECTS as EFFECTS
    from mocobot_sim.effects.catalogue import apply_effects as apply_effects
    from mocobot_sim.effects.catalogue import make_effect as make_effect
    from mocobot_sim.errors import TrialError as TrialError
    from mocobot_sim.scene.scene import TeamScene as TeamScene
    from mocobot_sim.scene.scene import build_team as build_team
    from mocobot_sim.trial.sensors import PRESETS as PRESETS
    from mocobot_sim.trial.sensors import SensorPreset as SensorPreset
    from mocobot_sim.trial.sensors import measure as measure
    from mocobot_sim.trial.trial import run_trial as run_trial
    from mocobot_sim.trial.trial_log import TrialLog as TrialLog
    from mocobot_sim.trial.truth import GroundTruth as GroundTruth

_NAMES = {
    "estimator.errors": "InputError",
    "estimator.recording.model": "Recording",
    "estimator.recording.parquet": "read_recording write_recording",
    "estimator.inputs": "set_max_unpacked",
    "mocobot": "bases guiding pictures robots serial trajectories",
    "mocobot.api.calibration": "Calibration calibrate read_calibration",
    "mocobot.api.comparison": "Comparison compare",
    "mocobot.api.conversion": "Conversion MapDraft convert convert_parts map",
    "mocobot.api.diagnosis": "Cause Diagnosis diagnose",
    "mocobot.api.estimation": "Estimate estimate read_estimate",
    "mocobot.api.inspection": "Inspection inspect",
    "mocobot.api.replay": "replay",
    "mocobot.api.simulation": "SimulatedRecording simulate simulate_trials",
    "mocobot.api.watch": "Watched report watch",
    "mocobot.options": "CalibrateOptions ConvertOptions DiagnoseOptions EstimateOptions InspectOptions MapOptions "
    "ReplayOptions SimulateOptions WatchOptions",
    "mocobot_sim.effects.base": "Effect",
    "mocobot_sim.effects.catalogue": "EFFECTS apply_effects make_effect",
    "mocobot_sim.errors": "TrialError",
    "mocobot_sim.scene.scene": "TeamScene build_team",
    "mocobot_sim.trial.sensors": "PRESETS SensorPreset measure",
    "mocobot_sim.trial.trial": "run_trial",
    "mocobot_sim.trial.trial_log": "TrialLog",
    "mocobot_sim.trial.truth": "GroundTruth",
}
"""Public names by the module that defines them; modules of this package are themselves public."""
_HOMES = {name: home for home, names in _NAMES.items() for name in names.split()}

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    """A public name, imported now (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES[name]
    found = import_module(f"{home}.{name}") if home == __name__ else getattr(import_module(home), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    """What a notebook completes."""
    return sorted(__all__)
