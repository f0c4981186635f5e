"""One lens as each tool writes it, with numbers of its own."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
from regionpose.cameras import Camera, EquirectangularCamera, FisheyeCamera, PinholeCamera, UnifiedCamera

SIZE: dict[str, Any] = {"width": 1296, "height": 736}
LENS = PinholeCamera(812.5, 817.25, 655.4, 371.9, distortion=(-0.11, 0.035, 7e-4, -9e-4), **SIZE)
FISHEYE = FisheyeCamera(402.5, 403.25, 655.4, 371.9, distortion=(0.04, -0.01, 2e-3, -3e-4), **SIZE)
IDEAL = replace(LENS, distortion=())
K = "812.5, 0.0, 655.4, 0.0, 817.25, 371.9, 0.0, 0.0, 1.0"
NAMED = "fx: 812.5\nfy: 817.25\ncx: 655.4\ncy: 371.9\n"
RAYS = np.array([[0.31, -0.22, 1.3], [-0.6, 0.4, 1.0], [0.1, 0.35, 0.9]])

METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>frame</projection>
  <width>1296</width>
  <height>736</height>
  <f>817.25</f>
  <cx>7.9</cx>
  <cy>4.4</cy>
  <b1>-4.75</b1>
  <k1>-0.11</k1>
  <k2>0.035</k2>
  <p1>-0.0009</p1>
  <p2>0.0007</p2>
</calibration>
"""
SENSORS = """<document><chunk><sensors>
<sensor id="0" label="left" type="frame"><resolution width="1296" height="736"/>
<calibration type="frame" class="initial"><f>700</f></calibration>
<calibration type="fisheye" class="adjusted"><f>403.25</f><b1>-0.75</b1><cx>7.9</cx><cy>4.4</cy>
<k1>0.04</k1><k2>-0.01</k2><k3>0.002</k3><k4>-0.0003</k4></calibration></sensor>
<sensor id="1" label="pano" type="spherical"><resolution width="4000" height="2000"/>
<calibration type="spherical" class="adjusted"></calibration></sensor>
</sensors></chunk></document>
"""
PIX4D = """fileName imageWidth imageHeight
camera matrix K [3x3]
radial distortion [3x1]
tangential distortion [2x1]
camera position t [3x1]
camera rotation R [3x3]

a photo.png 1296 736
812.5 0 655.4
0 817.25 371.9
0 0 1
-0.11 0.035 0
0.0007 -0.0009
1 2 3
1 0 0
0 1 0
0 0 1
b.png 1296 736
400 0 655.4
0 400 371.9
0 0 1
0 0 0
0 0
1 2 3
1 0 0
0 1 0
0 0 1
"""
MRCAL = """# mrcal
{
    'lensmodel': 'LENSMODEL_OPENCV4',
    'extrinsics': [ 0, 0, 0, 0, 0, -0.5 ],
    'intrinsics': [ np.float64(812.5), 817.25, 655.4, 371.9, -0.11, 0.035, 7e-4, -9e-4 ],
    'imagersize': (1296, 736),
}
"""
NERFSTUDIO = {
    "camera_model": "OPENCV",
    **{"fl_x": 812.5, "fl_y": 817.25, "cx": 655.9, "cy": 372.4, "w": 1296, "h": 736},
    **{"k1": -0.11, "k2": 0.035, "p1": 7e-4, "p2": -9e-4},
    "frames": [{"file_path": "a.png", "transform_matrix": np.eye(4).tolist()}],
}
STORAGE = f"""<?xml version="1.0"?>
<opencv_storage>
<image_width>1296</image_width>
<image_height>736</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>{K.replace(",", "")}</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt>
  <data>-0.11 0.035 7e-4 -9e-4</data></distortion_coefficients>
<camera_model>pinhole</camera_model>
<names><_>a</_><_>b</_></names>
</opencv_storage>
"""
DVLC = {"camera": {"camera_model": "plumb_bob", "intrinsics": [812.5, 817.25, 655.4, 371.9]}, "results": {}}
DVLC["camera"]["distortion_coeffs"] = [-0.11, 0.035, 7e-4, -9e-4, 0.0]
OPENCALIB = {
    "front-intrinsic": {
        "sensor_name": "front",
        "param_type": "intrinsic",
        "param": {
            **{"img_dist_w": 1296, "img_dist_h": 736},
            "cam_K": {"rows": 3, "cols": 3, "data": [[812.5, 0, 655.4], [0, 817.25, 371.9], [0, 0, 1]]},
            "cam_dist": {"rows": 1, "cols": 5, "data": [[-0.11, 0.035, 7e-4, -9e-4, 0]]},
        },
    }
}
ORB = """%YAML:1.0
Camera.type: "PinHole"
Camera1.fx: 812.5
Camera1.fy: 817.25
Camera1.cx: 655.4
Camera1.cy: 371.9
Camera1.k1: -0.11
Camera1.k2: 0.035
Camera1.p1: 0.0007
Camera1.p2: -0.0009
Camera.width: 1296
Camera.height: 736
"""
ORB_FISHEYE = """%YAML:1.0
Camera.type: "KannalaBrandt8"
Camera.fx: 402.5
Camera.fy: 403.25
Camera.cx: 655.4
Camera.cy: 371.9
Camera.k1: 0.04
Camera.k2: -0.01
Camera.k3: 0.002
Camera.k4: -0.0003
Camera.width: 1296
Camera.height: 736
"""
VINS = """%YAML:1.0
---
model_type: PINHOLE
camera_name: front
image_width: 1296
image_height: 736
distortion_parameters: {k1: -0.11, k2: 0.035, p1: 7.0e-04, p2: -9.0e-04}
projection_parameters: {fx: 812.5, fy: 817.25, cx: 655.4, cy: 371.9}
"""
VINS_FISHEYE = """%YAML:1.0
---
model_type: KANNALA_BRANDT
image_width: 1296
image_height: 736
projection_parameters: {k2: 0.04, k3: -0.01, k4: 0.002, k5: -0.0003, mu: 402.5, mv: 403.25, u0: 655.4, v0: 371.9}
"""
VINS_MEI = """%YAML:1.0
---
model_type: MEI
image_width: 1296
image_height: 736
mirror_parameters: {xi: 1.7}
distortion_parameters: {k1: -0.1, k2: 0.02, p1: 1.0e-03, p2: -2.0e-03}
projection_parameters: {gamma1: 902.5, gamma2: 903.25, u0: 655.4, v0: 371.9}
"""
LIVO = """%YAML:1.0
cam_model: Pinhole
cam_width: 1296
cam_height: 736
scale: 0.5
cam_fx: 812.5
cam_fy: 817.25
cam_cx: 655.4
cam_cy: 371.9
cam_d0: -0.11
cam_d1: 0.035
cam_d2: 0.0007
cam_d3: -0.0009
"""
LIVOX = f"camera:\n  camera_matrix: [{K}]\n  dist_coeffs: [-0.11, 0.035, 7.0e-04, -9.0e-04, 0.0]\n"
CALIB = f"K: {K.replace(',', '')}\nD: -0.11 0.035 0.0007 -0.0009 0\nT: 0 -1 0 0.1 0 0 -1 0.2 1 0 0 0.3\n"
RECORD = {"token": "a", "sensor_token": "c", "translation": [1, 2, 3], "rotation": [1, 0, 0, 0]}
NUSCENES = [
    {**RECORD, "token": "lidar", "camera_intrinsic": []},
    {**RECORD, "token": "front", "camera_intrinsic": [[812.5, 0, 655.4], [0, 817.25, 371.9], [0, 0, 1]]},
]
OPEN3D = {**SIZE, "intrinsic_matrix": [812.5, 0, 0, 0, 817.25, 0, 655.4, 371.9, 1]}
UNSIZED: dict[str, Any] = {"width": None, "height": None}

FILES: dict[str, tuple[str, str | None, Camera, str]] = {
    "metashape.xml": (METASHAPE, None, LENS, "Metashape"),
    "sensors.xml": (SENSORS, "left", FISHEYE, "Metashape"),
    "panorama.xml": (SENSORS, "pano", EquirectangularCamera(width=4000, height=2000), "Metashape"),
    "pix4d.txt": (PIX4D, "a photo.png", LENS, "Pix4D"),
    "cam.cameramodel": (MRCAL, None, LENS, "mrcal"),
    "transforms.json": (json.dumps(NERFSTUDIO), None, LENS, "nerfstudio"),
    "opencv.xml": (STORAGE, None, LENS, "OpenCV XML"),
    "open3d.json": (json.dumps(OPEN3D), None, IDEAL, "Open3D"),
    "view.json": (json.dumps({"intrinsic": OPEN3D, "extrinsic": []}), None, IDEAL, "Open3D"),
    "calib.json": (json.dumps(DVLC), None, replace(LENS, **UNSIZED), "direct_visual"),
    "front-intrinsic.json": (json.dumps(OPENCALIB), "front", LENS, "OpenCalib"),
    "calib.txt": (CALIB, None, replace(LENS, **UNSIZED), "OpenCalib"),
    "livox.yaml": (LIVOX, None, replace(LENS, **UNSIZED), "OpenCV"),
    "qr_params.yaml": (NAMED + "k1: -0.11\nk2: 0.035\np1: 7e-4\np2: -9e-4\n", None, replace(LENS, **UNSIZED), "FAST"),
    "livo.txt": (LIVO, None, LENS, "FAST"),
    "orb.yaml": (ORB, "Camera1", LENS, "ORB"),
    "orb_fisheye.yaml": (ORB_FISHEYE, None, FISHEYE, "ORB"),
    "vins.yaml": (VINS, "front", LENS, "VINS"),
    "vins_fisheye.yaml": (VINS_FISHEYE, None, FISHEYE, "VINS"),
    "vins_mei.yaml": (
        VINS_MEI,
        None,
        UnifiedCamera(902.5, 903.25, 655.4, 371.9, xi=1.7, distortion=(-0.1, 0.02, 1e-3, -2e-3), **SIZE),
        "VINS",
    ),
    "calibrated_sensor.json": (json.dumps(NUSCENES), "front", replace(IDEAL, **UNSIZED), "nuScenes"),
}
