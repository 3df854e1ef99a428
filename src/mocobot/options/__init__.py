"""Options of every command, as the command line shows them: data only, so that the help needs nothing else."""

from mocobot.options.answers import Calibrate, Diagnose, Estimate, Watch
from mocobot.options.campaign import Campaign
from mocobot.options.logs import Convert, Inspect, Map
from mocobot.options.results import Compare, Paper, Report
from mocobot.options.simulation import Effects, Replay, Simulate

__all__ = [
    "Calibrate",
    "Campaign",
    "Compare",
    "Convert",
    "Diagnose",
    "Effects",
    "Estimate",
    "Inspect",
    "Map",
    "Paper",
    "Replay",
    "Report",
    "Simulate",
    "Watch",
]
