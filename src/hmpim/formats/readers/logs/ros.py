"""ROS 2 bags, as folder, MCAP or SQLite, and ROS 1 bags (extra `ros`: rosbags)."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.readers.logs.clock import seconds_since
from hmpim.formats.readers.logs.log import Column, Group, Log, list_log, take_series
from hmpim.formats.readers.protocol import Contents, Layout, Reader, Stamps, need
from hmpim.record import Series

__all__ = ["ROS", "channels", "parse", "read", "sniff"]

_MCAP = b"\x89MCAP0\r\n"
_SQLITE = b"SQLite format 3\0"
_ROS1 = b"#ROSBAG V2.0"
_FOLDER = b"rosbag2_bagfile_information"
_MOST = 64  # numbers of one array that become channels
_DAY = 86_400 * 10**9
_BULKY = ("Image", "CompressedImage", "PointCloud2", "PointCloud", "OccupancyGrid", "LaserScan")
# As the comments of the definitions themselves say.
_UNITS = {
    "sensor_msgs/msg/Imu": {"angular_velocity": "rad/s", "linear_acceleration": "m/s**2"},
    "geometry_msgs/msg/Twist": {"linear": "m/s", "angular": "rad/s"},
    "geometry_msgs/msg/TwistStamped": {"twist.linear": "m/s", "twist.angular": "rad/s"},
    "geometry_msgs/msg/Wrench": {"force": "N", "torque": "N*m"},
    "geometry_msgs/msg/WrenchStamped": {"wrench.force": "N", "wrench.torque": "N*m"},
}


def sniff(head: bytes, path: Path) -> bool:
    r"""Say whether a file is MCAP, a bag of ROS 1, or SQLite, or a folder a bag of ROS 2.

    Examples
    --------
    >>> sniff(b"\x89MCAP0\r\n", Path("a.mcap")), sniff(b"u,y", Path("a.mcap"))
    (True, False)
    """
    return head.startswith((_MCAP, _SQLITE, _ROS1)) or (path.is_dir() and _FOLDER in head)


def channels(path: Path, layout: Layout) -> Contents:
    """List the numbers in the messages of all topics."""
    return list_log(parse, path, layout)


def read(path: Path, names: Sequence[str], layout: Layout) -> tuple[Series, ...]:
    """Read numbers by name: ``/imu.angular_velocity.z``, ``/joint_states.position[elbow]``."""
    return take_series(parse, path, names, layout)


def parse(path: Path, layout: Layout) -> Log:
    """Open a bag.

    `layout.stamps` chooses between ``header.stamp`` ('header', 'auto' where there is one) and
    the time at which a message was logged ('log').
    """
    highlevel = need("rosbags.highlevel", extra="ros", what="a ROS bag")
    typesys = need("rosbags.typesys", extra="ros", what="a ROS bag")
    default = typesys.get_typestore(typesys.Stores.LATEST)
    groups: list[Group] = []
    with highlevel.AnyReader([_named(path)], default_typestore=default) as bag:
        topics: dict[str, list[Any]] = {}
        for connection in bag.connections:
            if connection.msgtype.rpartition("/")[2] not in _BULKY:
                topics.setdefault(connection.topic, []).append(connection)
        base = int(bag.start_time) if bag.message_count else 0
        for topic, connections in topics.items():
            group = _group(bag, topic, connections, base, layout.stamps)
            if group is not None:
                groups.append(group)
    name = "ROS 1 bag" if _head(path) == _ROS1 else "ROS 2 bag"
    return Log(format=name, groups=tuple(groups), origin=base / 1e9)


ROS = Reader(
    format="ROS bag",
    sniff=sniff,
    channels=channels,
    read=read,
    extra="ros",
    foreign=True,
    uses=("stamps",),
)


def _head(path: Path) -> bytes:
    if path.is_dir():
        return b""
    with path.open("rb") as file:
        return file.read(len(_ROS1))


def _named(path: Path) -> Path:
    """The path with the ending that the library goes by, as the content asks for it."""
    if path.is_dir():
        return path
    head = _head(path)
    ending = ".bag" if head == _ROS1 else ".mcap" if head.startswith(_MCAP) else ".db3"
    if path.suffix == ending:
        return path

    class Named(type(path)):  # type: ignore[misc]
        suffix = property(lambda self: ending)

    named: Path = Named(path)
    return named


def _group(
    bag: Any, topic: str, connections: Sequence[Any], base: int, stamps: Stamps
) -> Group | None:
    """A topic as a group; None if its messages hold no numbers."""
    logged: list[int] = []
    sent: list[int] = []
    rows: list[dict[str, float]] = []
    for connection, stamp, raw in bag.messages(connections=connections):
        message = bag.deserialize(raw, connection.msgtype)
        row = dict(_leaves(message, "", 0))
        own = row.pop("header.stamp.sec", None), row.pop("header.stamp.nanosec", None)
        logged.append(int(stamp))
        if own[0] is not None and own[1] is not None:
            sent.append(int(own[0]) * 10**9 + int(own[1]))
        rows.append(row)
    names = list(dict.fromkeys(name for row in rows[:1] + rows[-1:] for name in row))
    if not names:
        return None
    table = np.array([[row.get(name, np.nan) for name in names] for row in rows])
    by_header = stamps != "log" and len(sent) == len(logged) and any(sent)
    ticks = np.array(sent if by_header else logged, dtype=np.int64)
    if by_header and abs(int(ticks[0]) - base) > _DAY:  # a clock of its own, as of a simulation
        base = 0
    units = _UNITS.get(connections[0].msgtype, {})
    columns = tuple(
        Column(
            name=f"{topic}.{name}",
            unit=_unit(name, units),
            samples=len(rows),
            load=partial(_values, table, k),
        )
        for k, name in enumerate(names)
    )
    return Group(
        name=topic,
        columns=columns,
        time=seconds_since(ticks, base, per_second=10**9),
        time_name="header.stamp" if by_header else "log time",
        stamped="sender" if by_header else "log",
    )


def _leaves(value: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Names and numbers of a message, nested ones by their path."""
    if depth > 12:
        return
    fields = getattr(value, "__dataclass_fields__", None)
    if fields is not None:
        labels = getattr(value, "name", None)
        labels = labels if isinstance(labels, list) and len(set(labels)) == len(labels) else None
        for field in fields:
            if field == "__msgtype__":
                continue
            part = getattr(value, field)
            path = f"{name}.{field}" if name else field
            if isinstance(part, np.ndarray | list):
                yield from _array(part, path, labels, depth)
            else:
                yield from _leaves(part, path, depth + 1)
    elif isinstance(value, bool | int | float | np.number | np.bool_):
        yield name, float(value)


def _array(
    values: Any, path: str, labels: Sequence[str] | None, depth: int
) -> Iterator[tuple[str, float]]:
    """Elements by number, or by the names that the message has for them, as joints have."""
    if len(values) > _MOST:
        return
    fitting = labels is not None and len(labels) == len(values)
    for k, value in enumerate(values):
        label = labels[k] if fitting and labels is not None else k
        yield from _leaves(value, f"{path}[{label}]", depth + 1)


def _unit(name: str, units: Mapping[str, str]) -> str:
    return next((u for part, u in units.items() if name.startswith(f"{part}.")), "")


def _values(table: NDArray[np.float64], place: int) -> NDArray[np.float64]:
    return np.ascontiguousarray(table[:, place])
