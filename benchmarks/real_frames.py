"""Real photos and clouds with their true poses, and what a study makes of them.

`load_frames` lists the frames below a folder of data and reads photos and clouds when they are first asked for. Of
these,

    thinned      has every second or fourth ring of the scanner only
    degraded     has a blurred, darkened or cropped photo
    mismatched   has the photo of one frame and the cloud of another: no pose is right
    mirrored     has its photo flipped left to right: no pose is right
    random_rigs  are so many frames of one pose
    perturbed    is a start about the true pose, and `axis_errors` is how far a pose is off along each axis

Run as a program this lists the frames: points, rings, distance from the scanner to the camera, how far the camera is
from upright, how far the true pose is to be trusted; and draws the cloud over each photo at the true pose, so that one
sees whether it is true. Where there are no frames this says so and ends.

    python -m benchmarks.real_frames [--data ../shared/data] [--only natural waymo] [--pictures FOLDER]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import chain, combinations
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from PIL import Image
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.io.calibrations.poses import read_pose
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from benchmarks.real_scenes import DEFAULT_DATA, Plain, camera_of, scan_of

Array = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Rings = NDArray[np.int64]

KINDS = ("kitti", "natural", "acfr_fisheye", "nuscenes", "hesai", "sustech", "waymo")
"""Folders of frames. The other scenes of the data have no scanner's cloud: places on a board, or a rendered depth."""

MOST_KEPT = 8
"""Photos, and clouds, that are kept in memory: about 10 MB each."""

PROTOCOLS: Mapping[str, tuple[float, float]] = {"10 deg, 0.25 m": (10.0, 0.25), "20 deg, 1.5 m": (20.0, 1.5)}
"""Starts of which papers report errors: uniform within so many degrees and meters about and along each axis."""


@dataclass(frozen=True, eq=False)
class Scan:
    """Points (n, 3) of a cloud in its own frame, meters, with intensity (n,) and ring number (n,) where there are such.

    Read-only. Rings count from 0, in any order.
    """

    points: Array
    intensity: Array | None = None
    rings: Rings | None = None

    def __post_init__(self) -> None:
        """Check lengths, and make what frames share read-only."""
        for values in (self.points, self.intensity, self.rings):
            if values is not None:
                if len(values) != len(self.points):
                    raise ValueError(f"scan: found {len(values)} values; needed one of each of {len(self.points)}")
                values.setflags(write=False)


@lru_cache(maxsize=MOST_KEPT)
def _image(load: Callable[[], Bytes]) -> Bytes:
    """What a photo's function returns, of the last ones without calling it again."""
    image = load()
    image.setflags(write=False)
    return image


@lru_cache(maxsize=MOST_KEPT)
def _scan(load: Callable[[], Scan]) -> Scan:
    """What a scan's function returns, of the last ones without calling it again."""
    return load()


@dataclass(frozen=True, eq=False, kw_only=True)
class Capture:
    """A photo, a cloud, and what a user would know of the pose.

    Parameters
    ----------
    name : str
        Unlike all others'.
    camera : Camera
        That took the photo, with its size.
    photo : function
        Reads the image, (h, w, 3) of uint8.
    scan : function
        Reads the cloud; one function for all that share a cloud.
    scanner : (3,) array
        Place of the scanner in the cloud's frame, meters.
    up : (3,) array
        Unit vector that is up in the cloud's frame.
    near_m : float
        Standard deviation of the camera's center about the scanner, along each axis, that a user would state.
    note : str
        What is odd about it.
    """

    name: str
    camera: Camera
    photo: Callable[[], Bytes]
    scan: Callable[[], Scan]
    scanner: Array
    up: Array
    near_m: float
    note: str = ""

    @property
    def image(self) -> Bytes:
        """The photo (h, w, 3), read-only."""
        return _image(self.photo)

    @property
    def points(self) -> Array:
        """The cloud's points (n, 3) in its own frame, meters, read-only."""
        return _scan(self.scan).points

    @property
    def intensity(self) -> Array | None:
        """Of the points (n,), in the file's own scale, read-only; None where there is none."""
        return _scan(self.scan).intensity

    @property
    def rings(self) -> Rings | None:
        """Number of each point's ring (n,), read-only; None where it is unknown."""
        return _scan(self.scan).rings


@dataclass(frozen=True, eq=False, kw_only=True)
class RealFrame(Capture):
    """Photo and cloud of a known pose.

    Parameters
    ----------
    rig : str
        Frames of one rig have one pose.
    scene : str
        Frames of one scene show the same surroundings from about the same place.
    truth : Pose
        `camera_from_world`, the world being the cloud's frame.
    truth_deg, truth_m : float
        How far the true pose is to be trusted: of its rotation and of the camera's center.
    """

    rig: str
    scene: str
    truth: rp.Pose
    truth_deg: float
    truth_m: float

    @property
    def tilt_deg(self) -> float:
        """Angle between the image's upward axis and up, degrees, at the true pose."""
        return float(np.degrees(np.arccos(np.clip(-self.truth.rotation_matrix[1] @ self.up, -1.0, 1.0))))

    @property
    def from_scanner_m(self) -> float:
        """Distance of the camera's center from the scanner, meters."""
        return float(np.linalg.norm(self.truth.camera_center - self.scanner))


@dataclass(frozen=True, eq=False, kw_only=True)
class Mismatch(Capture):
    """Photo and cloud that no pose fits: the names of the frames that they are of, and whether the photo is flipped.

    The camera is the photo's; scanner, up and near_m are the cloud's.
    """

    photo_of: str
    cloud_of: str
    is_mirrored: bool = False


CaptureT = TypeVar("CaptureT", bound=Capture)


class Trust(NamedTuple):
    """How far a true pose is to be trusted, and what is odd about the frame."""

    deg: float
    meters: float
    note: str = ""


def meters_of(deg: float) -> float:
    """Meters at 10 m that such a turn is: of true poses whose source gives an angle alone."""
    return round(10.0 * float(np.radians(deg)), 2)


TURNING = "the car turns: depth edges lie 0.6 to 3.4 px left of the photo's"
SIDE = "the cloud's edges speak against the given pose; a labeling tool's example"
SHUTTER = "rolling shutter: a turn of 1 deg about x scores higher than the given pose in 00000 and 00104"
BOARDS = "the camera looks down by 8 deg; the scanner stands still over all frames, so their background is one"

TRUSTS: Mapping[str, Trust] = {
    "kitti": Trust(0.45, 0.08, "calibration of 2011_09_26; an alignment of two outlines of sfnd32 differs so far"),
    "natural": Trust(0.15, 0.05, "depth edges within 2.5 px, 0.7 px in the mean"),
    "natural/kitti_000741": Trust(0.3, 0.08, TURNING),
    "natural/kitti_002688": Trust(0.4, 0.08, "depth edges of a post at 12 m lie 3 to 6 px right of the photo's"),
    "acfr_fisheye": Trust(0.5, 0.03, BOARDS),
    "nuscenes": Trust(0.5, meters_of(0.5), "by our overlays: the data state nothing"),
    "hesai/ours1": Trust(0.6, 0.1, "soft photo from a moving car"),
    "hesai/ours3": Trust(0.4, 0.1),
    "sustech/front": Trust(0.4, meters_of(0.4)),
    "sustech/right": Trust(2.0, 0.35, f"a post at 3 m lies 120 px from its points; {SIDE}"),
    "sustech": Trust(2.0, meters_of(2.0), SIDE),
    "waymo": Trust(1.0, meters_of(1.0), SHUTTER),
}
"""By the longest part of a frame's name that is here, from the statements that come with the data."""

WAYMO_SCANNER = (1.43, 0.0, 2.18)
"""Place of the scanner in the vehicle's frame, meters."""


def trust_of(name: str) -> Trust:
    """The trust of a frame."""
    return TRUSTS[max((key for key in TRUSTS if name.startswith(key)), key=len)]


# Rings

LEAST_BEAMS, MOST_BEAMS = 4, 256
"""Rings fewer or more than these are none: the points have another order."""

START_STEP_DEG, START_MARGIN_DEG = 0.1, 0.5
"""Step of the search for the azimuth at which rings begin, and how far points may be out of order there; those of a
ring are 0.2 deg apart.
"""

BEAM_GAP_DEG = 0.1
"""Gap in elevation that separates beams whose points have one elevation: a third of the least of Pandar40's."""


def azimuth_elevation(points: Array, scanner: Array, up: Array) -> tuple[Array, Array]:
    """Azimuths and elevations of points about the scanner, radians; azimuths from any one direction."""
    east = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    east = east / np.linalg.norm(east)
    x, y, z = np.array([east, np.cross(up, east), up]) @ (points - scanner).T
    return np.arctan2(y, x), np.arctan2(z, np.hypot(x, y))


def rings_by_order(points: Array, scanner: Array, up: Array) -> Rings | None:
    """Ring numbers (n,) of points that are written ring by ring, each around one turn; None where they are not.

    The first ring begins before the file's first point, the last one ends after its last point. Between the two the
    start is where the elevation changes most from one point to the next, as it does from one ring to the next.
    """
    azimuth, elevation = azimuth_elevation(points, scanner, up)
    azimuth = azimuth * np.sign(np.median(wrapped(np.diff(azimuth))))

    def passes(start: float) -> Rings:
        """Of each pair of neighbors, whether the start is passed: forward 1, backward -1, else 0."""
        step = np.diff(np.mod(azimuth - start, 2.0 * np.pi))
        return np.asarray((step < -np.pi).astype(np.int64) - (step > np.pi))

    def change(start: float) -> float:
        """By how much the elevation changes where the start is passed."""
        passed = np.flatnonzero(passes(start) > 0)
        return abs(float(np.median(elevation[passed + 1] - elevation[passed]))) if len(passed) else 0.0

    gap, margin = float(wrapped(azimuth[0] - azimuth[-1])), np.radians(START_MARGIN_DEG)
    starts = azimuth[-1] + np.arange(min(gap, 0.0) - margin, max(gap, 0.0) + margin, np.radians(START_STEP_DEG))
    numbers = np.concatenate([[0], np.cumsum(passes(max(starts.tolist(), key=change)))])
    return _checked(numbers - numbers.min(), elevation)


def wrapped(angles: Array) -> Array:
    """Angles between -pi and pi, radians."""
    return np.asarray(np.mod(angles + np.pi, 2.0 * np.pi) - np.pi)


def rings_by_elevation(points: Array, scanner: Array, up: Array) -> Rings | None:
    """Ring numbers (n,), from the lowest, of points whose elevations are exactly those of the beams; None otherwise."""
    _, elevation = azimuth_elevation(points, scanner, up)
    order = np.argsort(elevation)
    numbers = np.empty(len(points), dtype=np.int64)
    numbers[order] = np.cumsum(np.diff(elevation[order], prepend=elevation[order[0]]) > np.radians(BEAM_GAP_DEG))
    return _checked(numbers, elevation)


def _checked(numbers: Rings, elevation: Array) -> Rings | None:
    """The numbers, unless there are too few rings, too many, or their elevations neither rise nor fall throughout."""
    middles = ring_elevations(numbers, elevation)
    steps = np.diff(list(middles.values()))
    ordered = bool(np.all(steps > 0.0) or np.all(steps < 0.0))
    return numbers if ordered and LEAST_BEAMS <= len(middles) <= MOST_BEAMS else None


def ring_elevations(numbers: Rings, elevation: Array) -> dict[int, float]:
    """The median elevation of each ring, by number."""
    order = np.argsort(numbers, kind="stable")
    names, starts = np.unique(numbers[order], return_index=True)
    parts = np.split(elevation[order], starts[1:])
    return {int(name): float(np.median(part)) for name, part in zip(names, parts, strict=True)}


# Reading


def read_image(path: Path) -> Bytes:
    """A photo (h, w, 3)."""
    with Image.open(path) as image:
        return np.array(image.convert("RGB"))


def read_scan(read: Callable[[], rp.Cloud], rings: str, scanner: Array, up: Array) -> Scan:
    """A cloud, its rings by the column of that name, by the points' order or by their elevation."""
    cloud = read()
    numbers: Rings | None
    if rings == "column":
        numbers = np.asarray(cloud.fields["ring"]).astype(np.int64)
    else:
        by = {"order": rings_by_order, "elevation": rings_by_elevation}[rings]
        numbers = by(cloud.points, scanner, up)
    return Scan(np.array(cloud.points), None if cloud.intensity is None else np.array(cloud.intensity), numbers)


Z_UP = np.array([0.0, 0.0, 1.0])


class Place(NamedTuple):
    """Of one cloud: scanner and up in its frame, and the function that reads it."""

    scanner: Array
    up: Array
    scan: Callable[[], Scan]

    @classmethod
    def of(
        cls, read: Callable[[], rp.Cloud], rings: str, scanner: Sequence[float] = (0, 0, 0), up: Array = Z_UP
    ) -> Place:
        """The place of a cloud that `read` reads."""
        place = np.array(scanner, dtype=np.float64)
        return cls(place, up, partial(read_scan, read, rings, place, up))


def _frame(
    name: str, rig: str, scene: str, camera: Camera, photo: Path, place: Place, truth: rp.Pose, near_m: float = 0.5
) -> RealFrame:
    """A frame, with what is known of its true pose."""
    trust = trust_of(name)
    return RealFrame(
        name=name,
        rig=rig,
        scene=scene,
        camera=camera,
        photo=partial(read_image, photo),
        scan=place.scan,
        truth=truth,
        truth_deg=trust.deg,
        truth_m=trust.meters,
        scanner=place.scanner,
        up=place.up,
        near_m=near_m,
        note=trust.note,
    )


def _of_folder(folder: Path, calibration: Plain, rings: str) -> Place:
    """The place of a scene's cloud, which may have been moved."""
    up = np.array(calibration.get("scanner_up", Z_UP), dtype=np.float64)
    scanner = calibration.get("sensor_origin", (0, 0, 0))
    return Place.of(partial(scan_of, folder), rings, scanner, up / np.linalg.norm(up))


def _scene_frames(kind: str, data: Path) -> Iterator[RealFrame]:
    """Frames of the folders with calib.json, one photo each: KITTI's and the boards'."""
    rigs: dict[str, rp.Pose] = {}
    named = {"natural": "kitti", "kitti": "kitti-object", "acfr_fisheye": "acfr"}[kind]
    for path in sorted((data / kind).glob("*/calib.json")):
        calibration, name = json.loads(path.read_text()), f"{kind}/{path.parent.name}"
        truth = rp.Pose.from_parts(calibration["R"], calibration["t"])
        # A cloud that was moved has a pose of its own.
        same = (rig for rig, pose in rigs.items() if np.abs(pose.matrix - truth.matrix).max() < 1e-6)
        rig = next(same, named if not rigs else f"{named}-{path.parent.name}")
        rigs.setdefault(rig, truth)
        is_hall = kind == "acfr_fisheye"
        place = _of_folder(path.parent, calibration, "column" if is_hall else "order")
        photo, scene = path.parent / "image.png", "acfr hall" if is_hall else name
        yield _frame(name, rig, scene, camera_of(calibration), photo, place, truth)


def _nuscenes_frames(kind: str, data: Path) -> Iterator[RealFrame]:
    """Frames of the folders with several cameras of one sweep."""
    for path in sorted((data / kind).glob("*/calib.json")):
        calibration = json.loads(path.read_text())
        place = _of_folder(path.parent, calibration, "column")
        for camera, held in calibration["cameras"].items():
            short = camera.removeprefix("CAM_").lower().replace("_", "-")
            truth = rp.Pose.from_parts(held["R"], held["t"])
            photo, scene = path.parent / held["image"], f"{kind}/{path.parent.name}"
            yield _frame(f"{kind}/{short}", f"{kind}-{short}", scene, camera_of(held), photo, place, truth, 1.0)


def _hesai_frames(kind: str, data: Path) -> Iterator[RealFrame]:
    """Frames of two rigs with a Pandar64."""
    for folder in sorted(path.parent for path in (data / kind).glob("*/calib.pcd")):
        photo = next(path for path in (folder / "calib.png", folder / "calib.jpg") if path.exists())
        place = Place.of(partial(rp.read_cloud, folder / "calib.pcd"), "column")
        truth, camera = read_pose(folder / "camera_from_lidar.txt"), rp.load_camera(folder / "calib.yaml")
        name = f"{kind}/{folder.name}"
        yield _frame(name, f"{kind}-{folder.name}", name, camera, photo, place, truth)


def _sustech_frames(kind: str, data: Path) -> Iterator[RealFrame]:
    """Frames of three cameras about one Pandar40.

    The header of the cloud names a column of rings, two bytes beside where they are: they follow from elevation.
    """
    for cloud in sorted((data / kind).glob("*.pcd")):
        place = Place.of(partial(rp.read_cloud, cloud), "elevation")
        for photo in sorted(cloud.parent.glob(f"{cloud.stem}_*.jpg")):
            side = photo.stem.removeprefix(f"{cloud.stem}_")
            truth = read_pose(cloud.parent / f"camera_from_lidar_{side}.txt")
            camera = rp.load_camera(cloud.parent / f"calib_{side}.yaml")
            yield _frame(f"{kind}/{side}", f"{kind}-{side}", f"{kind}/{cloud.stem}", camera, photo, place, truth)


def _waymo_frames(kind: str, data: Path) -> Iterator[RealFrame]:
    """Frames of Waymo's top lidar and front camera, points in the vehicle's frame."""
    for cloud in sorted((data / kind).glob("*.pcd")):
        place = Place.of(partial(rp.read_cloud, cloud), "order", WAYMO_SCANNER)
        truth, camera = read_pose(cloud.parent / "camera_from_lidar.txt"), rp.load_camera(cloud.parent / "calib.yaml")
        # One street: in two of the frames the car stands at the same place.
        yield _frame(f"{kind}/{cloud.stem}", kind, kind, camera, cloud.with_suffix(".jpg"), place, truth)


READERS: Mapping[str, Callable[[str, Path], Iterator[RealFrame]]] = {
    "kitti": _scene_frames,
    "natural": _scene_frames,
    "acfr_fisheye": _scene_frames,
    "nuscenes": _nuscenes_frames,
    "hesai": _hesai_frames,
    "sustech": _sustech_frames,
    "waymo": _waymo_frames,
}


def load_frames(data: Path, kinds: Sequence[str] | None = None) -> list[RealFrame]:
    """The frames below a folder, of some kinds or of all; a kind that isn't there is left out with a line that says so.

    Photos and clouds are read when they are first asked for.
    """
    frames: list[RealFrame] = []
    for kind in KINDS if kinds is None else kinds:
        if kind not in READERS:
            raise ValueError(f"kinds: found {kind!r}; needed some of {', '.join(KINDS)}")
        found = list(READERS[kind](kind, data))
        if not found:
            print(f"no frames below {data / kind}: left out")
        frames += found
    return frames


# Clouds and photos made worse


def thinned(capture: CaptureT, every: int) -> CaptureT:
    """The frame with every second, third ... ring alone, by elevation from the highest.

    Of 64 rings every second leaves 32, as of a scanner with so many beams. Points of a cloud whose rings are unknown
    are a ValueError when they are read.
    """
    scan = partial(_thinned, capture.scan, every, capture.scanner, capture.up)
    return replace(capture, name=f"{capture.name}, 1 of {every} rings", scan=scan)


def _thinned(load: Callable[[], Scan], every: int, scanner: Array, up: Array) -> Scan:
    """The points of the rings that are kept."""
    scan = _scan(load)
    if scan.rings is None:
        raise ValueError("cloud: found no rings; needed one whose rings are known")
    middles = ring_elevations(scan.rings, azimuth_elevation(scan.points, scanner, up)[1])
    held = np.isin(scan.rings, sorted(middles, key=lambda ring: -middles[ring])[::every])
    return Scan(scan.points[held], None if scan.intensity is None else scan.intensity[held], scan.rings[held])


def blurred(capture: CaptureT, sigma_px: float) -> CaptureT:
    """The frame with its photo blurred by a Gaussian."""
    return replace(capture, photo=partial(_blurred, capture.photo, sigma_px))


def _blurred(load: Callable[[], Bytes], sigma_px: float) -> Bytes:
    smooth = gaussian_filter(_image(load).astype(np.float32), (sigma_px, sigma_px, 0.0))
    return np.round(smooth).astype(np.uint8)


def darkened(capture: CaptureT, factor: float = 1.0, gamma: float = 1.0, noise: float = 0.0) -> CaptureT:
    """The frame with darker levels: a fraction of full scale `l` becomes `factor l^gamma`, with noise of so many
    levels of 255 (1 sigma; always the same).
    """
    return replace(capture, photo=partial(_darkened, capture.photo, factor, gamma, noise))


def _darkened(load: Callable[[], Bytes], factor: float, gamma: float, noise: float) -> Bytes:
    image = _image(load)
    levels = 255.0 * factor * (np.arange(256) / 255.0) ** gamma
    dark = levels[image] + noise * np.random.default_rng(0).standard_normal(image.shape, dtype=np.float32)
    return np.clip(np.round(dark), 0, 255).astype(np.uint8)


def cropped(capture: CaptureT, left: int, top: int, width: int, height: int) -> CaptureT:
    """The frame with a window of its photo, pixels, and the camera of that window."""
    camera = checked_camera(capture.camera)
    if left < 0 or top < 0 or left + width > (camera.width or 0) or top + height > (camera.height or 0):
        found = f"{width} x {height} pixels at ({left}, {top})"
        raise ValueError(f"window: found {found}; needed one within {camera.width} x {camera.height}")
    window = replace(camera, cx=camera.cx - left, cy=camera.cy - top, width=width, height=height)
    photo = partial(_cropped, capture.photo, (slice(top, top + height), slice(left, left + width)))
    return replace(capture, camera=window, photo=photo)


def _cropped(load: Callable[[], Bytes], window: tuple[slice, slice]) -> Bytes:
    return _image(load)[window].copy()


def _beside_center(capture: CaptureT) -> CaptureT:
    """Three fifths of the width, from its right, and four fifths of the height, from its top."""
    camera = checked_camera(capture.camera)
    width, height = (camera.width or 0) * 3 // 5, (camera.height or 0) * 4 // 5
    return cropped(capture, (camera.width or 0) - width, 0, width, height)


def checked_camera(camera: Camera) -> PinholeCamera | FisheyeCamera:
    """The camera, if its center and size are known as those of a photo that may be cut or flipped."""
    if not isinstance(camera, PinholeCamera | FisheyeCamera) or camera.width is None or camera.height is None:
        raise ValueError(f"camera: found {camera}; needed a pinhole or fisheye camera with a size")
    return camera


DEGRADATIONS: Mapping[str, Callable[[Capture], Capture]] = {
    "blurred 2 px": partial(blurred, sigma_px=2.0),
    "blurred 4 px": partial(blurred, sigma_px=4.0),
    "gamma 2.5": partial(darkened, gamma=2.5),
    "dark": partial(darkened, factor=0.25, noise=4.0),
    "cropped": _beside_center,
}
"""What may be wrong with a photo, by name."""


def degraded(capture: CaptureT, how: str) -> CaptureT:
    """The frame with its photo made worse in one of the ways of `DEGRADATIONS`."""
    if how not in DEGRADATIONS:
        raise ValueError(f"how: found {how!r}; needed one of {', '.join(DEGRADATIONS)}")
    worse = DEGRADATIONS[how](capture)
    return replace(capture, name=f"{capture.name}, {how}", camera=worse.camera, photo=worse.photo)


# Photo and cloud that no pose fits


def mirrored(frame: RealFrame) -> Mismatch:
    """The frame with its photo flipped left to right, and the camera that would see so: no pose is right.

    A street that is the same on both sides comes near to having one.
    """
    return _mismatch(frame, frame, is_mirrored=True)


def mismatched(frames: Sequence[RealFrame], count: int, seed: int = 0) -> list[Mismatch]:
    """Up to `count` different pairs of one frame's photo and another scene's cloud, at random.

    Pairs of one rig come first: same camera, same scanner, another place. Then pairs across rigs, and where these are
    too few, flipped photos with the clouds of other scenes.
    """
    rng = np.random.default_rng(seed)
    # Cameras of one scanner share a cloud, which counts once.
    clouds = list({id(frame.scan): frame for frame in frames}.values())
    pairs = [(photo, cloud) for photo in frames for cloud in clouds if photo.scene != cloud.scene]
    within = _shuffled([pair for pair in pairs if pair[0].rig == pair[1].rig], rng)
    across = _shuffled([pair for pair in pairs if pair[0].rig != pair[1].rig], rng)
    plain = [_mismatch(*pair) for pair in (within + across)[:count]]
    flipped = _shuffled(pairs, rng)[: count - len(plain)]
    return plain + [_mismatch(*pair, is_mirrored=True) for pair in flipped]


def _shuffled(
    pairs: Sequence[tuple[RealFrame, RealFrame]], rng: np.random.Generator
) -> list[tuple[RealFrame, RealFrame]]:
    return [pairs[index] for index in rng.permutation(len(pairs))]


def _mismatch(photo: RealFrame, cloud: RealFrame, *, is_mirrored: bool = False) -> Mismatch:
    """The photo of one frame with the cloud of another, or of the same one where it is flipped."""
    return Mismatch(
        name=f"{'flipped ' if is_mirrored else ''}photo of {photo.name}, cloud of {cloud.name}",
        camera=mirrored_camera(photo.camera) if is_mirrored else photo.camera,
        photo=partial(_mirrored, photo.photo) if is_mirrored else photo.photo,
        scan=cloud.scan,
        scanner=cloud.scanner,
        up=cloud.up,
        near_m=cloud.near_m,
        photo_of=photo.name,
        cloud_of=cloud.name,
        is_mirrored=is_mirrored,
    )


def _mirrored(load: Callable[[], Bytes]) -> Bytes:
    return _image(load)[:, ::-1].copy()


SIDEWAYS = (3, 8, 9, 13)
"""Places of OpenCV's coefficients that move pixels to one side: p2, s1, s2 and tau_y. A flip turns their sign."""


def mirrored_camera(camera: Camera) -> Camera:
    """The camera of photos flipped left to right: it sees (-x, y, z) where the other sees (x, y, z)."""
    known = checked_camera(camera)
    center = (known.width or 0) - 1.0 - known.cx
    if isinstance(known, FisheyeCamera):
        return replace(known, cx=center)
    signed = tuple(-value if place in SIDEWAYS else value for place, value in enumerate(known.distortion))
    return replace(known, cx=center, distortion=signed)


# Starts, errors and rigs


class AxisErrors(NamedTuple):
    """Of a pose: rotation about the true camera's axes, degrees, and its center along them, meters.

    Axes: x right, y down, z forward. Pitch is about x, yaw about y, roll about z: the rotation from the true camera's
    axes to the found one's is yaw, then pitch, then roll about axes that turn along.
    """

    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    x_m: float
    y_m: float
    z_m: float


def axis_errors(pose: rp.Pose, truth: rp.Pose) -> AxisErrors:
    """How far a pose is off, by axis."""
    yaw, pitch, roll = (pose.rotation * truth.rotation.inv()).inv().as_euler("YXZ", degrees=True)
    offset = truth.rotation.apply(pose.camera_center - truth.camera_center)
    return AxisErrors(float(roll), float(pitch), float(yaw), *map(float, offset))


def perturbed(truth: rp.Pose, rng: np.random.Generator, deg: float, meters: float) -> rp.Pose:
    """A pose whose errors by axis are uniform within `deg` degrees and `meters` meters, as of `PROTOCOLS`."""
    roll, pitch, yaw = rng.uniform(-deg, deg, 3)
    rotation = Rotation.from_euler("YXZ", [yaw, pitch, roll], degrees=True).inv() * truth.rotation
    center = truth.camera_center + truth.rotation.inv().apply(rng.uniform(-meters, meters, 3))
    return rp.Pose(rotation, -rotation.apply(center))


def random_rigs(frames: Sequence[RealFrame], size: int, count: int, seed: int = 0) -> list[tuple[RealFrame, ...]]:
    """Up to `count` different choices of `size` frames of one rig, at random."""
    rigs = dict.fromkeys(frame.rig for frame in frames)
    choices = list(
        chain.from_iterable(combinations([frame for frame in frames if frame.rig == rig], size) for rig in rigs)
    )
    order = np.random.default_rng(seed).permutation(len(choices))[:count]
    return [choices[index] for index in order]


# The list


def line(frame: RealFrame) -> str:
    """A frame's line of the list."""
    rings = "-" if frame.rings is None else str(len(np.unique(frame.rings)))
    size = f"{frame.camera.width} x {frame.camera.height}"
    frame.camera.check_size(frame.image.shape)
    return (
        f"{frame.name:22} {frame.rig:22} {size:11} {len(frame.points):7} {rings:>5}  {frame.from_scanner_m:7.2f}"
        f" {frame.tilt_deg:6.1f}  {frame.truth_deg:5.2f} {frame.truth_m:5.2f}  {frame.note}"
    )


def write_picture(frame: RealFrame, folder: Path) -> None:
    """Draw the cloud's depth over the photo at the true pose."""
    folder.mkdir(parents=True, exist_ok=True)
    picture = rp.overlay_depth(frame.camera, frame.image, frame.points, frame.truth)
    Image.fromarray(picture).save(folder / f"{frame.name.replace('/', '-')}.png")


def main() -> None:
    """Print the list, and draw the pictures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA, help="folder of frames")
    parser.add_argument("--only", nargs="+", choices=KINDS, help="kinds of frames, all when left out")
    parser.add_argument("--pictures", type=Path, help="folder for pictures of the cloud over the photo")
    given = parser.parse_args()
    frames = load_frames(given.data, given.only)
    if not frames:
        return
    print("frame                  rig                    image        points rings  scanner   tilt    trusted to")
    print("                                                                             (m)  (deg)  (deg)   (m)")
    for frame in frames:
        print(line(frame), flush=True)
        if given.pictures is not None:
            write_picture(frame, given.pictures)


if __name__ == "__main__":
    main()
