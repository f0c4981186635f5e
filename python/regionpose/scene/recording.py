"""A recording, a bag of ROS or an MCAP file, read as the scene of a few of its photos and clouds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from decimal import Decimal, InvalidOperation
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose.io.bags import camera_info, pictures
from regionpose.io.bags.messages import ABSOLUTE_NS, BagSummary, RecordedMessage, recorded_messages, summary
from regionpose.io.bags.pictures import message_picture
from regionpose.io.bags.place import NANOSECONDS, BagPlace
from regionpose.io.clouds import ros
from regionpose.progress import Progress, check_wanted
from regionpose.scene.document import SceneError
from regionpose.scene.folder import FolderOptions, Pair, scene_of_pairs
from regionpose.scene.loading import Scene
from regionpose.scene.photo_samples import MOST_SAMPLES, PhotoSampler, select_photos

Whole = NDArray[np.int64]

FRAMES = 5
"""Frames that are taken of a recording: the pose of five is sure where that of one may not be, and more take longer."""

MOST_APART_NS = NANOSECONDS
"""How far a header's time may be from that of the recording to be of the same clock, and a cloud from its photo."""

RECTIFIED = "image_rect"
"""How names of topics of rectified photos begin, by ROS's image_proc."""


class RecordedPair(NamedTuple):
    """A photo and the cloud nearest to it: when each was recorded, and how much later the cloud was taken.

    Nanoseconds, from the recording's beginning.
    """

    photo_ns: int
    cloud_ns: int
    later_ns: int

    @property
    def name(self) -> str:
        """The photo's time, as 12.500 s."""
        return f"{self.photo_ns / NANOSECONDS:.3f} s"

    @property
    def delay_text(self) -> str:
        """When the cloud was taken, as 12 ms later."""
        return f"cloud {abs(self.later_ns) / 1e6:.0f} ms {'later' if self.later_ns >= 0 else 'earlier'}"


@dataclass(frozen=True)
class Topics:
    """Topics of a recording, with a slash before: photos, clouds, and the calibration of the photos, if there is one.

    `rectified`: the photos are, by the name of their topic.
    """

    photos: str
    clouds: str
    calibration: str | None = None

    @property
    def rectified(self) -> bool:
        """Whether the photos are rectified, by the name of their topic."""
        return any(part.startswith(RECTIFIED) for part in self.photos.split("/"))


def topics_of(bag: Path, photos: str | None = None, clouds: str | None = None) -> Topics:
    """The topics of a recording that are given or the only ones of their kind; SceneError that lists them otherwise."""
    contents = summary(bag)
    of_photos = _topic(bag, contents, "photos", pictures.KINDS, photos)
    of_clouds = _topic(bag, contents, "clouds", ros.KINDS, clouds)
    return Topics(of_photos, of_clouds, _calibration_topic(contents, of_photos))


def _of_kinds(contents: BagSummary, kinds: Sequence[str]) -> dict[str, str]:
    """The types of topics with messages of some kinds, without their package."""
    return {name: kind for name, kind, count in contents.topics if count and kind.rpartition("/")[2] in kinds}


def _topic(bag: Path, contents: BagSummary, of: str, kinds: Sequence[str], given: str | None) -> str:
    """The topic `given` of photos or clouds, `of`, or the only one of these; SceneError otherwise."""
    candidates = _of_kinds(contents, kinds)
    listed = ", ".join(f"{name} ({kind})" for name, kind in candidates.items())
    if not candidates:
        all_topics = ", ".join(f"{name} ({kind})" for name, kind, _ in contents.topics) or "nothing"
        raise SceneError(f"{bag}: found no topic of {of}, but {all_topics}; needed one of {' or '.join(kinds)}")
    if given is not None:
        named = f"/{given.lstrip('/')}"
        if named not in candidates:
            raise SceneError(f"{of}: found {given}; needed a topic of {bag}: {listed}")
        return named
    if len(candidates) > 1:
        raise SceneError(f"{bag}: found {len(candidates)} topics of {of}; needed {of}, one of {listed}")
    return next(iter(candidates))


def _calibration_topic(contents: BagSummary, photos: str) -> str | None:
    """The calibration of the photos' innermost namespace that has one; else the only one, of a single camera."""
    candidates = list(_of_kinds(contents, camera_info.KINDS))
    beside = [name for name in candidates if photos.startswith(name.rpartition("/")[0] + "/")]
    inside = [name for name in beside if name.count("/") > 1]
    if inside:
        return max(inside, key=len)
    return candidates[0] if len(candidates) == 1 and len(_of_kinds(contents, pictures.KINDS)) == 1 else None


def wanted_times(text: str) -> list[Decimal]:
    """Times of a text, seconds; ValueError for words that are none."""
    times = []
    for word in (word.strip() for word in text.split(",")):
        try:
            times.append(Decimal(word))
        except InvalidOperation as error:
            raise ValueError(f"times: found {word!r}; needed seconds, with commas between") from error
        if not (times[-1].is_finite() and times[-1] >= 0):
            raise ValueError(f"times: found {word}; needed seconds from the recording's beginning")
    return times


def pairs_at(
    bag: Path, topics: Topics, times: Sequence[Decimal], progress: Progress | None = None
) -> list[RecordedPair]:
    """The pairs of the photos nearest to some times, seconds from the beginning or since 1970; SceneError where photo
    or cloud are not within a second.
    """
    timeline = Timeline()
    for message in _messages(bag, topics, progress):
        timeline.add(message, is_photo=message.topic == topics.photos)
    begin_ns = int((summary(bag).begins_s or 0.0) * NANOSECONDS)
    pairs: list[RecordedPair] = []
    for time in times:
        time_ns = int(time * NANOSECONDS)
        pair = timeline.pair_near(time_ns - (begin_ns if time_ns >= ABSOLUTE_NS else 0))
        if pair is None:
            raise SceneError(f"times: found no photo and cloud within a second of {time}; needed {timeline.span}")
        pairs.append(pair)
    return list(dict.fromkeys(pairs))


def pairs_spread(bag: Path, topics: Topics, count: int, progress: Progress | None = None) -> list[RecordedPair]:
    """At most so many pairs over all that a recording shows, of photos without motion and with many edges.

    SceneError where no photo has a cloud within a second.
    """
    timeline, samples = Timeline(), PhotoSampler(int(summary(bag).duration_s * NANOSECONDS) // MOST_SAMPLES)
    for message in _messages(bag, topics, progress):
        is_photo = message.topic == topics.photos
        if is_photo and samples.is_due(message.time_ns):
            check_wanted()
            picture = message_picture(BagPlace(bag, topics.photos), message.read())
            samples.add(len(timeline.photos.recorded), message.time_ns, picture)
        timeline.add(message, is_photo=is_photo)
    paired = [(sample, timeline.pair(sample.photo)) for sample in samples.finished()]
    near = [(sample, pair) for sample, pair in paired if pair is not None]
    if not near:
        topic = f"{topics.photos} and {topics.clouds}"
        raise SceneError(f"{bag}: found no photo with a cloud within a second; needed {topic} of one time")
    # How far the rig moves between photo and cloud, and while a cloud is made, in levels of the photo.
    seconds = [abs(pair.later_ns) / NANOSECONDS + 0.5 * timeline.sweep_s for _, pair in near]
    motion = np.array([sample.change_rate for sample, _ in near]) * seconds
    return [near[index][1] for index in select_photos([sample for sample, _ in near], motion, count)]


def _messages(bag: Path, topics: Topics, progress: Progress | None) -> Iterator[RecordedMessage]:
    with closing(recorded_messages(bag, (topics.photos, topics.clouds))) as messages:
        for message in messages:
            if progress is not None:
                progress(message.fraction)
            yield message


@dataclass
class Times:
    """When the messages of a topic were recorded, and the times in their headers, nanoseconds from the beginning."""

    recorded: list[int] = field(default_factory=list)
    stamps: list[int] = field(default_factory=list)

    @property
    def are_stamped(self) -> bool:
        """Whether headers have times of the recording's clock."""
        return all(abs(stamp - time) <= MOST_APART_NS for stamp, time in zip(self.stamps, self.recorded, strict=True))


@dataclass
class Timeline:
    """When photos and clouds of a recording were taken."""

    photos: Times = field(default_factory=Times)
    clouds: Times = field(default_factory=Times)

    def add(self, message: RecordedMessage, *, is_photo: bool) -> None:
        """Take in a message."""
        times = self.photos if is_photo else self.clouds
        times.recorded.append(message.time_ns)
        times.stamps.append(message.stamp_ns)

    @cached_property
    def capture_times_ns(self) -> tuple[Whole, Whole]:
        """When photos (n,) and clouds (m,) were taken: by their headers, if both have the recording's clock."""
        stamped = self.photos.are_stamped and self.clouds.are_stamped
        photos, clouds = (times.stamps if stamped else times.recorded for times in (self.photos, self.clouds))
        return np.array(photos, dtype=np.int64), np.array(clouds, dtype=np.int64)

    @property
    def sweep_s(self) -> float:
        """The time from one cloud to the next, seconds; 0 of a single one."""
        return (
            float(np.median(np.diff(np.sort(self.capture_times_ns[1])))) / NANOSECONDS
            if len(self.capture_times_ns[1]) > 1
            else 0.0
        )

    @property
    def span(self) -> str:
        """From when to when there are photos."""
        if not self.photos.recorded:
            return "a recording with photos"
        ends = (min(self.photos.recorded), max(self.photos.recorded))
        return "photos from {:.3f} to {:.3f} s".format(*(end / NANOSECONDS for end in ends))

    def pair(self, photo: int) -> RecordedPair | None:
        """A photo, by its place among all, and the cloud nearest to it; None where none is within a second."""
        photos, clouds = self.capture_times_ns
        if not len(clouds):
            return None
        nearest = int(np.abs(clouds - photos[photo]).argmin())
        later = int(clouds[nearest] - photos[photo])
        if abs(later) > MOST_APART_NS:
            return None
        return RecordedPair(self.photos.recorded[photo], self.clouds.recorded[nearest], later)

    def pair_near(self, time_ns: int) -> RecordedPair | None:
        """The pair of the photo recorded nearest to a time; None where photo or cloud are not within a second."""
        recorded = np.array(self.photos.recorded, dtype=np.int64)
        if not len(recorded):
            return None
        photo = int(np.abs(recorded - time_ns).argmin())
        return self.pair(photo) if abs(int(recorded[photo]) - time_ns) <= MOST_APART_NS else None


def scene_of_recording(
    bag: Path, topics: Topics, pairs: Sequence[RecordedPair], path: Path, options: FolderOptions
) -> Scene:
    """The scene of pairs of a recording, to be written to `path`; its camera is the recording's, unless one is given.

    SceneError where neither is there.
    """
    if options.camera is None:
        if topics.calibration is None:
            raise SceneError(f"{bag}: found no calibration (CameraInfo) beside {topics.photos}; needed camera")
        contents: dict[str, Any] = {"file": f"{bag}#{topics.calibration}"}
        options = replace(options, camera={**contents, "rectified": True} if topics.rectified else contents)
    frames = [
        Pair(pair.name, _at(bag, topics.photos, pair.photo_ns), _at(bag, topics.clouds, pair.cloud_ns), None, ())
        for pair in pairs
    ]
    return scene_of_pairs(bag, frames, path, options, [f"{pair.name}: {pair.delay_text}" for pair in pairs])


def _at(bag: Path, topic: str, time_ns: int) -> Path:
    """The message of a topic that was recorded at a time."""
    seconds, rest = divmod(time_ns, NANOSECONDS)
    return Path(f"{bag}#{topic}@{seconds}.{rest:09d}")
