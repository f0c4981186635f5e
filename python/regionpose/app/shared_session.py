"""A session shared by several pages: serialized edits, with the pose and the pictures in the background."""

from __future__ import annotations

import io
import threading
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from regionpose.app.depth_overlays import depth_overlay, overlay_poses
from regionpose.app.estimator import Estimator
from regionpose.app.outcome import Outcome, rounded
from regionpose.app.parts import Picked
from regionpose.app.range_view import RangeView, depth_and_intensity, grays
from regionpose.app.scanner import proposed_scanner
from regionpose.app.session import Session
from regionpose.app.sketch import Sketch
from regionpose.app.solid_view import RayIndex, point_buffer, sample_indices
from regionpose.fusion.colors import colored_cloud
from regionpose.io.clouds import Cloud
from regionpose.validation.arrays import Array

Bytes = NDArray[np.uint8]

LARGEST_SIDE = 4096
"""Pixels of the longer side of the photo as it is sent."""

PALETTE = ("#ff9f1c", "#29b6f6", "#9ccc3c", "#ff5d8f", "#b388ff", "#ffd60a", "#00d9b0", "#ff7043", "#5c8dff", "#d4e157")
"""Colors of the regions, distinct on photos and on the depth colors; the eleventh begins again."""

MEMBER_FRACTION = 0.65
"""How much of a region's color its points take in the cloud."""

UNSEEN_LIGHT = 0.35
"""Light that is left of points that the camera doesn't see, beside those with the photo's colors."""

COLORINGS = {"depth": "Depth", "intensity": "Intensity", "own": "Color", "photo": "Photo"}


@dataclass(frozen=True)
class ServedFile:
    """A file that the page asks for."""

    content: bytes
    media: str


class SharedSession:
    """A session and what its pages show of it. All methods are thread-safe."""

    def __init__(self, session: Session) -> None:
        """Make the pictures of photo and cloud, and wait for edits.

        `cloud`: the points that either picture of the cloud shows.
        """
        self.revision = self.pictured = 0
        # Without a region in sight, it is by the cloud over the photo that one sees whether a pose is right.
        self.shows_depth = session.searches_edges
        self.files: dict[str, ServedFile] = {}
        self._lock = threading.RLock()
        self._look_at(session)
        self._estimator = Estimator(self._lock, self._snapshot, self._show)
        self._begin()

    def show_session(self, session: Session) -> None:
        """Show another session, as of the next frame of a rig, in the place of this one."""
        with self._lock:
            self._estimator.abandon()
            self._look_at(session)
            self.revision += 1
            self._begin()

    def _begin(self) -> None:
        """Start to estimate the session's pose; none where the session determines none."""
        session = self.session
        self.outcome = Outcome("busy", searches_edges=session.searches_edges) if session.has_estimate else Outcome()
        # Also where there is nothing to be estimated: what runs is canceled.
        self._estimator.begin()

    def _look_at(self, session: Session) -> None:
        """Show a session whose pose is not estimated yet."""
        self.session = session
        self.outcome = Outcome()
        self.coloring = "depth"
        self._overlays: tuple[str, ...] = ()
        self._rays: RayIndex | None = None
        self.proposal = proposed_scanner(session.cloud) if session.lacks_scanner else None
        self._look()
        self.middle = np.median(self.cloud.local_points[self._sample], axis=0)
        self._serve_still()
        self._serve_cloud()

    def _look(self) -> None:
        """Draw the cloud from the scanner's place, or from the cloud's zero where that isn't given."""
        cloud, scanner = self.session.cloud, self.session.scan.scanner
        self.place = np.zeros(3) if scanner is None else scanner
        self.range_view = RangeView.of(cloud, self.place, _up(self.session))
        sample, pictured = sample_indices(len(cloud)), self.range_view.indices
        self._displayed, places = _places(len(cloud), sample, pictured[pictured >= 0])
        self._sample = places[sample]
        self._pictured = np.where(pictured >= 0, places[pictured], np.int32(-1))
        self.cloud = _part(cloud, self._displayed)
        self._colors: dict[str, Bytes] = {"depth": depth_and_intensity(self.cloud, self.place)}

    def close(self) -> None:
        """End the background work."""
        self._estimator.close()

    @property
    def colorings(self) -> dict[str, str]:
        """The ways to color the cloud that there are now, and what the page calls them."""
        cloud = self.cloud
        there = {"depth": True, "intensity": cloud.intensity is not None, "own": cloud.colors is not None}
        there["photo"] = self.outcome.is_current
        return {key: title for key, title in COLORINGS.items() if there[key]}

    def edit(self, action: Callable[[Session], object]) -> None:
        """Change the session; errors as of the session, which is unchanged then."""
        with self._lock:
            before, basis = self.session.sketch, self.session.basis
            action(self.session)
            if self.session.sketch is not before:
                is_same_prior = before.base.get("prior") == self.session.base.get("prior")
                self._edited(before, is_solved=is_same_prior and basis == self.session.basis)

    def _edited(self, sketch: Sketch, *, is_solved: bool) -> None:
        before, looked = sketch.regions, sketch.scan is not self.session.scan
        # First of all: no page may show the pose of other regions as that of these.
        if looked or not is_solved:
            searches = self.session.searches_edges
            if self.session.can_estimate or (searches and self.outcome.searches_edges):
                self.outcome = replace(self.outcome, state="busy", searches_edges=searches)
                self._estimator.begin()
            else:
                self._begin()
        self.revision += 1
        if looked:
            self._look()
        if looked or _worlds(before) != _worlds(self.session.regions):
            self._serve_cloud()
            # Again: a page that looked in between has shown the picture before.
            self.revision += 1

    def save(self) -> list[Path]:
        """Save the session; errors and paths as of `Session.save`."""
        with self._lock:
            written = self.session.save()
            self.revision += 1
            return written

    def pixel_in_range(self, x: float, y: float) -> Array:
        """The point (3,) of the world that a pixel of the range image shows; ValueError where it shows none."""
        index = self.range_view.point_at(x, y)
        if index is None:
            raise ValueError("no point of the cloud is there; click on a surface")
        return self._world(index)

    def cut_in_range(self, ring: Sequence[Sequence[float]]) -> Callable[[Session], None]:
        """The edit that gives the selected region, or a new one, the points of a plane inside a ring (k, 2) of the
        range image's pixels; errors, when it is made, as of `Session.cut_cloud` and `RangeView.inside`.
        """
        view = self.range_view
        return lambda session: session.cut_cloud(lambda points: view.inside(ring, points), view.visible_points)

    def point_on_ray(self, origin: Array, direction: Array) -> Array:
        """The point (3,) of the world that a ray about the middle of the shown points meets; ValueError for none."""
        with self._lock:
            if self._rays is None:
                self._rays = RayIndex.of(self.session.cloud.local_points)
        return self._world(self._rays.nearest(origin + self.middle, direction))

    def _world(self, index: int) -> Array:
        return np.asarray(self.session.cloud.local_points[index] + self.session.cloud.origin)

    def color_by(self, coloring: str) -> None:
        """Color the cloud in one of the ways of `colorings`."""
        with self._lock:
            if coloring in self.colorings and coloring != self.coloring:
                self.coloring = coloring
                self._serve_cloud()
                self.revision += 1

    def show_depth(self, wanted: bool) -> None:
        """Draw the cloud's points by their distance over the photo, at each pose from now on, or no longer."""
        with self._lock:
            self.shows_depth = wanted
            if wanted:
                self._serve_depth()
            self.revision += 1

    @property
    def depth_files(self) -> list[str]:
        """The pictures of the cloud over the photo: at the pose, and at the next likeliest one unless the pose is
        trusted; none where they are not wanted, or there is no pose.
        """
        names = self._overlays if self.shows_depth and self.outcome.run is not None else ()
        return [f"files/{name}?{self.pictured}" for name in names]

    def photo_shapes(self) -> list[dict[str, Any]]:
        """The regions' outlines in the photo, for the page."""
        return [_photo_shape(picked, self.session.sketch.selected) for picked in self.session.regions if picked.image]

    def projected_shapes(self) -> list[dict[str, Any]]:
        """The outlines that the pose projects into the photo, for the page."""
        keys = {picked.key for picked in self.session.regions}
        return [
            {"color": color_of(key), "lines": lines} for key, lines in self.outcome.projected.items() if key in keys
        ]

    def range_shapes(self) -> list[dict[str, Any]]:
        """The regions' outlines in the range image, for the page."""
        return [self._world_shape(picked, self._range_line) for picked in self.session.regions if picked.world]

    def solid_shapes(self) -> list[dict[str, Any]]:
        """The regions' outlines in 3D, about the middle of the shown points, for the page."""
        return [self._world_shape(picked, self._solid_line) for picked in self.session.regions if picked.world]

    def _world_shape(self, picked: Picked, line: Callable[[Array], list[list[float]]]) -> dict[str, Any]:
        assert picked.world is not None
        rings = picked.world.chosen.side.region.rings
        selected = picked.key == self.session.sketch.selected
        lines = [line(ring) for ring in rings]
        return {"key": picked.key, "name": picked.name, "color": color_of(picked.key), "selected": selected} | {
            "lines": lines
        }

    def _range_line(self, ring: Array) -> list[list[float]]:
        return rounded(self.range_view.pixels(_split(np.concatenate([ring, ring[:1]]))))

    def _solid_line(self, ring: Array) -> list[list[float]]:
        return rounded(np.concatenate([ring, ring[:1]]) - self.middle)

    def _serve_still(self) -> None:
        """What never changes: the photo and the places of the shown points."""
        photo = Image.fromarray(self.session.image)
        photo.thumbnail((LARGEST_SIDE, LARGEST_SIDE), Image.Resampling.LANCZOS)
        self.files["photo.jpg"] = ServedFile(_encoded(photo, "JPEG"), "image/jpeg")
        points = self.cloud.local_points[self._sample]
        self.files["points.bin"] = ServedFile(point_buffer(points, self.middle), "application/octet-stream")

    def _serve_cloud(self) -> None:
        """The range image and the colors of the shown points, with the regions' own points in their colors."""
        colors = self._marked(self._colors_of(self.coloring))
        picture = Image.fromarray(self.range_view.picture(self.cloud.local_points, colors, self._pictured))
        self.pictured += 1
        self.files["range.jpg"] = ServedFile(_encoded(picture, "JPEG"), "image/jpeg")
        self.files["colors.bin"] = ServedFile(colors[self._sample].tobytes(), "application/octet-stream")

    def _serve_depth(self) -> None:
        """The photo with the points that either picture of the cloud shows, at the last poses; none without a pose."""
        session, poses = self.session, overlay_poses(self.outcome)
        for name, pose in poses.items():
            picture = Image.fromarray(depth_overlay(session.image, session.camera, self.cloud, pose))
            picture.thumbnail((LARGEST_SIDE, LARGEST_SIDE), Image.Resampling.LANCZOS)
            self.files[name] = ServedFile(_encoded(picture, "JPEG"), "image/jpeg")
        # Last: a page that looks in between would keep what it finds.
        self._overlays = tuple(poses)
        self.pictured += 1

    def _marked(self, colors: Bytes) -> Bytes:
        marked = colors.copy()
        for picked in self.session.regions:
            if picked.world is not None and picked.world.chosen.side.indices is not None:
                indices = _places_in(self._displayed, picked.world.chosen.side.indices)
                own = np.array([int(color_of(picked.key)[at : at + 2], 16) for at in (1, 3, 5)])
                marked[indices] = np.round(MEMBER_FRACTION * own + (1.0 - MEMBER_FRACTION) * marked[indices])
        return marked

    def _colors_of(self, coloring: str) -> Bytes:
        cloud = self.cloud
        if coloring == "photo":
            return self._photo_colors()
        if coloring not in self._colors:
            own = coloring == "own" and cloud.colors is not None
            shades = cloud.colors if own else np.repeat(np.round(255.0 * grays(cloud))[:, None], 3, axis=1)
            self._colors[coloring] = np.asarray(shades, dtype=np.uint8)
        return self._colors[coloring]

    def _photo_colors(self) -> Bytes:
        """The photo's colors on the points that the camera sees by the last pose, the others dark."""
        run = self.outcome.run
        if run is None:
            return self._colors_of("depth")
        session = self.session
        cloud, visible = colored_cloud([(session.camera, session.image, run.estimate.pose)], self.cloud)
        dark = np.round(UNSEEN_LIGHT * self._colors_of("depth")).astype(np.uint8)
        return dark if cloud.colors is None else np.where(visible[:, None], cloud.colors, dark).astype(np.uint8)

    def _snapshot(self) -> Session:
        return copy(self.session)

    def _show(self, outcome: Outcome) -> None:
        """Show what came of an estimate of the regions as they are."""
        self.outcome = outcome
        if self.coloring == "photo":
            self._serve_cloud()
        if self.shows_depth:
            self._serve_depth()
        self.revision += 1

    @property
    def stage(self) -> str:
        """What the estimate that runs does, and for how long it has run; nothing where none runs."""
        return self._estimator.stage

    def stop(self) -> None:
        """Wait no longer for the estimate that runs; the regions' own pose stays where it is there."""
        with self._lock:
            if self._estimator.abandon():
                stopped = replace(self.outcome, state="stopped")
                none = Outcome("stopped", searches_edges=self.session.searches_edges)
                self.outcome = stopped if self.outcome.state == "regions" else none
                self.revision += 1

    def estimate_again(self) -> None:
        """Estimate what was stopped."""
        with self._lock:
            if self.session.has_estimate:
                self.outcome = replace(self.outcome, state="busy")
                self.revision += 1
                self._estimator.begin()


def color_of(key: int) -> str:
    """The color of a region, as the page writes it."""
    return PALETTE[key % len(PALETTE)]


def _places(count: int, *chosen: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Indices, ascending, of the chosen ones of so many points, and the place of each point among them, -1 for none."""
    marked = np.zeros(count, dtype=np.bool_)
    for indices in chosen:
        marked[indices] = True
    indices = np.flatnonzero(marked)
    places = np.full(count, -1, dtype=np.int32)
    places[indices] = np.arange(len(indices), dtype=np.int32)
    return indices, places


def _part(cloud: Cloud, indices: NDArray[np.int64]) -> Cloud:
    """The points of a cloud with these indices."""
    return Cloud(
        cloud.local_points[indices],
        colors=None if cloud.colors is None else cloud.colors[indices],
        intensity=None if cloud.intensity is None else cloud.intensity[indices],
        origin=cloud.origin,
    )


def _places_in(ascending: NDArray[np.int64], wanted: NDArray[np.intp]) -> NDArray[np.intp]:
    """Where those wanted that are among the ascending, both ascending, stand there."""
    places = np.minimum(np.searchsorted(ascending, wanted), len(ascending) - 1)
    return np.asarray(places[ascending[places] == wanted])


def _up(session: Session) -> Array | None:
    """The world's upward direction where the scene gives it."""
    given = session.base.get("prior", {}).get("up")
    return None if given is None else np.asarray(given, dtype=np.float64)


def _worlds(regions: tuple[Picked, ...]) -> list[tuple[int, object]]:
    return [(picked.key, picked.world and picked.world.chosen) for picked in regions if picked.world]


def _photo_shape(picked: Picked, selected: int | None) -> dict[str, Any]:
    assert picked.image is not None
    part = picked.image.chosen
    rings = part.rings if part.is_polygon else [rounded(ring) for ring in part.region.rings]
    shape = {"key": picked.key, "name": picked.name, "color": color_of(picked.key), "rings": rings}
    hidden = part.hidden if part.is_polygon else []
    return shape | {"selected": picked.key == selected, "polygon": part.is_polygon, "hidden": hidden}


def _split(line: Array) -> Array:
    """A line (n, 3) with points in between, so that it bends where the picture bends it."""
    parts = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None, None]
    between = line[:-1] + parts * (line[1:] - line[:-1])
    return np.concatenate([between.transpose(1, 0, 2).reshape(-1, 3), line[-1:]])


def _encoded(picture: Image.Image, form: str) -> bytes:
    buffer = io.BytesIO()
    # Dots of a pixel keep their color.
    picture.save(buffer, format=form, quality=90, subsampling=0)
    return buffer.getvalue()
