"""Read the benchmark's MAT files; whatever they log of injected pulses is left unread."""

from pathlib import Path

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from discrepancy.emps.recording.axis_log import AxisLog
from discrepancy.emps.recording.sampling import on_grid
from discrepancy.emps.recording.whole import is_whole
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.inputs import open_input
from estimator.quantisation import Repeats

SERIES = {
    "t": "time [s]",
    "qm": "measured position [m]",
    "qg": "reference position [m]",
    "vir": "drive voltage [V]",
}
NUMBERS = {"gtau": "drive gain [N/V]", "kp": "position loop [1/s]", "kv": "velocity loop [V s/m]"}


def read_emps(path: Path) -> AxisLog:
    """Read one recording.

    Variables (MATLAB 5 to 7.2): vectors ``t``, ``qm``, ``qg``, ``vir`` of one length, numbers ``gtau``, ``kp``, ``kv``;
    others are ignored and not even loaded. Stamps may miss some samples of an even grid; see ``sampling.on_grid``.

    Raises:
        InputError: the file cannot be read or is no such recording.
    """
    try:
        if not is_whole(path):
            raise InputError(
                f"{path}: is cut off: what its last variable should have goes beyond the end of the file"
            )
        with open_input(path) as file:
            found = loadmat(file, variable_names=[*SERIES, *NUMBERS])
    except InputError:
        raise
    except NotImplementedError as error:
        raise InputError(f"{path}: is a MATLAB 7.3 file; save it with -v7 instead") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from error
    except (MatReadError, ValueError, TypeError, KeyError, EOFError, MemoryError, IndexError) as error:
        raise InputError(f"{path}: is not a MATLAB file that can be read") from error
    except Exception as error:  # whatever a damaged file makes of the parser, such as zlib.error
        raise InputError(f"{path}: is not a MATLAB file that can be read ({type(error).__name__})") from error
    wanted = SERIES | NUMBERS
    missing = [name for name in wanted if name not in found]
    if missing:
        names = ", ".join(f"{name} ({wanted[name]})" for name in missing)
        raise InputError(f"{path}: lacks {names}; an EMPS recording has {', '.join(wanted)}")
    series = {name: _vector(path, name, found[name]) for name in SERIES}
    lengths = {name: len(values) for name, values in series.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise InputError(f"{path}: the series have different lengths ({listed})")
    numbers = {name: _number(path, name, found[name]) for name in NUMBERS}
    repeats = Repeats([2]).of(np.column_stack([series[name] for name in ("qm", "qg", "vir")]))
    series = {name: values[~repeats] for name, values in series.items()}
    time, others, usable, notes = on_grid(str(path), series.pop("t"), series)
    if repeats.any():
        notes = [f"{repeats.sum()} rows repeat the one before, and a reading counts once.", *notes]
    return AxisLog(
        path.name,
        time,
        others["qm"],
        others["qg"],
        others["vir"],
        numbers["gtau"],
        numbers["kp"],
        numbers["kv"],
        usable,
        tuple(notes),
    )


def _vector(path: Path, name: str, values: object) -> Array:
    array = _real(path, name, values)
    if array.ndim > 2 or (array.ndim == 2 and min(array.shape) != 1) or array.size < 2:
        shape = " x ".join(map(str, array.shape))
        raise InputError(f"{path}: {name} has shape {shape}; it must be a vector, one number per sample")
    flat = array.ravel()
    bad = np.flatnonzero(~np.isfinite(flat))
    if len(bad):
        many = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
        raise InputError(f"{path}: {name} is {flat[bad[0]]} in sample {bad[0] + 1}{many}; it must be finite")
    return flat


def _number(path: Path, name: str, values: object) -> float:
    array = _real(path, name, values)
    if array.size != 1:
        shape = " x ".join(map(str, array.shape))
        raise InputError(f"{path}: {name} has shape {shape}; it must be one number")
    value = float(array.ravel()[0])
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{path}: {name} is {value:g}; it must be a positive number")
    return value


def _real(path: Path, name: str, values: object) -> Array:
    array = np.asarray(values)
    if array.dtype.kind not in "fiub":
        raise InputError(f"{path}: {name} does not hold real numbers")
    return array.astype(np.float64)
