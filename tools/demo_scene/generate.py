"""Writes the shipped files: `python -m tools.demo_scene.generate --out DIR`."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from regionpose.cameras import PinholeCamera
from regionpose.datasets.demo import (
    CAMERA_FILE,
    CLOUD_FILE,
    CLOUD_POINT,
    IMAGE_FILE,
    LABELS_FILE,
    POINT_LABELS_FILE,
    REGIONS_FILE,
    TRUTH_FILE,
    DemoRegion,
)
from scipy.spatial.transform import Rotation

from tools.demo_scene.courtyard import REGIONS, courtyard_from_camera, courtyard_from_lidar, surfaces
from tools.demo_scene.rendering import Camera, Indices, albedo, developed, pixel_grid, region_labels, rendered
from tools.demo_scene.surfaces import Array, Surface, first_hits

WIDTH, HEIGHT = 1280, 960
FOCAL = (905.0, 903.5)
CENTER = (641.7, 478.4)
DISTORTION = (-0.115, 0.062, 0.0006, -0.0004, -0.011)
"""k1, k2, p1, p2, k3 of OpenCV's radial-tangential model."""

IMAGE_NOISE = 1.3
"""Standard deviation of the sensor's noise, in levels of 0 to 255."""

JPEG_QUALITY = 95
"""Keeps the picture below 1 MB with its edges clean; no chroma subsampling, which would move colored edges."""

LIDAR_RINGS = 128
LIDAR_ELEVATIONS_DEG = (-29.0, 21.0)
LIDAR_AZIMUTHS_DEG = (-35.0, 90.0)
"""The sector that holds the courtyard; the rest of the turn would only add ground."""

LIDAR_STEP_DEG = 0.15
LIDAR_RANGE = 20.0
"""Longest range that is kept, meters."""

RANGE_NOISE = 0.01
"""Standard deviation of a range, meters."""

LIDAR_BLOCK = 1 << 14
"""Rays traced together: a block's arrays stay in the processor's cache."""

IMAGE_SEED, CLOUD_SEED = 20190731, 20190732


@dataclass(frozen=True)
class Scan:
    """A lidar's scan: points (n, 3) in its own frame, intensities (n,) 0 to 255, and the surface met by each."""

    points: NDArray[np.float32]
    intensities: NDArray[np.uint8]
    surfaces: Indices


def demo_camera() -> PinholeCamera:
    """The camera of the shipped image."""
    return PinholeCamera(*FOCAL, *CENTER, width=WIDTH, height=HEIGHT, distortion=DISTORTION)


def camera_from_lidar() -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,), meters: `x_camera = rotation @ x_lidar + translation`."""
    (camera, camera_center), (lidar, lidar_center) = courtyard_from_camera(), courtyard_from_lidar()
    return camera.T @ lidar, camera.T @ (lidar_center - camera_center)


def in_lidar_frame(points: Array) -> Array:
    """Lidar-frame points (n, 3) of courtyard points (n, 3)."""
    rotation, translation = courtyard_from_lidar()
    return np.asarray((points - translation) @ rotation)


def beams() -> Array:
    """Unit directions (n, 3) of one sweep in the lidar's frame, ring after ring."""
    elevations = np.radians(np.linspace(*LIDAR_ELEVATIONS_DEG, LIDAR_RINGS))
    azimuths = np.radians(np.arange(*LIDAR_AZIMUTHS_DEG, LIDAR_STEP_DEG))
    elevation, azimuth = (grid.ravel() for grid in np.meshgrid(elevations, azimuths, indexing="ij"))
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=1)


def scanned(scene: Sequence[Surface], seed: int = CLOUD_SEED) -> Scan:
    """What the lidar measures: the first surface on each beam, with noise along the beam."""
    rotation, center = courtyard_from_lidar()
    sweep = beams()
    pieces = np.array_split(sweep @ rotation.T, -(-len(sweep) // LIDAR_BLOCK))
    index, ranges = (np.concatenate(part) for part in zip(*(first_hits(scene, center, p) for p in pieces), strict=True))
    kept = np.flatnonzero(ranges < LIDAR_RANGE)
    index, ranges, sweep = index[kept], ranges[kept], sweep[kept]
    outward = sweep @ rotation.T
    normals = np.array([surface.frame.normal for surface in scene])[index]
    facing = np.abs(np.sum(normals * outward, axis=1))
    red = albedo(scene, index, center + ranges[:, None] * outward)[:, 0]
    measured = ranges + np.random.default_rng(seed).normal(0.0, RANGE_NOISE, len(ranges))
    intensities = np.clip(240.0 * np.sqrt(red * facing), 0.0, 255.0)
    return Scan((measured[:, None] * sweep).astype(np.float32), intensities.astype(np.uint8), index)


def photographed(scene: Sequence[Surface], camera: Camera, seed: int = IMAGE_SEED) -> NDArray[np.uint8]:
    """The image (h, w, 3), noise included."""
    levels = developed(rendered(scene, camera, pixel_grid(WIDTH, HEIGHT)))
    noisy = levels + np.random.default_rng(seed).normal(0.0, IMAGE_NOISE, levels.shape)
    return np.clip(np.round(noisy), 0.0, 255.0).astype(np.uint8).reshape(HEIGHT, WIDTH, 3)


def demo_regions(scene: Sequence[Surface], camera: Camera, scan: Scan) -> tuple[DemoRegion, ...]:
    """The named regions, in the lidar's frame, each with a seed in the image and one in the cloud."""
    rotation, translation = camera_from_lidar()
    regions = []
    for label, design in enumerate(REGIONS, start=1):
        number = next(k for k, surface in enumerate(scene) if surface.region == design.name)
        frame = scene[number].frame
        rings = tuple(in_lidar_frame(frame.points(ring)) for ring in scene[number].rings)
        seed = in_lidar_frame(frame.points(np.array([design.seed])))
        indices = np.flatnonzero(scan.surfaces == number)
        nearest = indices[np.argmin(np.linalg.norm(scan.points[indices] - seed, axis=1))]
        x, y = np.round(camera.project(seed @ rotation.T + translation)[0]).astype(int)
        point = scan.points[nearest].astype(np.float64)
        regions.append(DemoRegion(design.name, label, rings, (int(x), int(y)), point, indices))
    return tuple(regions)


def camera_info() -> str:
    """The camera as a ROS camera_info file."""
    (fx, fy), (cx, cy) = FOCAL, CENTER
    matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
    projection = [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    fields = (
        ("camera_matrix", 3, 3, matrix),
        ("distortion_coefficients", 1, len(DISTORTION), list(DISTORTION)),
        ("rectification_matrix", 3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        ("projection_matrix", 3, 4, projection),
    )
    head = f"image_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_name: courtyard\ndistortion_model: plumb_bob\n"
    return head + "".join(f"{name}:\n  rows: {r}\n  cols: {c}\n  data: {data}\n" for name, r, c, data in fields)


def truth() -> dict[str, object]:
    """The pose between both sensors, as it is written."""
    rotation, translation = camera_from_lidar()
    return {
        "pose": "camera_from_lidar",
        "meaning": "x_camera = rotation @ x_lidar + translation",
        "camera_frame": "x right, y down, z along the optical axis",
        "lidar_frame": "z along the spin axis, upwards; azimuth from x towards y",
        "translation_unit": "meter",
        "rotation": rotation.tolist(),
        "quaternion_xyzw": Rotation.from_matrix(rotation).as_quat().tolist(),
        "translation": translation.tolist(),
    }


def written_regions(regions: Sequence[DemoRegion]) -> dict[str, object]:
    """The regions, as they are written."""
    held = [
        {
            "name": region.name,
            "label": region.label,
            "seed_pixel": list(region.seed_pixel),
            "seed_point": region.seed_point.tolist(),
            "rings": [ring.tolist() for ring in region.rings],
        }
        for region in regions
    ]
    return {"frame": "lidar", "unit": "meter", "pixel": "x right, y down, a whole number is a center", "regions": held}


def write_cloud(path: Path, scan: Scan) -> None:
    """Write a binary PLY with x, y, z (float32, meters) and intensity (uint8)."""
    records = np.empty(len(scan.points), dtype=CLOUD_POINT)
    records["x"], records["y"], records["z"] = scan.points.T
    records["intensity"] = scan.intensities
    header = ["ply", "format binary_little_endian 1.0", "comment lidar frame, meters", f"element vertex {len(records)}"]
    header += [f"property float {axis}" for axis in "xyz"] + ["property uchar intensity", "end_header", ""]
    path.write_bytes("\n".join(header).encode("ascii") + records.tobytes())


def write_files(folder: Path) -> None:
    """Write every shipped file to `folder`, which is made when it isn't there."""
    folder.mkdir(parents=True, exist_ok=True)
    scene, camera = surfaces(), demo_camera()
    scan = scanned(scene)
    regions = demo_regions(scene, camera, scan)
    labels = region_labels(scene, camera, pixel_grid(WIDTH, HEIGHT)).reshape(HEIGHT, WIDTH)
    point_labels = np.zeros(len(scan.points), dtype=np.uint8)
    for region in regions:
        point_labels[region.point_indices] = region.label
    (folder / CAMERA_FILE).write_text(camera_info(), encoding="utf-8")
    (folder / TRUTH_FILE).write_text(json.dumps(truth(), indent=2) + "\n", encoding="utf-8")
    (folder / REGIONS_FILE).write_text(json.dumps(written_regions(regions), indent=1) + "\n", encoding="utf-8")
    write_cloud(folder / CLOUD_FILE, scan)
    np.savez_compressed(folder / POINT_LABELS_FILE, labels=point_labels)
    Image.fromarray(labels).save(folder / LABELS_FILE, optimize=True)
    picture = Image.fromarray(photographed(scene, camera))
    picture.save(folder / IMAGE_FILE, quality=JPEG_QUALITY, subsampling=0, optimize=True)


def main() -> None:
    """Read the command line and write the files."""
    parser = argparse.ArgumentParser(description="Write the demo scene's files (takes a few minutes).")
    parser.add_argument("--out", type=Path, required=True, help="folder to write to")
    write_files(parser.parse_args().out)


if __name__ == "__main__":
    main()
