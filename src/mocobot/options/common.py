"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import tyro

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]
Force = Annotated[Flag, tyro.conf.arg(help="Replace what exists there; nothing is overwritten without it.")]
Scheduler = Annotated[
    str | None,
    tyro.conf.arg(
        metavar="tcp://HOST:PORT|FILE",
        help="Run on the workers of a Dask scheduler, by its address or its scheduler file (docs/commands/cluster.md).",
    ),
]
Model = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="ROBOT.xml",
        help="MJCF or URDF of one fixed-base robot whose joints were logged (docs/serial/guide.md), not a team.",
    ),
]
Calibrated = Annotated[
    Path | None,
    tyro.conf.arg(
        metavar="CALIBRATION.json",
        help="The robots as `mocobot calibrate` found them, in place of what the recordings say of them.",
    ),
]
MaxUnpacked = Annotated[
    float | None,
    tyro.conf.arg(
        metavar="GIB",
        help="Most that each file may unpack to; 100 times its size, at least 0.25 and at most 4 GiB, if not given.",
    ),
]
