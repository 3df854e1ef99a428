"""``mocobot calibrate``: read recordings, find out how the robots differ from their design, write and print it."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path

from estimator.errors import InputError
from estimator.files import whole_folder
from mocobot.api.calibration import WEIGHED, calibrate
from mocobot.api.given import Logs
from mocobot.files.calibrations import write_into
from mocobot.files.provenance import provenance
from mocobot.files.targets import map_file
from mocobot.options import Calibrate
from mocobot.progress import stages
from mocobot.strict import NotGood
from mocobot_logs.convert_report import format_on_the_fly


def run(options: Calibrate) -> None:
    """Run the command.

    Raises:
        InputError: recordings or options that cannot be used, or an output that cannot be written.
        NotGood: with ``strict``, there are findings.
    """
    files = [*options.rec, *options.free]
    labels, masses = _labels(options.payload_of, options.rec), _masses(options.known_mass)
    inputs = [*files, *([options.prior] if options.prior else []), *map_file(options.map)]
    logs, notes = Logs(options.map), []
    with (
        whole_folder(options.out, "calibration") if options.out else nullcontext() as folder,
        stages() as (say, _),
    ):
        read = []
        for path in files:
            say(f"reading {path.name}")
            read.append(logs.read(path))
        logs.check_map()
        held = read[: len(options.rec)]
        found = calibrate(
            held,
            free=read[len(options.rec) :],
            prior=options.prior,
            payload_of={
                one.name: labels[path] for one, path in zip(held, options.rec, strict=True) if path in labels
            },
            known_mass=masses,
            parallel_flanges=options.parallel_flanges,
            tilt=options.tilt,
            arm_masses=options.arm_masses,
            say=say,
        )
        if folder is not None:
            say("write")
            notes = write_into(folder, found, provenance("calibrate", asdict(options), inputs))
    for path, converted in logs.converted.items():
        print(format_on_the_fly(converted, str(path)))
    print(found)  # after the folder is in place: whoever reads may close the pipe
    if options.out:
        print("\n".join([f"\nWritten to {options.out}.", *(f"But {note}." for note in notes)]))
    if options.strict and found.findings:
        raise NotGood(f"the calibration is not to be trusted: {found.findings[0].rstrip('.')}")


def _labels(given: Sequence[str], recordings: Sequence[Path]) -> dict[Path, str]:
    """Labels by recording."""
    out: dict[Path, str] = {}
    for entry in given:
        name, equals, label = entry.rpartition("=")
        path = next((p for p in recordings if name and name in (str(p), p.name)), None)
        if not equals or not label or path is None:
            raise InputError(
                f"--payload-of is {entry!r}; it must be REC=LABEL with one of the recordings "
                f"{', '.join(map(str, recordings))}"
            )
        if path in out:
            raise InputError(f"--payload-of names {path} twice")
        out[path] = label
    return out


def _masses(given: Sequence[str]) -> dict[str, float | tuple[float, float]]:
    """Mass and standard error [kg] by label, "" for that of the only payload."""
    out: dict[str, float | tuple[float, float]] = {}
    for entry in given:
        label, _, rest = entry.rpartition("=")
        number, plus_minus, error = rest.partition("+-")
        try:
            mass = float(number)
            se = float(error) if plus_minus else WEIGHED * mass
        except ValueError:
            mass = se = float("nan")
        if not (0 < mass < 1e6 and 0 < se < 1e6):
            raise InputError(
                f"--known-mass is {entry!r}; it must be [LABEL=]KG or [LABEL=]KG+-SE with numbers greater than 0, such "
                "as c=10.48+-0.005"
            )
        if label in out:
            raise InputError(f"--known-mass names payload {label!r} twice")
        out[label] = mass, se
    return out
