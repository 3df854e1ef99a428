"""``mocobot simulate``: simulate one trial, write its recording and the truth beside it."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from estimator.errors import InputError
from estimator.recording.parquet import write_recording
from mocobot.files.targets import check_target
from mocobot.progress import bar
from mocobot_sim.extended.extended import load_extended
from mocobot_sim.trial.sensors import sensor_preset
from mocobot_sim.trial.simulate import TrialRequest, simulate
from mocobot_sim.trial.truth import write_truth

if TYPE_CHECKING:
    from mocobot.options import Simulate


def run(options: Simulate) -> None:
    """Run the command.

    Raises:
        InputError: an option that cannot be met, or an output that cannot be written.
        TrialError: the physics of the trial cannot be trusted.
    """
    if options.out.suffix != ".parquet":
        raise InputError(f"{options.out}: the file's name must end in .parquet")
    check_target(options.out)
    for option, value, trajectory in (
        ("--vias", options.vias, "random"),
        ("--duration", options.duration, "periodic"),
    ):
        if value is not None and options.trajectory != trajectory:
            raise InputError(f"{option} is for a {trajectory} trajectory; this one is {options.trajectory}")
    if options.model is not None and options.payload is not None:
        raise InputError(
            "--payload and --model are both given; the model has its own payload, so leave one out"
        )
    scene = load_extended(options.model) if options.model is not None else None
    label = (
        options.payload or "a" if options.model is None else os.path.basename(os.path.realpath(options.model))
    )
    given = {"vias": options.vias, "duration_s": options.duration}
    request = TrialRequest(label, options.trajectory, options.seed)
    request = replace(request, **{name: value for name, value in given.items() if value is not None})
    with bar(None, "simulating", "sample") as advance:
        done = simulate(request, [sensor_preset(options.preset)], progress=advance, scene=scene)
    recording = done.recordings[options.preset]
    metadata = replace(recording.metadata, level=options.level)
    write_recording(replace(recording, metadata=metadata), options.out)
    write_truth(done.truth, options.out)
    print(
        f"{options.out}: {done.log.time[-1]:.1f} s of {options.trajectory} motion, {options.preset} sensors"
    )
