"""Messages of ROS bags, through rosbags (extra `ros`)."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from hashlib import sha256
from itertools import islice
from pathlib import Path
from struct import unpack_from
from typing import Any, NamedTuple

from regionpose.io.bags.place import NANOSECONDS, BagPlace
from regionpose.io.bags.unfolding import bounded
from regionpose.io.reading import FileError, check_regular
from regionpose.progress import Progress
from regionpose.validation.extras import MissingExtraError, load_extra

ABSOLUTE_NS = 10**8 * NANOSECONDS
"""Times from here on count since 1970: 3 March 1973, and longer than any recording. A convention."""

SEARCHED_NS = NANOSECONDS
"""How far from a time its message may lie: sensors send several a second."""


LIVOX_POINT = "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\nuint8 reflectivity\nuint8 tag\nuint8 line\n"
LIVOX_SCAN = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\nuint8[3] rsvd\nCustomPoint[] points\n"
)
FURTHER_TYPES = {
    f"{driver}/msg/{name}": definition
    for driver in ("livox_ros_driver", "livox_ros_driver2")
    for name, definition in (("CustomPoint", LIVOX_POINT), ("CustomMsg", LIVOX_SCAN))
}
"""Definitions of messages that clouds are read of and that ROS itself has not, for bags that don't hold their own."""


class Message(NamedTuple):
    """A message, its type as `sensor_msgs/msg/PointCloud2`, and its bytes in the bag."""

    content: Any
    kind: str
    raw: bytes


def read_messages(place: BagPlace, kinds: Sequence[str], *, progress: Progress | None = None) -> list[Message]:
    """The messages of a place, whose type is one of `kinds`, without their package.

    FileError for a bag that is damaged, without the topic, or with too few messages from there on; FileNotFoundError;
    MissingExtraError without rosbags.
    """
    with _opened(place) as reader:
        connections = _connections(place, reader, kinds)
        start = _start(place, reader, connections)
        found = []
        for connection, _, raw in islice(reader.messages(connections, start=start), place.count):
            found.append(Message(reader.deserialize(raw, connection.msgtype), connection.msgtype, bytes(raw)))
            if progress is not None:
                progress(len(found) / place.count)
    if len(found) < place.count:
        raise FileError(f"{place}: found {len(found)} messages from there on; needed {place.count}")
    return found


class BagSummary(NamedTuple):
    """What a bag holds: its length and beginning, seconds, and name, type and number of messages of each topic."""

    duration_s: float
    begins_s: float | None
    topics: list[tuple[str, str, int]]


def summary(bag: Path) -> BagSummary:
    """What a bag holds; errors as of `read_messages`."""
    with _opened(BagPlace(bag, "")) as reader:
        topics: dict[tuple[str, str], int] = {}
        for each in reader.connections:
            topics[each.topic, each.msgtype] = topics.get((each.topic, each.msgtype), 0) + each.msgcount
        listed = [(name, kind, count) for (name, kind), count in sorted(topics.items())]
        if not any(topics.values()):
            return BagSummary(0.0, None, listed)
        return BagSummary(reader.duration / NANOSECONDS, reader.start_time / NANOSECONDS, listed)


def kind_of(place: BagPlace) -> str:
    """The type of a place's messages, without its package; errors as of `read_messages`."""
    with _opened(place) as reader:
        return str(_connections(place, reader, ())[0].msgtype).rpartition("/")[2]


def digest(place: BagPlace) -> tuple[int, str]:
    """The number of bytes of a place's messages, and their SHA-256, hexadecimal; errors as of `read_messages`."""
    content = b"".join(message.raw for message in read_messages(place, ()))
    return len(content), sha256(content).hexdigest()


class RecordedMessage(NamedTuple):
    """A message that a pass over a bag meets.

    `time_ns`: when it was recorded, `stamp_ns`: the time in its header, both from the bag's beginning. `fraction`: how
    much of the recording is read with it, from 0 to 1. `read` returns its content; FileError where that is damaged.
    """

    topic: str
    time_ns: int
    stamp_ns: int
    fraction: float
    read: Callable[[], Any]


def recorded_messages(bag: Path, topics: Sequence[str]) -> Generator[RecordedMessage, None, None]:
    """The messages of topics of a bag, whose types begin with a header, in the order of their recording, one at a time.

    FileError for a bag without one of the topics; else errors as of `read_messages`.
    """
    places = [BagPlace(bag, topic) for topic in topics]
    with _opened(BagPlace(bag, "")) as reader:
        connections = [each for place in places for each in _connections(place, reader, ())]
        begin, duration = reader.start_time, max(1, reader.duration)
        for connection, time, raw in reader.messages(connections):
            read = partial(_deserialized, reader, connection, raw)
            stamp = _stamp_ns(raw, is_big_endian=reader.is2 and not raw[1]) - begin
            yield RecordedMessage(connection.topic, time - begin, stamp, (time - begin) / duration, read)


def _stamp_ns(raw: bytes, *, is_big_endian: bool) -> int:
    """The time of a header, which stands after four bytes: its number in ROS 1, the encoding's in ROS 2."""
    seconds, nanoseconds = unpack_from(">iI" if is_big_endian else "<iI", raw, 4)
    return int(seconds) * NANOSECONDS + int(nanoseconds)


def _deserialized(reader: Any, connection: Any, raw: bytes) -> Any:
    with _damage_named(BagPlace(Path(reader.paths[0]), connection.topic)):
        return reader.deserialize(raw, connection.msgtype)


@contextmanager
def usual_fields(place: BagPlace) -> Iterator[None]:
    """FileError where messages lack fields of their type, or hold others in them: a bag defines its types itself."""
    try:
        yield
    except (AttributeError, TypeError, OverflowError, ValueError) as error:
        # Errors of the package have types of their own.
        if isinstance(error, ValueError) and type(error) is not ValueError:
            raise
        described = " ".join(str(error).split())[:200]
        raise FileError(f"{place}: found a message of other fields ({described}); needed those of its type") from error


@contextmanager
def _opened(place: BagPlace) -> Iterator[Any]:
    """The reader of a bag; whatever fails inside is the bag's fault."""
    highlevel = load_extra("rosbags.highlevel", "ros", f"{place}: ROS")
    typesys = load_extra("rosbags.typesys", "ros", f"{place}: ROS")
    check_regular(place.bag)
    if not place.bag.exists():
        raise FileNotFoundError(2, "No such file or directory", str(place.bag))
    # Bags of older releases of ROS 2 in SQLite don't hold their types.
    typestore = typesys.get_typestore(typesys.Stores.LATEST)
    for name, definition in FURTHER_TYPES.items():
        typestore.register(typesys.get_types_from_msg(definition, name))
    with (
        _damage_named(place),
        bounded(place.bag),
        highlevel.AnyReader([place.bag], default_typestore=typestore) as reader,
    ):
        yield reader


@contextmanager
def _damage_named(place: BagPlace) -> Iterator[None]:
    """FileError that names the place for errors of the packages that read bags."""
    try:
        yield
    except (FileError, MissingExtraError):
        raise
    # Damage shows as errors of rosbags, of its decompressors, and of SQLite, each of its own type.
    except Exception as error:
        described = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        raise FileError(f"{place}: found damage ({described}); needed a whole bag of ROS 1, ROS 2 or MCAP") from error


def _connections(place: BagPlace, reader: Any, kinds: Sequence[str]) -> list[Any]:
    """The connections of a place's topic."""
    found = [each for each in reader.connections if each.topic == place.topic]
    if not found:
        needed = ", ".join(sorted({each.topic for each in reader.connections})) or "one with topics"
        raise FileError(f"{place}: found no such topic; needed one of the bag's: {needed}")
    wrong = next((each.msgtype for each in found if kinds and each.msgtype.rpartition("/")[2] not in kinds), None)
    if wrong is not None:
        raise FileError(f"{place}: found {wrong}; needed {' or '.join(kinds)}")
    return found


def _start(place: BagPlace, reader: Any, connections: list[Any]) -> int | None:
    """The time of the message that is nearest to a place's, nanoseconds; None for the first one."""
    if place.time_ns is None:
        return None
    wanted = place.time_ns + (0 if place.time_ns >= ABSOLUTE_NS else reader.start_time)
    around = reader.messages(connections, start=wanted - SEARCHED_NS, stop=wanted + SEARCHED_NS)
    times = [time for _, time, _ in around]
    if not times:
        span = f"0 to {reader.duration / NANOSECONDS:.3f} s, or {reader.start_time / NANOSECONDS:.3f} s since 1970 on"
        raise FileError(f"{place}: found no message within a second of the time; needed a time from {span}")
    return int(min(times, key=lambda time: abs(time - wanted)))
