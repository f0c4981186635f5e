"""Which photos and clouds of a recording `regionpose calibrate` takes, by its options."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from regionpose.cli.console import Progress

if TYPE_CHECKING:
    from regionpose.scene.folder import FolderOptions
    from regionpose.scene.loading import Scene


class Choice(NamedTuple):
    """The options of that name; None of those that are not given."""

    photos: str | None
    clouds: str | None
    times: str | None
    frames: int | None

    def check(self, path: Path, *, is_recording: bool) -> None:
        """Check that the options apply to `path`; ValueError that names one that does not."""
        given = next((name for name, value in self._asdict().items() if value is not None), None)
        if given is not None and not is_recording:
            raise ValueError(f"--{given}: found it with {path}; needed a bag of ROS or an MCAP file")
        if self.times is not None and self.frames is not None:
            raise ValueError("--frames: found it beside --times; needed one of them")


def recording_scene(
    bag: Path, path: Path, options: FolderOptions, choice: Choice, progress: Progress
) -> tuple[Scene, list[str]]:
    """The scene of the pairs of a recording that are chosen, to be written to `path`, and remarks that list them."""
    from regionpose.scene.recording import FRAMES, pairs_at, pairs_spread, scene_of_recording, topics_of, wanted_times

    if options.coco is not None:
        raise ValueError(f"--coco: found it with {bag}; needed a folder")
    times = None if choice.times is None else wanted_times(choice.times)
    progress.begin("photos of the recording")
    topics = topics_of(bag, choice.photos, choice.clouds)
    if times is None:
        pairs = pairs_spread(bag, topics, choice.frames or FRAMES, progress.fraction)
    else:
        pairs = pairs_at(bag, topics, times, progress.fraction)
    remarks = [f"frames of {bag}: {topics.photos} with {topics.clouds}"]
    remarks += [f"  {pair.name}, {pair.delay_text}" for pair in pairs]
    return scene_of_recording(bag, topics, pairs, path, options), remarks
