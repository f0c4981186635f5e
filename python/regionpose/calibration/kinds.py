"""Which tool wrote a calibration file, told from its content."""

from __future__ import annotations

from pathlib import Path

from regionpose.calibration import colmap, kalibr, kitti, ocamcalib, opencv, ros
from regionpose.calibration.models import checked_model, model_of
from regionpose.calibration.text import CalibrationError, CalibrationText
from regionpose.calibration.yaml_items import YamlMapping, refuse_broken_json
from regionpose.cameras import Camera

NEEDED = "OpenCV YAML, ROS camera_info, a Kalibr camchain, COLMAP cameras.txt, OCamCalib results or a KITTI calibration"

TEXT_KINDS = (
    (ocamcalib.describes, ocamcalib.read_camera),
    (kitti.describes, kitti.read_camera),
    (colmap.describes, colmap.read_camera),
)
YAML_KINDS = (
    (kalibr.describes, kalibr.read_camera),
    (ros.describes, ros.read_camera),
    (opencv.describes, opencv.read_camera),
)


def load_camera(path: str | Path, name: str | None = None, *, model: str | None = None) -> Camera:
    """The camera that a calibration file describes, in OpenCV's pixels (an integer is a pixel's center).

    The content decides the kind; the camera model is the one that the file names.

    Parameters
    ----------
    path : str or Path
        Of the file.
    name : str, optional
        Selects among several cameras:

        - OpenCV YAML, or JSON with its keys: the key of the matrix (`camera_matrix`, `M1`, `K`, ...).
        - ROS camera_info, as a message or as a file of camera_calibration: its `camera_name`.
        - Kalibr camchain: `cam0`, `cam1`, ...
        - COLMAP cameras.txt: the camera's id. Half a pixel is taken off the center, which COLMAP counts from a corner.
        - OCamCalib calib_results.txt: `ocam`. OcamCamera says how rows, columns and signs are converted.
        - KITTI: `P0` to `P3` (`P2` without a name), `P_rect_00` to `P_rect_03` (`P_rect_02` without a name).
    model : {"pinhole", "fisheye", "unified", "ocam"}, optional
        For files of OpenCV's, which need not name one: four coefficients may be a pinhole's or a fisheye's.

    Raises
    ------
    FileNotFoundError
        Where the file is missing.
    CalibrationError
        A ValueError, where it is of no known kind, is cut or holds wrong counts; where `name` is not in it, or is
        needed to choose: the message lists the names; where its model is unknown, untold or not `model`.
    """
    needed = checked_model(model)
    source = CalibrationText.read(path, needed)
    camera = _read(source, name)
    if needed is not None and model_of(camera) != needed:
        raise source.error("camera model", model_of(camera), f"{needed}, or another model=")
    return camera


def _read(source: CalibrationText, name: str | None) -> Camera:
    for describes, read_camera in TEXT_KINDS:
        if describes(source):
            return read_camera(source, name)
    return _read_yaml(source, name)


def _read_yaml(source: CalibrationText, name: str | None) -> Camera:
    """The camera in a file of one of the kinds written as YAML."""
    document = YamlMapping.parse(source)
    if document is not None:
        for describes, read_camera in YAML_KINDS:
            if describes(document):
                return read_camera(document, name)
    refuse_broken_json(source)
    found = f"text that starts with {source.text.strip()[:40]!r}" if document is None else document.held
    raise CalibrationError(f"{source.path}: found {found}; needed {NEEDED}")
