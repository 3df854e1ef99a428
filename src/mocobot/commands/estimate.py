"""``mocobot estimate``: read recordings, estimate what they hold, write and print it."""

from collections.abc import Iterator
from dataclasses import asdict

from estimator.estimate.result import PayloadEstimate
from estimator.files import write_json
from estimator.recording.model import Recording
from mocobot.api.estimation import estimate
from mocobot.api.given import Logs
from mocobot.files.provenance import provenance
from mocobot.files.targets import calibration_file, map_file
from mocobot.options import Estimate
from mocobot.progress import stages
from mocobot.strict import NotGood
from mocobot_logs.convert_report import format_on_the_fly


def run(options: Estimate) -> None:
    """Run the command.

    Raises:
        InputError: recordings that cannot be used, or an output that cannot be written.
        NotGood: with ``strict``, the estimate is flagged, or says nothing.
    """
    inputs = [*options.rec, *map_file(options.map), *calibration_file(options.calibration)]
    logs = Logs(options.map)
    with stages() as (say, _):

        def each() -> Iterator[Recording]:
            for path in options.rec:
                say(f"reading {path.name}")
                yield logs.read(path)
            logs.check_map()

        found = estimate(
            each(), calibration=options.calibration, self_calibrate=options.self_calibrate,
            method=options.method, cutoff_hz=options.cutoff_hz, say=say,
        )  # fmt: skip
    if options.out:
        made = provenance("estimate", asdict(options), inputs)
        write_json(options.out, found.to_dict() | {"provenance": made})
    for path, converted in logs.converted.items():
        print(format_on_the_fly(converted, str(path)))
    print(found)
    if options.strict:
        _expect_good(found)


def _expect_good(found: PayloadEstimate) -> None:
    if found.flags:
        raise NotGood(f"the estimate is flagged: {found.flags[0]}")
    if found.mass is None and found.grasps is None:
        raise NotGood("the recordings determine neither mass nor grasps")
