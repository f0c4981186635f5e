"""The kind of a calibration file, recognized by its content, and the reader of that kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from regionpose.cameras import Camera
from regionpose.cameras.models import model_name
from regionpose.io.calibrations import (
    colmap,
    dvlc,
    kalibr,
    kitti,
    metashape,
    mrcal,
    named,
    nerfstudio,
    nuscenes,
    ocamcalib,
    open3d,
    opencalib,
    opencv,
    pix4d,
    ros,
)
from regionpose.io.calibrations.models import checked_model
from regionpose.io.calibrations.text import CalibrationError, CalibrationText
from regionpose.io.calibrations.xml_items import STORAGE, Element, is_xml, storage, xml_root
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping, parsed, refuse_broken_json

Held = TypeVar("Held")


@dataclass(frozen=True)
class Kind(Generic[Held]):
    """A kind of file: its name, the test that recognizes it, and the reader of its cameras."""

    label: str
    describes: Callable[[Held], bool]
    read_camera: Callable[[Held, str | None], Camera]
    rectifies: bool = False
    """Whether it may hold the camera of rectified photos."""


OPENCV = "OpenCV YAML"

TEXT_KINDS: tuple[Kind[CalibrationText], ...] = (
    Kind("OCamCalib results", ocamcalib.describes, ocamcalib.read_camera),
    Kind("KITTI calibration", kitti.describes, kitti.read_camera, rectifies=True),
    Kind("COLMAP cameras.txt", colmap.describes, colmap.read_camera),
    Kind("Pix4D calibrated_camera_parameters.txt", pix4d.describes, pix4d.read_camera),
    Kind("mrcal cameramodel", mrcal.describes, mrcal.read_camera),
    Kind("OpenCalib calib.txt", opencalib.describes_text, opencalib.read_text),
)
XML_KINDS: tuple[Kind[Element], ...] = (Kind("Metashape XML", metashape.describes, metashape.read_camera),)
ROOT_KINDS: tuple[Kind[YamlItem], ...] = (
    Kind("nuScenes calibrated_sensor.json", nuscenes.describes, nuscenes.read_camera),
)
YAML_KINDS: tuple[Kind[YamlMapping], ...] = (
    Kind("direct_visual_lidar_calibration calib.json", dvlc.describes, dvlc.read_camera),
    Kind("Kalibr camchain", kalibr.describes, kalibr.read_camera),
    Kind("ROS camera_info", ros.describes, ros.read_camera, rectifies=True),
    Kind("VINS YAML", named.describes_vins, named.read_vins),
    Kind("nerfstudio transforms.json", nerfstudio.describes, nerfstudio.read_camera),
    Kind("Open3D JSON", open3d.describes, open3d.read_camera),
    Kind("OpenCalib intrinsic.json", opencalib.describes_json, opencalib.read_json),
    Kind(OPENCV, opencv.describes, opencv.read_camera),
    Kind("FAST-Calib, FAST-LIVO2 or ORB-SLAM YAML (fx, fy, cx, cy)", named.describes, named.read_camera),
)
XML_STORAGE = Kind[YamlMapping]("OpenCV XML", opencv.describes, opencv.read_camera)

ALL_KINDS: tuple[Kind[Any], ...] = (*YAML_KINDS, XML_STORAGE, *TEXT_KINDS, *XML_KINDS, *ROOT_KINDS)
NEEDED = "one of these: " + ", ".join(sorted((kind.label for kind in ALL_KINDS), key=str.lower))


def load_camera(
    path: str | Path, name: str | None = None, *, model: str | None = None, rectified: bool = False
) -> Camera:
    """The camera that a calibration file describes, in OpenCV's pixels (an integer is a pixel's center).

    The content decides the kind; the camera model is the one that the file names. docs/reference/calibrations.md lists
    the kinds, and what is converted of each.

    Parameters
    ----------
    path : str or Path
        Of the file, or of a camera_info message in a bag, as `bag.mcap#/camera/camera_info@12.5`.
    name : str, optional
        Selects among several cameras: the key of the matrix (`M1`, `K2`) in OpenCV's files, `cam0` in a camchain, the
        id in cameras.txt, `P2`, `P_rect_02` or `K_02` in KITTI's files, the photo in Pix4D's and nerfstudio's, the
        token in nuScenes', `Camera1` in ORB-SLAM's. Messages list the names.
    model : {"pinhole", "fisheye", "unified", "fov", "ocam", "equirectangular"}, optional
        For files that need not name one: four coefficients may be a pinhole's or a fisheye's.
    rectified : bool
        Whether the photos were rectified (ROS: image_rect): their camera has the projection matrix P of the
        camera_info and no distortion. For ROS and KITTI alone; KITTI's P are such cameras anyway.

    Raises
    ------
    FileNotFoundError
        Where the file is missing.
    CalibrationError
        A ValueError, where it is of no known kind, is cut or holds wrong counts; where `name` is not in it, or is
        needed to choose: the message lists the names; where its model is unknown, missing or not `model`; where it
        holds no camera of rectified photos and `rectified` is set.
    """
    needed = checked_model(model)
    source = CalibrationText.read(path, needed, rectified=rectified)
    camera = _read(source, name)
    if needed is not None and model_name(camera) != needed:
        raise source.error("camera model", model_name(camera), f"{needed}, or another model=")
    return camera


def calibration_kind(path: str | Path) -> str:
    """What wrote a calibration file, as `ROS camera_info`; CalibrationError where that is not known."""
    kind, _ = _kind_and_reader(CalibrationText.read(path))
    return kind


def _read(source: CalibrationText, name: str | None) -> Camera:
    _, read = _kind_and_reader(source)
    return read(name)


def _kind_and_reader(source: CalibrationText) -> tuple[str, Callable[[str | None], Camera]]:
    """The label of a file's kind, and what reads the camera of a name."""
    if is_xml(source):
        return _xml_kind(source)
    kind = _first(TEXT_KINDS, source)
    return kind if kind is not None else _yaml_kind(source)


def _first(
    kinds: tuple[Kind[Held], ...], content: Held, source: CalibrationText | None = None
) -> tuple[str, Callable[[str | None], Camera]] | None:
    """The first kind that describes what is held."""
    kind = next((kind for kind in kinds if kind.describes(content)), None)
    if kind is None:
        return None
    found = kind

    def read(name: str | None) -> Camera:
        text = content if isinstance(content, CalibrationText) else source
        if text is not None and text.rectified and not found.rectifies:
            raise text.error("rectified", f"a file of the kind {found.label}", "a ROS camera_info with P, or KITTI's P")
        return found.read_camera(content, name)

    return found.label, read


def _xml_kind(source: CalibrationText) -> tuple[str, Callable[[str | None], Camera]]:
    root = xml_root(source)
    kind = (
        _first((XML_STORAGE,), storage(root), source)
        if root.tag == STORAGE and root.children
        else _first(XML_KINDS, root, source)
    )
    if kind is None:
        raise CalibrationError(f"{source.path}: found XML with the root {root.tag}; needed {NEEDED}")
    return kind


def _yaml_kind(source: CalibrationText) -> tuple[str, Callable[[str | None], Camera]]:
    """The kind of a file that is written as YAML or JSON."""
    root = parsed(source)
    document = root.mapping() if root is not None and root.is_mapping else None
    kind = None if root is None else _first(ROOT_KINDS, root, source)
    if kind is None and document is not None:
        kind = _first(YAML_KINDS, document, source)
    if kind is not None:
        return kind
    refuse_broken_json(source)
    found = f"text that starts with {source.text.strip()[:40]!r}" if document is None else document.contents
    raise CalibrationError(f"{source.path}: found {found}; needed {NEEDED}")
