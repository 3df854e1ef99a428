"""The design numbers of the repository's own robot, for tests."""

from pathlib import Path

from estimator.arm.design import load_design

OMNID_FOLDER = Path(__file__).parents[2] / "models" / "omnid"
DESIGN = load_design(OMNID_FOLDER / "design.toml")
