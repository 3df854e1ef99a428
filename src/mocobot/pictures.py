"""Pictures without a screen: teams at rest, teams as estimated, and models in any state."""

from estimator.files import make_folder
from mocobot_view.pictures.camera import Camera
from mocobot_view.pictures.marks import Marks
from mocobot_view.pictures.render import render
from mocobot_view.pictures.views import estimate_view, team_view

__all__ = ["Camera", "Marks", "estimate_view", "make_folder", "render", "team_view"]
