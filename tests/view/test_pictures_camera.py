"""Where points lie in a picture, against MuJoCo's own renderer; and cameras that have everything in sight."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mocobot_view.camera import (
    MARGIN,
    NEAREST,
    Camera,
    Label,
    Marks,
    clearest,
    corners,
    framing,
    pixels,
    with_labels,
)
from mocobot_view.render import render
from rendering import made

EMPTY = "<mujoco><visual><global fovy='30'/></visual><worldbody><light pos='0 0 5'/></worldbody></mujoco>"
BOXES = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.1"/>
    <body pos="1 0 0.5" euler="0 0 90">
      <joint name="lift" type="slide" axis="0 0 1"/>
      <geom type="box" size="0.3 0.1 0.2"/>
      <geom type="sphere" size="5" group="3"/>
    </body>
  </worldbody>
</mujoco>
"""
DIRECTIONS = {"azimuth": st.floats(-180.0, 180.0), "elevation": st.floats(-89.0, 60.0)}


def test_points_lie_where_mujoco_draws_them() -> None:
    points = np.array([[0.3, -0.2, 0.1], [-0.4, 0.35, 0.6], [0.0, 0.0, 0.0], [1.1, 0.7, -0.3]])
    camera, width, height = Camera((0.1, 0.0, 0.2), 3.0, 70.0, -25.0), 480, 360
    marks = []
    for point in points:
        marks.append(Marks())
        marks[-1].ellipsoid(point, 0.04, (1.0, 1.0, 1.0, 1.0))
    model = mujoco.MjModel.from_xml_string(EMPTY)
    pictures = made(render(model, [np.zeros(0)] * len(points), camera, marks, width, height))
    for picture, at in zip(pictures, pixels(camera, points, width, height, 30.0), strict=True):
        rows, columns = np.nonzero(picture.max(axis=-1) > 40)
        assert len(rows) > 50
        middle = 0.5 * np.array([columns.min() + columns.max() + 1, rows.min() + rows.max() + 1])
        assert middle == pytest.approx(at, abs=1.0)


def test_what_is_behind_the_camera_is_nowhere() -> None:
    camera = Camera((0.0, 0.0, 0.0), 2.0, 0.0, 0.0)  # at x = -2, looking along x
    at = pixels(camera, [[1.0, 0.0, 0.0], [-3.0, 0.0, 0.0]], 100, 50, 45.0)
    assert at[0] == pytest.approx([50.0, 25.0])
    assert np.isnan(at[1]).all()


def test_corners_are_those_of_what_is_visible_and_bounded() -> None:
    """A box turned by 90 deg and lifted by 1 m; neither the floor nor what only collides."""
    model = mujoco.MjModel.from_xml_string(BOXES)
    found = corners(model, np.array([1.0]))
    assert found.shape == (8, 3)
    assert found.min(axis=0) == pytest.approx([0.9, -0.3, 1.3])
    assert found.max(axis=0) == pytest.approx([1.1, 0.3, 1.7])


@given(
    seed=st.integers(0, 10_000),
    count=st.integers(1, 12),
    aspect=st.sampled_from([0.6, 1.0, 1.6]),
    fovy=st.sampled_from([28.0, 60.0]),
    **DIRECTIONS,
)
@settings(max_examples=150, deadline=None)
def test_everything_is_in_sight_and_no_nearer_camera_has_it(
    seed: int, count: int, aspect: float, fovy: float, azimuth: float, elevation: float
) -> None:
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3)) * [2.0, 0.5, 1.0] + [3.0, 0.0, 1.0]
    camera = framing(points, azimuth, elevation, aspect, fovy)
    at = pixels(camera, points, aspect, 1.0, fovy) / [aspect, 1.0]
    low, high = at.min(axis=0), at.max(axis=0)
    assert (low >= MARGIN - 1e-9).all()
    assert (high <= 1.0 - MARGIN + 1e-9).all()
    assert low + high == pytest.approx([1.0, 1.0], abs=1e-6), "as much room on either side"
    depth = (camera.axes() @ (points - camera.lookat).T)[2] + camera.distance
    spread = np.linalg.norm(np.ptp(camera.axes() @ points.T, axis=1)) or 1.0
    assert depth.min() >= NEAREST * spread - 1e-9
    if depth.min() > NEAREST * spread + 1e-9:
        assert (high - low).max() == pytest.approx(1.0 - 2.0 * MARGIN, abs=1e-6), "as near as can be"


def test_words_are_written_where_their_points_are() -> None:
    grey = np.full((200, 400, 3), 128, dtype=np.uint8)
    label = Label("omnid1", (0.0, 0.0, 0.0), (255, 0, 0))
    written = with_labels(grey, [label], np.array([[300.0, 50.0]])).astype(int)
    rows, columns = np.nonzero(np.abs(written - 128).max(axis=-1) > 20)
    assert 0.5 * (rows.min() + rows.max()) == pytest.approx(50.0, abs=3.0)
    assert 0.5 * (columns.min() + columns.max()) == pytest.approx(300.0, abs=3.0)
    red = (written[..., 0] > 200) & (written[..., 1:].max(axis=-1) < 60)
    assert red.sum() > 40
    assert grey.max() == 128, "the picture itself stays as it is"


def test_words_do_not_cover_each_other_nor_leave_the_picture() -> None:
    grey = np.full((200, 400, 3), 128, dtype=np.uint8)
    colours = ((255, 0, 0), (0, 255, 0), (0, 0, 255))
    labels = [Label("joint_friction", (0.0, 0.0, 0.0), colour) for colour in colours]
    written = with_labels(grey, labels, np.array([[395.0, 100.0], [396.0, 100.3], [397.0, 100.6]])).astype(
        int
    )
    rows = []
    for colour in range(3):
        others = [k for k in range(3) if k != colour]
        pure = (written[..., colour] > 180) & (written[..., others].max(axis=-1) < 80)
        rows.append(np.flatnonzero(pure.any(axis=1)))
    alone = with_labels(grey, labels[:1], np.array([[200.0, 100.0]])).astype(int)
    assert rows[0].max() < rows[1].min() <= rows[1].max() < rows[2].min(), "the upper ones moved up"
    red = lambda p: ((p[..., 0] > 180) & (p[..., 1:].max(axis=-1) < 80)).sum()  # noqa: E731
    assert red(written) == pytest.approx(red(alone), rel=0.1), "none of it is cut off"
    outside = with_labels(grey, labels[:2], np.array([[-1.0, 3.0], [np.nan, np.nan]]))
    assert (outside == 128).all()


def test_robots_are_seen_side_by_side() -> None:
    """Not one above the other, although they would be as far apart in the picture: they are tall."""
    feet = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    camera = clearest(feet, feet, azimuth=0.0, elevation=-36.0, aspect=1.0, fovy_deg=40.0)
    across = np.sort(pixels(camera, feet, 1.0, 1.0, 40.0)[:, 0])
    assert np.diff(across).min() > 0.25
