"""Off-screen pictures of teams at rest, of estimated teams, and of models in any state."""

from estimator.files import make_folder
from mocobot_view.camera import Camera, Marks
from mocobot_view.pictures import estimate_view, team_view
from mocobot_view.render import render

__all__ = ["Camera", "Marks", "estimate_view", "make_folder", "render", "team_view"]
