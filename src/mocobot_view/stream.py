"""Log replays to Rerun (robots, payload, causes, series, summary) and send them to a file, browser or viewer."""

import os
import shutil
import sys
import warnings
import webbrowser
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import ArrayLike
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from discrepancy.result.read import VERDICTS, WrittenDiagnosis
from estimator.arm.unit import frames_said
from estimator.arrays import Array
from estimator.errors import InputError
from estimator.files import whole_file
from estimator.statistics import rms, rms_length
from mocobot_view import colours
from mocobot_view.blueprint import TIMELINE, blueprint, log_keys, trail_paths
from mocobot_view.colours import FORCE_M_PER_N, FRAME_M, MARK_M, Colour
from mocobot_view.payload import BodyFacts, Grasps
from mocobot_view.replay_trial import ReplayTrial
from mocobot_view.robot import PATHS, TINTED, by_place, fixed_frames, robot_shapes
from mocobot_view.shapes import Shape
from mocobot_view.two_bodies import TwoBodyMotion


def time_column(time: Array) -> rr.TimeColumn:
    """Make the timeline's column for times [s], rounded to nanoseconds because the SDK would truncate."""
    return rr.TimeColumn(TIMELINE, duration=np.round(1e9 * time).astype("timedelta64[ns]"))


def send(stream: rr.RecordingStream, path: str, time: Array, columns: Iterable[rr.ComponentColumn]) -> None:
    """Log columns of one entity at times [s]."""
    stream.send_columns(path, [time_column(time)], columns)


def send_poses(
    stream: rr.RecordingStream, path: str, time: Array, position: Array | None, quaternion: Array | None
) -> None:
    """Log the pose of an entity in its parent: positions [m], (Q, 3), and quaternions (x, y, z, w), (Q, 4).

    None stands for a zero position or no rotation. Values are in single precision, which resolves 0.1 um at 1 m.
    """
    place, turn = (None if part is None else part.astype(np.float32) for part in (position, quaternion))
    send(stream, path, time, rr.Transform3D.columns(translation=place, quaternion=turn))


TRAIL_HZ = 25.0  # segments of a drawn wrist path per second [Hz]; the series contain all samples. Chosen.


def log_robots(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all robots below the root of the trial."""
    shapes = robot_shapes(trial.recording.metadata.design)
    for i in range(trial.robots):
        robot = f"{trial.name}/omnid{i + 1}"
        turn = Rotation.from_matrix(trial.bases.R_Wb[i]).as_quat()
        standing = rr.Transform3D(translation=trial.bases.p_Wb[i], quaternion=turn)
        stream.log(f"{robot}/base", standing, static=True)
        log_shape(stream, f"{robot}/base/shape", shapes.standing)
        foot = [0.0, 0.0, 0.02 - shapes.base_height_m]
        log_label(stream, f"{robot}/base/name", foot, f"omnid{i + 1}", colours.of_robot(i + 1))
        for path, (position, quaternion) in fixed_frames(trial.recording.metadata.design).items():
            fixed = rr.Transform3D(translation=position, quaternion=rr.Quaternion(xyzw=quaternion))
            stream.log(f"{robot}/{path}", fixed, static=True)
        send_poses(stream, f"{robot}/{PATHS['platform']}", trial.time, trial.bodies.wrist[:, i], None)
        for body, turn in trial.bodies.turns.items():
            send_poses(stream, f"{robot}/{PATHS[body]}", trial.time, None, turn[:, i])
        for body, shape in shapes.moving.items():
            tinted = shape.in_colour(colours.of_robot(i + 1)) if body in TINTED else shape
            log_shape(stream, f"{robot}/{PATHS[body]}/shape", tinted)
        _log_paths(stream, trial, i)
        _log_force(stream, trial, i)


def log_causes(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Mark every cause of the diagnosis at its place; causes at one place share a mark."""
    named = trial.diagnosis.causes if trial.diagnosis else ()
    for (robot, body), causes in by_place(named).items():
        position = np.zeros(3)
        place = "payload" if robot is None else f"omnid{robot}/{PATHS[body] if body else 'base'}"
        if robot is None and trial.facts is not None and trial.facts.p_1c is not None:
            position = trial.facts.p_1c
        path = f"{trial.name}/{place}/cause"
        label = ", ".join(f"! {cause.name}" for cause in causes)
        stream.log(path, rr.Points3D([position], colors=[colours.FAULT], radii=MARK_M), static=True)
        log_label(stream, f"{path}/name", position + np.array([0.0, 0.0, 2.0 * MARK_M]), label, colours.FAULT)


def log_label(
    stream: rr.RecordingStream, path: str, position: ArrayLike, text: str, colour: Colour, show: bool = True
) -> None:
    """Write a text at a point in the frame of the parent entity, in a colour for the viewer's dark labels."""
    pale = [colours.pale(colour)]
    stream.log(
        path, rr.Points3D([position], labels=[text], colors=pale, radii=0.001, show_labels=show), static=True
    )


def log_shape(stream: rr.RecordingStream, path: str, shape: Shape) -> None:
    """Log a coloured mesh as static data in the frame of the parent entity."""
    mesh = shape.triangles
    drawn = rr.Mesh3D(
        vertex_positions=mesh.vertices.astype(np.float32),
        vertex_normals=mesh.normals.astype(np.float32),
        triangle_indices=mesh.faces,
        vertex_colors=shape.rgba,
    )
    stream.log(path, drawn, static=True)


def _log_paths(stream: rr.RecordingStream, trial: ReplayTrial, i: int) -> None:
    """Log measured and commanded wrist positions in {b} as path segments."""
    every = slice(None, None, max(1, round(trial.recording.metadata.rate_hz / TRAIL_HZ)))
    path = trail_paths(trial)[i]
    paths, looks = [trial.bodies.wrist[:, i]], [(colours.of_robot(i + 1), 1.5)]
    if trial.recording.ref is not None:
        paths.append(trial.recording.ref[:, i])
        looks.append((colours.COMMAND, 1.0))
    corners = np.stack([p[every] for p in paths], axis=1).astype(np.float32)
    pieces = np.stack([corners[:-1], corners[1:]], axis=2)  # (pieces, paths, 2, 3)
    tones, radii = zip(*looks, strict=True)
    look = rr.LineStrips3D.from_fields(colors=tones, radii=rr.Radius.ui_points(radii))
    stream.log(path, look, static=True)
    strips = rr.LineStrips3D.columns(strips=pieces.reshape(-1, 2, 3))
    send(stream, path, trial.time[every][1:], strips.partition(np.full(len(pieces), len(paths))))


def _log_force(stream: rr.RecordingStream, trial: ReplayTrial, i: int) -> None:
    """Log the force of the robot on the payload in {i}, up to the end of the filtered data."""
    if trial.data is None:
        return
    path = f"{trial.name}/omnid{i + 1}/{PATHS['flange']}/force"
    force = trial.data.wrench[:, i, 3:]
    stream.log(path, rr.Arrows3D.from_fields(colors=colours.of_robot(i + 1), radii=0.008), static=True)
    time = np.append(trial.data.time, trial.data.time[-1] + 1.0 / trial.data.rate_hz)
    counts = np.append(np.ones(len(force), dtype=int), 0)
    vectors = (FORCE_M_PER_N * force).astype(np.float32)
    send(stream, path, time, rr.Arrows3D.columns(vectors=vectors).partition(counts))


def log_payload(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log the payload below the root of the trial in frame {1}; nothing if the grasps are unknown."""
    if trial.motion is None:
        return
    payload = f"{trial.name}/payload"
    send_poses(stream, payload, trial.time, trial.motion.p_W1, trial.motion.quaternion)
    if trial.shape is not None:
        log_shape(stream, f"{payload}/shape", trial.shape)
    if trial.two is not None:
        _log_second(stream, trial, trial.two)
    if trial.facts is not None:
        _log_facts(stream, f"{payload}/estimate", trial.facts, "", colours.ESTIMATE, thick=1.0)
    if trial.truth is not None:
        # Longer and thinner than the estimate, so that both are visible if they agree.
        _log_facts(stream, f"{payload}/truth", trial.truth, " true", colours.TRUTH, thick=0.5)


def _log_second(stream: rr.RecordingStream, trial: ReplayTrial, two: TwoBodyMotion) -> None:
    """Log the second body below the root of the trial, and the joint's axis in {1}."""
    second = f"{trial.name}/second"
    send_poses(stream, second, trial.time, two.second.p_W1, two.second.quaternion)
    if two.shapes[1] is not None:
        log_shape(stream, f"{second}/shape", two.shapes[1])
    axis = rr.Arrows3D(
        origins=[two.pivot - FRAME_M * two.axis], vectors=[2.0 * FRAME_M * two.axis], colors=[colours.ESTIMATE],
        radii=0.008,
    )  # fmt: skip
    stream.log(f"{trial.name}/payload/joint", axis, static=True)
    name = "slide" if two.slides else "hinge"
    log_label(
        stream, f"{trial.name}/payload/joint/name", two.pivot + FRAME_M * two.axis, name, colours.ESTIMATE
    )


def _log_facts(
    stream: rr.RecordingStream, path: str, facts: BodyFacts, suffix: str, colour: Colour, thick: float
) -> None:
    """Log grasp frames, centre of mass, principal axes and inertia ellipsoid in {1}."""
    longer = FRAME_M * (1.0 if thick == 1.0 else 1.5)
    if facts.grasps is not None:
        for i, (p, R) in enumerate(zip(facts.grasps.p_1i, facts.grasps.R_1i, strict=True), start=1):
            _log_axes(stream, f"{path}/grasp{i}", p, longer * R, colours.AXES, 0.006 * thick)
            log_label(stream, f"{path}/grasp{i}/name", p, f"{{{i}}}{suffix}", colour, show=not suffix)
    if facts.p_1c is None:
        return
    com = rr.Points3D([facts.p_1c], colors=[colour], radii=0.022 * thick)
    stream.log(f"{path}/com", com, static=True)
    log_label(stream, f"{path}/com/name", facts.p_1c, f"CoM{suffix}", colour, show=not suffix)
    semi_axes = facts.semi_axes_m()
    if semi_axes is None or facts.R_1c is None:
        return
    inertia = rr.Ellipsoids3D(
        half_sizes=[semi_axes],
        centers=[facts.p_1c],
        quaternions=[Rotation.from_matrix(facts.R_1c).as_quat()],
        colors=[colour],
        line_radii=0.002 * thick,
        fill_mode=rr.components.FillMode.MajorWireframe,
    )
    stream.log(f"{path}/inertia", inertia, static=True)
    if facts.axes_known:
        _log_axes(stream, f"{path}/axes", facts.p_1c, facts.R_1c * semi_axes, [colour] * 3, 0.005 * thick)


def _log_axes(
    stream: rr.RecordingStream, path: str, at: Array, axes: Array, tones: Sequence[Colour], radius_m: float
) -> None:
    """Log three arrows from a point, shape (3,), along the columns of ``axes``, shape (3, 3), in {1} [m]."""
    arrows = rr.Arrows3D(origins=np.tile(at, (3, 1)), vectors=axes.T, colors=tones, radii=radius_m)
    stream.log(path, arrows, static=True)


XYZ = ("x", "y", "z")


def log_series(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log all series below ``series`` in the root of the trial."""
    recording, data, motion, balance = trial.recording, trial.data, trial.motion, trial.balance
    _log_wrists(stream, trial)
    series: list[tuple[str, Array, Array, tuple[str, ...]]] = [
        ("phi", trial.time, recording.phi, ("1", "2", "3")),
        ("theta", trial.time, recording.theta, ("z", "y", "x")),
        ("tau", trial.time, recording.tau, ("1", "2", "3")),
    ]
    if data is not None:
        series += [
            ("omega", data.time, data.twist[..., :3], XYZ),
            ("velocity", data.time, data.twist[..., 3:], XYZ),
            ("moment", data.time, data.wrench[..., :3], XYZ),
            ("force", data.time, data.wrench[..., 3:], XYZ),
        ]
    if motion is not None:
        series += [
            ("grasp_position_mm", trial.time, 1e3 * motion.gap_position_m[..., None], ("",)),
            ("grasp_rotation_mrad", trial.time, 1e3 * motion.gap_rotation_rad[..., None], ("",)),
        ]
    if trial.two is not None:
        path, unit = f"{trial.name}/series/joint", "mm" if trial.two.slides else "mrad"
        log_lines(stream, path, trial.time, 1e3 * trial.two.q[:, None], (f"q [{unit}]",), [colours.ESTIMATE])
    for quantity, time, values, parts in series:
        _per_robot(stream, trial, quantity, time, values, parts)
    if data is not None and balance is not None:
        for quantity, values in (("balance_force", balance.force), ("balance_moment", balance.moment)):
            if values is not None:
                path = f"{trial.name}/series/{quantity}"
                log_lines(stream, path, data.time, values, XYZ, colours.AXES)


def _log_wrists(stream: rr.RecordingStream, trial: ReplayTrial) -> None:
    """Log measured and commanded wrist positions by robot, so that both share a plot."""
    for i in range(trial.robots):
        path = f"{trial.name}/series/wrist/omnid{i + 1}"
        measured = trial.bodies.wrist[:, i]
        log_lines(stream, f"{path}/measured", trial.time, measured, XYZ, colours.shades(i + 1))
        if trial.recording.ref is not None:
            names = [f"{axis} commanded" for axis in XYZ]
            pale = colours.shades(i + 1, saturation=0.15)
            log_lines(
                stream, f"{path}/commanded", trial.time, trial.recording.ref[:, i], names, pale, width=3.0
            )


def _per_robot(
    stream: rr.RecordingStream,
    trial: ReplayTrial,
    quantity: str,
    time: Array,
    values: Array,
    parts: tuple[str, ...],
) -> None:
    """Log a quantity of all robots, shape (Q, N, k), as one entity, because each row has a large overhead."""
    names, shades = [], []
    for robot in range(1, trial.robots + 1):
        names += [f"omnid{robot} {part}".strip() for part in parts]
        shades += colours.shades(robot) if len(parts) == 3 else [colours.of_robot(robot)]
    log_lines(stream, f"{trial.name}/series/{quantity}", time, values.reshape(len(values), -1), names, shades)


def log_lines(
    stream: rr.RecordingStream,
    path: str,
    time: Array,
    values: Array,
    names: Sequence[str],
    shades: Sequence[Colour],
    width: float = 1.2,
) -> None:
    """Log k lines of one entity: times [s], shape (Q,), and values, shape (Q, k)."""
    stream.log(path, rr.SeriesLines(names=names, colors=shades, widths=width), static=True)
    counts = np.full(len(values), values.shape[1])
    send(stream, path, time, rr.Scalars.columns(scalars=values.ravel()).partition(counts))


NOT_KNOWN = "not determined"


def summary(trial: ReplayTrial) -> str:
    """Write the summary of a trial in Markdown."""
    meta = trial.recording.metadata
    payload = f", payload {_plain(meta.payload)}" if meta.payload is not None else ""
    robots = "1 robot" if trial.robots == 1 else f"{trial.robots} robots"
    parts = [
        f"**{_plain(trial.name)}**: {meta.trial} trial, {robots}{payload}, {trial.time[-1]:.1f} s at "
        f"{meta.rate_hz:g} Hz, from {_plain(Path(trial.recording.name).name)} ({_plain(meta.source)}). Time 0 is "
        f"{trial.recording.time[0]:g} s in the recording.",
        *([_verdict(trial.diagnosis)] if trial.diagnosis else []),
        _estimate(trial),
        _residuals(trial),
        *(["**Notes**\n\n" + "\n".join(f"- {_plain(note)}" for note in trial.notes)] if trial.notes else []),
        _key(trial),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _verdict(diagnosis: WrittenDiagnosis) -> str:
    causes = [f"- **{_plain(cause.name)}**: {_plain(cause.sentence)}" for cause in diagnosis.causes]
    return f"**Diagnosis: {VERDICTS[diagnosis.verdict]}.**\n\n" + "\n".join(causes or ["No cause is named."])


def _estimate(trial: ReplayTrial) -> str:
    estimate, truth = trial.estimate, trial.truth
    if estimate is None and truth is None:
        return ""
    facts = trial.facts
    mass = None if estimate is None else estimate.mass
    com = (facts and facts.p_1c, estimate and estimate.p_1c_se_m, truth and truth.p_1c)
    principal = estimate.inertia.principal if estimate and estimate.inertia else None
    moments = (
        principal and principal.moments,
        principal and principal.moments_se,
        truth and truth.principal_kgm2,
    )
    # One number per row, because the viewer cuts off text wider than its panel.
    known = NOT_KNOWN if mass is None else f"{mass.mass:.4f} ± {mass.se:.4f}"
    rows = [("mass [kg]", known, "" if truth is None else f"{truth.mass_kg:.4f}")]
    rows += _rows("CoM {} in {{1}} [mm]", "xyz", com, 1e3, 2)
    rows += _rows("moment {} [kg m²]", "123", moments, 1.0, 4)
    grasps, true = (of.grasps if of else None for of in (facts, truth))
    for i in range(1, trial.robots):
        places, turns = zip(*(_pose(of, i) for of in (grasps, true)), strict=True)
        rows += _rows(f"grasp {i + 1} {{}} in {{{{1}}}} [mm]", "xyz", (places[0], None, places[1]), 1e3, 2)
        rows += _rows(f"grasp {i + 1} about {{}} [deg]", "xyz", (turns[0], None, turns[1]), 1.0, 3)
    columns = 2 + (truth is not None)
    head, *lines = ["| " + " | ".join(row[:columns]) + " |" for row in [("", "estimate", "truth"), *rows]]
    table = [head, "|" + "---|" * columns, *lines]
    title = "**Payload: estimate ± standard error" + (", and truth**" if truth else "**")
    title += f"\n\nIn {frames_said(estimate.zero_sd_rad)}." if estimate and estimate.zero_sd_rad else ""
    flags = [f"- {_plain(flag)}" for flag in estimate.flags] if estimate else []
    return title + "\n\n" + "\n".join(table) + ("\n\n" + "\n".join(flags) if flags else "")


def _residuals(trial: ReplayTrial) -> str:
    lines = []
    if trial.motion is not None and trial.robots > 1:
        position = 1e3 * rms(trial.motion.gap_position_m)
        rotation = 1e3 * rms(trial.motion.gap_rotation_rad)
        lines.append(f"- flange against grasp frame: {position:.3g} mm, {rotation:.3g} mrad")
    if trial.balance is not None:
        text = f"- wrench balance: {rms_length(trial.balance.force):.3g} N"
        if trial.balance.moment is not None:
            text += f", {rms_length(trial.balance.moment):.3g} N m about the centre of mass"
        lines.append(text)
    body = "one rigid payload leaves" if trial.two is None else "two bodies on a joint leave"
    return f"**What {body} over (rms)**\n\n" + "\n".join(lines) if lines else ""


def _key(trial: ReplayTrial) -> str:
    held = trial.motion is not None
    commanded = "; white: the command" if trial.recording.ref is not None else ""
    lines = (
        (
            trial.data,
            f"arrows at the grasps: force of each robot on the payload, 100 N is {100 * FORCE_M_PER_N:g} m",
        ),
        (held and trial.facts, "red, green, blue arrows: x, y, z of a grasp frame"),
        (
            held and trial.facts,
            "magenta: estimated centre of mass, principal axes, and the solid ellipsoid of that mass and inertia",
        ),
        (trial.two, "magenta arrow: axis of the joint between the two bodies"),
        (held and trial.truth, "green, thin: the same in truth; true grasp frames are longer"),
        (trial.diagnosis and trial.diagnosis.causes, "red ball: a cause that the diagnosis names sits there"),
        (True, f"line at a wrist: its path, in the robot's colour{commanded}"),
        (
            True,
            "series: the robot's colour; dark, plain, light for its joints 1, 2, 3 or axes x, y, z (theta: z, y, x)",
        ),
    )
    return "**Key**\n\n" + "\n".join(f"- {text}" for there, text in lines if there)


def _rows(
    name: str, parts: str, values: tuple[Array | None, Array | None, Array | None], scale: float, digits: int
) -> list[tuple[str, str, str]]:
    """Make rows of estimate, standard errors and truth, shapes (3,), each None if unknown."""
    estimate, errors, truth = (None if value is None else scale * value for value in values)
    rows = []
    for k, part in enumerate(parts):
        text = NOT_KNOWN if estimate is None else _fixed(estimate[k], digits)
        if estimate is not None and errors is not None:
            text += f" ± {errors[k]:.{digits}f}"
        rows.append((name.format(part), text, "" if truth is None else _fixed(truth[k], digits)))
    return rows


def _pose(grasps: Grasps | None, i: int) -> tuple[Array | None, Array | None]:
    """Return position [m] and rotation vector [deg] of a grasp in {1}, shapes (3,)."""
    if grasps is None:
        return None, None
    return grasps.p_1i[i], Rotation.from_matrix(grasps.R_1i[i]).as_rotvec(degrees=True)


def _fixed(value: float, digits: int) -> str:
    """Format a number with fixed digits, without a minus sign before zero."""
    return f"{round(float(value), digits) + 0.0:.{digits}f}"


def _plain(text: str | None) -> str:
    """Escape Markdown and replace control characters by spaces."""
    kept = "".join(c if c.isprintable() else " " for c in str(text))
    return "".join("\\" + c if c in "\\`*_[]<>|#" else c for c in kept)


APPLICATION = "mocobot"


def new_stream() -> rr.RecordingStream:
    """Make an empty stream; connect it to a file, server or viewer before logging."""
    return rr.RecordingStream(APPLICATION)


def begin(stream: rr.RecordingStream, layout: rrb.Blueprint, names: Sequence[str]) -> None:
    """Send the layout to a stream, and log a root with z up for every name."""
    stream.send_blueprint(layout, make_active=True, make_default=True)
    stream.send_recording_name(", ".join(names))
    for name in names:
        stream.log(name, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)


def log_replay(
    stream: rr.RecordingStream,
    trials: Sequence[ReplayTrial],
    progress: Callable[[int], object] | None = None,
) -> None:
    """Log trials side by side, each below a root with its name, on one timeline that starts at 0."""
    begin(stream, blueprint(trials), [trial.name for trial in trials])
    for trial in trials:
        stream.log(
            f"{trial.name}/summary", rr.TextDocument(summary(trial), media_type="text/markdown"), static=True
        )
        log_robots(stream, trial)
        log_payload(stream, trial)
        log_causes(stream, trial)
        log_series(stream, trial)
        log_keys(stream, trial)
        if progress:
            progress(1)


Progress = Callable[[int], object] | None
Content = Callable[[rr.RecordingStream], object]

WEB_PORT, DATA_PORT = 9090, 9876  # ports of the web viewer and of its data; Rerun's defaults
FLUSH_S = 20.0  # time limit for a viewer to accept all data [s]. Chosen: a long recording takes one second.


def has_display() -> bool:
    return not sys.platform.startswith("linux") or bool(
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    )


def check_enabled() -> None:
    """Refuse an environment that turns Rerun off, which would silently discard all data."""
    if not rr.is_enabled(new_stream()):
        raise InputError(
            f"RERUN is {os.environ.get('RERUN', '')!r} in the environment, which turns Rerun off; unset it"
        )


def save_replay(trials: Sequence[ReplayTrial], path: Path, progress: Progress = None) -> None:
    """Write a replay as an .rrd file; see ``save_content``."""
    save_content(lambda stream: log_replay(stream, trials, progress), path)


def save_content(content: Content, path: Path) -> None:
    """Write the data that ``content`` logs as an .rrd file; it replaces an earlier file only once it is complete."""
    with whole_file(path) as temporary:
        temporary.touch(exist_ok=False)  # the SDK's message would name the temporary file
        stream = new_stream()
        try:
            stream.save(temporary)
            content(stream)
            stream.flush()
            stream.disconnect()
        except RuntimeError as error:  # the SDK's writer hides the system's error
            raise InputError(f"{path}: cannot be written ({_line(error)}); is the disk full?") from error
        _check_complete(temporary)


def show_content(content: Content) -> None:
    """Show the data that ``content`` logs in a new or open viewer; return once the viewer has all data."""
    stream = new_stream()
    beside = shutil.which("rerun", path=str(Path(sys.executable).parent))
    try:
        rr.spawn(executable_path=beside, hide_welcome_screen=True, recording=stream)
        content(stream)
        stream.flush(timeout_sec=FLUSH_S)
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(
            f"the Rerun viewer does not open ({_line(error)}); write a file with --out replay.rrd, or use --web"
        ) from error
    stream.disconnect()


def serve_content(content: Content) -> tuple[rr.RecordingStream, str]:
    """Serve the data that ``content`` logs to browsers, until the process or the returned stream ends.

    Returns the stream, which the caller must keep, and the address to open.
    """
    stream = new_stream()
    try:
        data = stream.serve_grpc()
        rr.serve_web_viewer(web_port=WEB_PORT, open_browser=False)
        content(stream)
        stream.flush(timeout_sec=FLUSH_S)
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(
            f"the replay cannot be served ({_line(error)}); is another one running on ports {WEB_PORT} and {DATA_PORT}?"
        ) from error
    # The colours of labels need the dark theme.
    address = f"http://localhost:{WEB_PORT}?url={quote(data, safe='')}&theme=dark"
    if has_display():
        webbrowser.open(address)
    return stream, address


def _check_complete(path: Path) -> None:
    """Read the written file back, because the SDK writes in the background and only logs errors; OSError if cut off."""
    try:
        with warnings.catch_warnings():  # a missing footer is only a warning
            warnings.simplefilter("ignore")
            reader = RrdReader(path)
            whole = (
                len(reader.recordings()) == 1 and len(reader.blueprints()) >= 1 and len(reader.store()) > 0
            )
    except (RuntimeError, ValueError):
        whole = False
    if not whole:
        raise OSError("only a part of it arrived; is the disk full?")


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
