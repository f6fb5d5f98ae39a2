"""ROS 2 bags, written by rosbags: joints by name, topics joined on time, both kinds of storage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigtwin.errors import RigtwinError
from rigtwin.importing.convert import convert
from rigtwin.importing.selection import Selection
from rigtwin.importing.table import read
from rigtwin.recording import load

rosbag2 = pytest.importorskip("rosbags.rosbag2")
typesys = pytest.importorskip("rosbags.typesys")
STORE = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
START, STEP, TICKS = 1_700_000_000_000_000_000, 5_000_000, 400
TIME = np.arange(TICKS) * 5e-3
SHOULDER, ELBOW = np.sin(3.0 * TIME), 0.4 * np.cos(5.0 * TIME)
KINDS = list(rosbag2.StoragePlugin)
MAP = """
machine = "arm"
[time]
column = "/joint_states.time"
[channels]
"/sensor.shoulder" = { column = "/joint_states.position[shoulder]" }
"/sensor.elbow" = { column = "/joint_states.position[elbow]" }
"/command.elbow" = { column = "/forward_position_controller/commands.data[1]" }
"""


def message(kind: str, **values: Any) -> tuple[str, Any]:
    return kind, STORE.types[kind](**values)


def time_of(nanoseconds: int, kind: str = "Time") -> Any:
    made = STORE.types[f"builtin_interfaces/msg/{kind}"]
    return made(nanoseconds // 10**9, nanoseconds % 10**9)


def header(nanoseconds: int) -> Any:
    return STORE.types["std_msgs/msg/Header"](time_of(nanoseconds), "")


def joints(stamp: int, names: list[str], position: list[float]) -> tuple[str, Any]:
    empty = np.empty(0)
    return message(
        "sensor_msgs/msg/JointState",
        header=header(stamp),
        name=names,
        position=np.array(position),
        velocity=empty,
        effort=empty,
    )


def numbers(*values: float) -> tuple[str, Any]:
    layout = STORE.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    return message("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array(values))


def write(path: Path, messages: list[tuple[str, int, tuple[str, Any]]], storage: Any = KINDS[0]):
    """Write messages, (topic, time of recording, message), as a bag."""
    with rosbag2.Writer(path, version=9, storage_plugin=storage) as writer:
        topics: dict[str, Any] = {}
        for topic, recorded, (kind, content) in messages:
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(topics[topic], recorded, STORE.serialize_cdr(content, kind))
    return path


def states(clock: int = START) -> list[tuple[str, int, tuple[str, Any]]]:
    """Joint states whose joints come in another order every other time; recorded 1 ms late."""
    found = []
    for tick, (one, two) in enumerate(zip(SHOULDER, ELBOW, strict=True)):
        names, position = ["shoulder", "elbow"], [one, two]
        if tick % 2:
            names, position = names[::-1], position[::-1]
        state = joints(clock + tick * STEP, names, position)
        found.append(("/joint_states", START + tick * STEP + 1_000_000, state))
    return found


def commands(first: int = 0, every: int = 4) -> list[tuple[str, int, tuple[str, Any]]]:
    topic = "/forward_position_controller/commands"
    ticks = range(first, TICKS, every)
    return [(topic, START + tick * STEP, numbers(0.0, float(tick))) for tick in ticks]


@pytest.mark.parametrize("storage", KINDS, ids=[kind.name for kind in KINDS])
@pytest.mark.parametrize("whole", [True, False], ids=["folder", "file"])
def test_joints_are_taken_by_name_and_commands_hold(tmp_path: Path, storage, whole: bool):
    bag = write(tmp_path / "bag", [*states(), *commands()], storage)
    if not whole:
        (bag,) = (path for path in bag.iterdir() if path.suffix in (".db3", ".mcap"))
    (tmp_path / "map.toml").write_text(MAP)
    report = convert([bag], tmp_path / "map.toml", tmp_path / "out.mcap")
    recording = load(tmp_path / "out.mcap")
    assert recording.period == 0.005
    np.testing.assert_allclose(recording["/sensor.shoulder"], SHOULDER)
    np.testing.assert_allclose(recording["/sensor.elbow"], ELBOW)
    held = np.arange(TICKS) // 4 * 4
    np.testing.assert_array_equal(recording["/command.elbow"], held)
    assert any("commands is held at the times of /joint_states" in line for line in report)


def test_rows_before_the_first_command_are_left_out(tmp_path: Path):
    columns = read(write(tmp_path / "bag", [*states(), *commands(first=40)]))
    assert columns.rows == TICKS - 40
    assert columns.values["time"][0] == 0.0
    assert any("40 of 400 messages" in note for note in columns.notes)


def test_a_clock_of_simulated_time_is_set_right_by_the_times_of_recording(tmp_path: Path):
    # The headers count from 12 s, the commands have no header.
    bag = write(tmp_path / "bag", [*states(clock=12_000_000_000), *commands()])
    columns = read(bag)
    lag = columns.values["/forward_position_controller/commands.data[1]"] - np.arange(TICKS)
    # A state is recorded 1 ms after its header's time, so that each fourth command comes too late.
    assert np.all(lag[8:] <= 0.0)
    assert np.all(lag[8:] >= -7.0)
    assert any("another clock" in note for note in columns.notes)


def test_measurements_of_another_topic_are_interpolated(tmp_path: Path):
    vector = STORE.types["geometry_msgs/msg/Vector3"]

    def wrench(stamp: int, force: float) -> tuple[str, Any]:
        content = STORE.types["geometry_msgs/msg/Wrench"](vector(force, 0.0, 0.0), vector(0, 0, 0))
        return message("geometry_msgs/msg/WrenchStamped", header=header(stamp), wrench=content)

    times = [START + 7_000_000 * n for n in range(300)]
    wrenches = [("/wrench", t, wrench(t, (t - START) * 1e-9)) for t in times]
    columns = read(write(tmp_path / "bag", [*states(), *wrenches]))
    np.testing.assert_allclose(columns.values["/wrench.wrench.force.x"], columns.values["time"])


def test_a_new_trajectory_replaces_what_was_not_due_yet(tmp_path: Path):
    point = STORE.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    empty = np.empty(0)

    def plan(*points: tuple[float, float]) -> tuple[str, Any]:
        made = [
            point(np.array([value]), empty, empty, empty, time_of(round(after * 1e9), "Duration"))
            for after, value in points
        ]
        return message(
            "trajectory_msgs/msg/JointTrajectory",
            header=header(0),
            joint_names=["elbow"],
            points=made,
        )

    plans = [
        ("/plan", START, plan((0.0, 0.0), (1.0, 1.0), (1.9, 7.0))),
        ("/plan", START + 1_000_000_000, plan((0.0, 1.0), (0.5, 0.0))),
    ]
    columns = read(write(tmp_path / "bag", [*states(), *plans]))
    time, planned = columns.values["time"], columns.values["/plan.positions[elbow]"]
    expected = np.interp(time, [0.0, 1.0, 1.5], [0.0, 1.0, 0.0])
    np.testing.assert_allclose(planned, expected, atol=1e-9)


def test_only_the_needed_topics_are_read_and_the_others_are_listed(tmp_path: Path):
    bag = write(tmp_path / "bag", [*states(), *commands()])
    columns = read(bag, Selection(frozenset({"/joint_states.position[elbow]", "time"})))
    assert set(columns.values) == {"time", "/joint_states.time", "/joint_states.position[elbow]"}
    assert "/forward_position_controller/commands.data[1]" in columns.names


def test_a_joint_that_the_bag_does_not_have_is_named_with_what_there_is(tmp_path: Path):
    bag = write(tmp_path / "bag", [*states(), *commands()])
    (tmp_path / "map.toml").write_text(MAP.replace("position[elbow]", "position[elbw]"))
    with pytest.raises(RigtwinError, match=r"did you mean '/joint_states.position\[elbow\]'"):
        convert([bag], tmp_path / "map.toml", tmp_path / "out.mcap")


def test_a_type_whose_definition_is_missing_is_an_error_only_if_it_is_needed(tmp_path: Path):
    from rosbags.typesys import get_types_from_msg

    kind = "control_msgs/msg/Odd"
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("float64 value", kind))
    path = tmp_path / "bag"
    with rosbag2.Writer(path, version=8, storage_plugin=KINDS[0]) as writer:
        odd = writer.add_connection("/odd", kind, typestore=store)
        known = writer.add_connection(
            "/joint_states", "sensor_msgs/msg/JointState", typestore=store
        )
        for _, recorded, (name, content) in states():
            writer.write(known, recorded, store.serialize_cdr(content, name))
            writer.write(odd, recorded, store.serialize_cdr(store.types[kind](1.0), kind))
    # A bag of an older ROS 2 has no definitions.
    import sqlite3

    (file,) = path.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("DELETE FROM message_definitions")
    assert "/joint_states.position[elbow]" in read(path).values
    (tmp_path / "map.toml").write_text(
        MAP.replace("/forward_position_controller/commands.data[1]", "/odd.value")
    )
    with pytest.raises(RigtwinError, match="does not hold the definition of control_msgs/msg/Odd"):
        convert([path], tmp_path / "map.toml", tmp_path / "out.mcap")


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("storage", KINDS, ids=[kind.name for kind in KINDS])
def test_a_bag_that_is_cut_off_is_one_line(tmp_path: Path, storage, share: float):
    bag = write(tmp_path / "bag", states(), storage)
    (file,) = (path for path in bag.iterdir() if path.suffix in (".db3", ".mcap"))
    data = file.read_bytes()
    file.write_bytes(data[: int(share * len(data))])
    with pytest.raises(RigtwinError) as caught:
        read(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_without_rosbags_one_line_names_the_extra(tmp_path: Path, monkeypatch):
    bag = write(tmp_path / "bag", states())
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag2", None)
    with pytest.raises(RigtwinError, match=r"pip install 'rigtwin\[ros\]'"):
        read(bag)


def test_a_recording_of_rigtwin_needs_no_import(tmp_path: Path):
    bag = write(tmp_path / "bag", [*states(), *commands()])
    (tmp_path / "map.toml").write_text(MAP)
    convert([bag], tmp_path / "map.toml", tmp_path / "out.mcap")
    with pytest.raises(RigtwinError, match="a recording of rigtwin needs no import"):
        read(tmp_path / "out.mcap")


CONTROLLER_STATE = """
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
"""
INTERFACES = """
std_msgs/Header header
string[] joint_names
control_msgs/InterfaceValue[] interface_values
================================================================================
MSG: control_msgs/InterfaceValue
string[] interface_names
float64[] values
"""


def test_controller_states_whose_definitions_stand_in_the_bag(tmp_path: Path):
    from rosbags.typesys import get_types_from_msg

    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    state, dynamic = (
        f"control_msgs/msg/{name}"
        for name in ("JointTrajectoryControllerState", "DynamicJointState")
    )
    store.register(get_types_from_msg(CONTROLLER_STATE, state))
    store.register(get_types_from_msg(INTERFACES, dynamic))
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    value = store.types["control_msgs/msg/InterfaceValue"]
    joint_names, empty = ["shoulder", "elbow"], np.empty(0)

    def position(*values: float) -> Any:
        return point(np.array(values, float), empty, empty, empty, time_of(0, "Duration"))

    path = tmp_path / "bag"
    with rosbag2.Writer(path, version=9, storage_plugin=KINDS[0]) as writer:
        topics = {
            kind: writer.add_connection(f"/{kind[-12:].lower()}", kind, typestore=store)
            for kind in (state, dynamic)
        }
        for tick in range(TICKS):
            stamp = header(START + tick * STEP)
            reference, feedback = position(tick, -tick), position(0.5 * tick, 0.0)
            values = [
                value(["position", "effort"], np.array([1.0 * tick, 7.0])),
                value(["effort"], np.array([9.0])),
            ]
            for kind, content in (
                (state, store.types[state](stamp, joint_names, reference, feedback)),
                (dynamic, store.types[dynamic](stamp, joint_names, values)),
            ):
                data = store.serialize_cdr(content, kind)
                writer.write(topics[kind], START + tick * STEP, data)
    found = read(path).values
    first, second = (f"/{kind[-12:].lower()}" for kind in (state, dynamic))
    np.testing.assert_array_equal(found[f"{first}.reference.positions[elbow]"], -np.arange(TICKS))
    np.testing.assert_array_equal(
        found[f"{first}.feedback.positions[shoulder]"], 0.5 * np.arange(TICKS)
    )
    effort = f"{second}.interface_values[elbow].values[effort]"
    np.testing.assert_array_equal(found[effort], np.full(TICKS, 9.0))


def test_a_joint_that_only_some_messages_have(tmp_path: Path):
    # Two publishers take turns, each with a joint of its own.
    turns = [
        (
            "/joint_states",
            START + tick * STEP,
            joints(START + tick * STEP, ["elbow" if tick % 2 else "shoulder"], [float(tick)]),
        )
        for tick in range(TICKS)
    ]
    columns = read(write(tmp_path / "bag", turns))
    np.testing.assert_allclose(np.diff(columns.values["time"]), 2e-9 * STEP)
    gap = columns.values["/joint_states.position[elbow]"]
    gap = gap - columns.values["/joint_states.position[shoulder]"]
    # One of them is interpolated at the times of the other one.
    np.testing.assert_allclose(gap, 0.0, atol=1e-9)
