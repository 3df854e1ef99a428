"""Robots whose channels come from several topics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bags
from bags import EPOCH_NS, raw_mcap, said
from mocobot_logs.bag.read import MAX_GAP_NS, RowAligner, open_bag
from mocobot_logs.log import CHANNELS, Samples, collect
from mocobot_logs.maps import parse_map


def part(stamps, values, columns):
    stamps = np.asarray(stamps, np.int64)
    values = np.asarray(values, float).reshape(len(stamps), len(columns))
    return Samples(stamps, values, stamps + 5)


def aligner_of(periods, *columns):
    return RowAligner("bag: robot 2", ("/a", "/b"), periods, [np.array(each) for each in columns])


def all_of(joiner, blocks):
    found = [samples for block in blocks if (samples := joiner.push(block)) is not None]
    found += [samples for samples in [joiner.finish()] if samples is not None]
    return Samples(
        np.concatenate([s.stamp_ns for s in found]),
        np.concatenate([s.values for s in found]),
        np.concatenate([s.log_ns for s in found]),
    )


@settings(max_examples=100, deadline=None, derandomize=True, database=None)
@given(st.data())
def test_equal_stamps_are_taken_bit_by_bit(data):
    """Two topics stamped together, each of which lacks some messages, in blocks of any size, one of them late."""
    stamps = EPOCH_NS + 10_000_000 * np.arange(60)
    rng = np.random.default_rng(data.draw(st.integers(0, 999)))
    values = rng.normal(size=(60, 3))
    lost = data.draw(st.sets(st.integers(1, 58), max_size=8))
    kept = np.array([k for k in range(60) if k not in lost])
    late = data.draw(st.integers(0, 70))
    size = data.draw(st.integers(1, 80))
    blocks = []
    for begin in range(0, 60 + late, size):
        block = {}
        for t, index, columns in ((0, np.arange(60), [0, 2]), (1, kept + late, [1])):
            mine = index[(index >= begin) & (index < begin + size)] - late * t
            if len(mine):
                block[t] = part(stamps[mine], values[mine][:, columns], columns)
        if block:
            blocks.append(block)
    rows = all_of(aligner_of((1e7, 1e7), [0, 2], [1]), blocks)
    # What lacks for more than 60 ms has no row; all else is there.
    alone = np.isin(stamps, rows.stamp_ns)
    assert alone[kept].all()
    places = np.searchsorted(rows.stamp_ns, stamps[kept])
    np.testing.assert_array_equal(rows.values[places], values[kept])
    np.testing.assert_array_equal(rows.values[:, [0, 2]], values[alone][:, [0, 2]])
    assert not np.isnan(rows.values).any()
    gaps = np.diff(kept, prepend=kept[0])
    assert len(rows.stamp_ns) == 60 - sum(gap - 1 for gap in gaps if gap > 6)


def wave(stamps, hz, columns):
    time = (np.asarray(stamps) - EPOCH_NS) * 1e-9
    return np.sin(2 * np.pi * hz * time[:, None] + np.arange(columns))


def uniform(rate_hz, seconds, phase_s=0.0):
    return EPOCH_NS + np.round((np.arange(round(seconds * rate_hz)) / rate_hz + phase_s) * 1e9).astype(
        np.int64
    )


def blocks_of(streams, size=300):
    """Messages of every topic by time, ``size`` of all to a block."""
    every = np.concatenate([s for s, _, _ in streams])
    number = np.repeat(np.arange(len(streams)), [len(s) for s, _, _ in streams])
    index = np.concatenate([np.arange(len(s)) for s, _, _ in streams])
    order = np.argsort(every, kind="stable")
    for begin in range(0, len(order), size):
        chosen = order[begin : begin + size]
        block = {}
        for t, (stamps, values, columns) in enumerate(streams):
            mine = index[chosen[number[chosen] == t]]
            if len(mine):
                block[t] = part(stamps[mine], values[mine], columns)
        yield block


@pytest.mark.parametrize(("hz", "bound"), [(1.0, 4.1e-7), (5.0, 2.4e-4)])
def test_interpolation_is_as_good_as_stated(hz, bound):
    """A slow topic at the stamps of a fast one, worst error against the sine itself."""
    fast, slow = uniform(1000, 12), uniform(100, 12, 0.0037)
    streams = [(slow, wave(slow, hz, 2), [0, 1]), (fast, wave(fast, hz, 1), [2])]
    rows = all_of(aligner_of((1e7, 1e6), [0, 1], [2]), blocks_of(streams))
    # The fast topic sets the rows, from the slow one's first sample to its last.
    inside = fast[(fast >= slow[0]) & (fast <= slow[-1])]
    np.testing.assert_array_equal(rows.stamp_ns, inside)
    np.testing.assert_array_equal(rows.log_ns, inside + 5)
    np.testing.assert_array_equal(rows.values[:, 2], wave(inside, hz, 1)[:, 0])
    error = np.abs(rows.values[:, :2] - wave(inside, hz, 2))
    middle = (inside > slow[1]) & (inside < slow[-2])
    assert bound / 3 < error[middle].max() < bound
    # Between the first two samples, and the last two, by the straight line.
    assert error.max() < 1.01 * (2 * np.pi * hz * 0.01) ** 2 / 8


def test_there_are_no_rows_where_a_topic_has_a_gap():
    fast, slow = uniform(1000, 4), uniform(100, 4, 0.003)
    gap = (slow > EPOCH_NS + 1_000_000_000) & (slow < EPOCH_NS + 1_100_000_000)
    short = np.isin(np.arange(400), [250, 251])
    kept = slow[~gap & ~short]
    streams = [(fast, wave(fast, 1.0, 1), [0]), (kept, wave(kept, 1.0, 1), [1])]
    rows = all_of(aligner_of((1e6, 1e7), [0], [1]), blocks_of(streams))
    steps = np.diff(rows.stamp_ns)
    assert np.sum(steps > 1_000_000) == 1
    assert 100_000_000 < steps.max() < 115_000_000
    assert MAX_GAP_NS == 50_000_000  # which bridges two missing samples
    assert np.abs(rows.values[:, 1] - wave(rows.stamp_ns, 1.0, 1)[:, 0]).max() < 0.005


def test_a_topic_that_falls_silent_holds_nothing_up():
    """Rows end where a topic ends, and what waits for it stays bounded."""
    fast = uniform(1000, 200)
    slow = uniform(100, 20)
    aligner = aligner_of((1e6, 1e7), [0], [1])
    count = held = 0
    for block in blocks_of([(fast, wave(fast, 1.0, 1), [0]), (slow, wave(slow, 1.0, 1), [1])], 1000):
        if (samples := aligner.push(block)) is not None:
            count += len(samples.stamp_ns)
            assert not np.isnan(samples.values).any()
        held = max(held, *(len(topic.stamp_ns) for topic in aligner._topics))
    assert aligner.finish() is None
    assert count == np.sum(fast <= slow[-1])
    assert held < 70_000


WRENCH = "geometry_msgs/msg/WrenchStamped"
MAP = {
    "version": 1,
    "level": "wrist",
    "channels": {
        **{f"h_{a}": {"topic": "/r{robot}/pose", "field": f"point.{a}", "unit": "m"} for a in "xyz"},
        **{
            f"theta_{a}": {"topic": "/r{robot}/gimbal", "joint": f"g{a}", "field": "position", "unit": "rad"}
            for a in "xyz"
        },
        **{f"force_{a}": {"topic": "/r{robot}/ft", "field": f"wrench.force.{a}", "unit": "N"} for a in "xyz"},
    },
}


def wrench(stamp, force):
    vector = bags.TYPES.types["geometry_msgs/msg/Vector3"]
    both = bags.TYPES.types["geometry_msgs/msg/Wrench"](vector(*map(float, force)), vector(0.0, 0.0, 0.0))
    return bags.TYPES.types[WRENCH](header=bags.header(int(stamp)), wrench=both)


@pytest.mark.parametrize("clock", ["header", "log"])
def test_a_laboratory_with_a_topic_per_sensor(tmp_path, clock):
    """Force-torque sensor at 500 Hz, gimbal at 200 Hz, wrist at 100 Hz, none in step with another."""
    pose, gimbal, ft = uniform(100, 3, 0.0011), uniform(200, 3, 0.0023), uniform(500, 3)
    messages = [
        said("/r1/pose", int(t), bags.point(v, int(t))) for t, v in zip(pose, wave(pose, 1, 3), strict=True)
    ]
    messages += [
        said("/r1/gimbal", int(t), bags.joint_state(v, [], int(t), names=["gz", "gy", "gx"]))
        for t, v in zip(gimbal, wave(gimbal, 0.7, 3), strict=True)
    ]
    messages += [said("/r1/ft", int(t), wrench(t, v)) for t, v in zip(ft, wave(ft, 1.5, 3), strict=True)]
    messages.sort(key=lambda s: s.log_ns)
    path = raw_mcap(tmp_path / "a.mcap", messages)
    log = collect(open_bag(path, parse_map({**MAP, "time": {"clock": clock}}, "test")))
    (stream,) = log.streams
    inside = ft[(ft >= gimbal[0]) & (ft <= pose[-1])]
    np.testing.assert_array_equal(stream.stamp_ns, inside)
    np.testing.assert_array_equal(stream.values[:, 6:], wave(inside, 1.5, 3))
    np.testing.assert_allclose(stream.values[10:-10, :3], wave(inside, 1, 3)[10:-10], atol=1e-6)
    np.testing.assert_allclose(stream.values[10:-10, 3:6], wave(inside, 0.7, 3)[10:-10], atol=1e-6)


@pytest.mark.parametrize(
    "sent",
    [lambda stamps: stamps + 3_000_000, lambda stamps: stamps[::10], lambda stamps: stamps - 100_000_000_000],
    ids=["in between", "seldom", "long ago"],
)
def test_commands_that_do_not_go_with_the_samples_are_left_out(tmp_path, sent):
    """They may be missing, and must not cost the samples."""
    team = bags.Team.draw(robots=1, rows=200)
    messages = team.said()
    messages += [
        said("/omnid1/wrist/command", team.log_ns(0, k), bags.point([1, 2, 3], int(t)))
        for k, t in enumerate(sent(team.stamps[0]))
    ]
    messages.sort(key=lambda s: s.log_ns)
    log = collect(open_bag(raw_mcap(tmp_path / "a.mcap", messages)))
    assert log.channels == CHANNELS["wrist"]
    np.testing.assert_array_equal(log.streams[0].values, team.wrist(0))
