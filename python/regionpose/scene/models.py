"""What a scene file may hold, as pydantic models; their JSON schema is what `regionpose schema` prints."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, Tag

from regionpose.scene.field_types import (
    Coefficients4,
    FileName,
    Item,
    Name,
    NotNegative,
    Number,
    Pair,
    Pixel,
    Point,
    Positive,
    Quaternion,
    Row,
    choice,
    key_among,
)
from regionpose.solve.options import Solver


class _Camera(Item):
    resized: bool = Field(
        False, description="the image is a resized copy of the photos that were calibrated: the camera is scaled to it"
    )


class CameraFile(_Camera):
    """A calibration file, and which of its cameras."""

    file: FileName
    name: str | None = Field(None, description="which camera, where the file holds several")
    model: Literal["pinhole", "fisheye", "unified", "fov", "ocam", "equirectangular"] | None = Field(
        None, description="the camera model, where the file doesn't name it"
    )
    rectified: bool = Field(
        False, description="the image was rectified (ROS: image_rect): its camera has P of camera_info, no distortion"
    )


class _Intrinsics(_Camera):
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    width: int | None = Field(None, gt=0, description="pixels")
    height: int | None = Field(None, gt=0, description="pixels")


class InlinePinhole(_Intrinsics):
    """A perspective camera; OpenCV's distortion coefficients (0, 4, 5, 8, 12 or 14)."""

    model: Literal["pinhole"]
    distortion: list[Number] = Field(default_factory=list)


class InlineFisheye(_Intrinsics):
    """A Kannala-Brandt camera, as OpenCV's fisheye module."""

    model: Literal["fisheye"]
    distortion: Coefficients4 = Field(default_factory=lambda: [0.0] * 4)


class InlineUnified(_Intrinsics):
    """Mei's unified camera."""

    model: Literal["unified"]
    xi: Number
    distortion: list[Number] = Field(default_factory=list)


class InlineFov(_Intrinsics):
    """The field-of-view camera of Devernay and Faugeras (ATAN); omega in radians."""

    model: Literal["fov"]
    omega: Positive


class InlineOcam(_Camera):
    """Scaramuzza's omnidirectional camera: bearing (x, y, a0 + a1 rho + ...), a0 > 0; center as [column, row]."""

    model: Literal["ocam"]
    polynomial: list[Number] = Field(min_length=1)
    center: Pair
    stretch: list[Pair] = Field(default_factory=lambda: [[1.0, 0.0], [0.0, 1.0]], min_length=2, max_length=2)
    width: int | None = Field(None, gt=0)
    height: int | None = Field(None, gt=0)


class InlineEquirectangular(_Camera):
    """A 360 degree panorama, given by its size."""

    model: Literal["equirectangular"]
    width: int = Field(gt=0)
    height: int = Field(gt=0)


def _camera_kind(value: object) -> str | None:
    if isinstance(value, str):
        return "<path>"
    if isinstance(value, dict) and "file" in value:
        return "<file>"
    model = value.get("model") if isinstance(value, dict) else None
    return f"<{model}>" if model in ("pinhole", "fisheye", "unified", "fov", "ocam", "equirectangular") else None


CameraItem = Annotated[
    Annotated[FileName, Tag("<path>")]
    | Annotated[CameraFile, Tag("<file>")]
    | Annotated[InlinePinhole, Tag("<pinhole>")]
    | Annotated[InlineFisheye, Tag("<fisheye>")]
    | Annotated[InlineUnified, Tag("<unified>")]
    | Annotated[InlineFov, Tag("<fov>")]
    | Annotated[InlineOcam, Tag("<ocam>")]
    | Annotated[InlineEquirectangular, Tag("<equirectangular>")],
    choice(
        _camera_kind,
        "a calibration file, {file, name}, or a model: pinhole, fisheye, unified, fov, ocam or equirectangular",
    ),
]


def _ring_kind(value: object) -> str | None:
    if not isinstance(value, list):
        return None
    nested = value and isinstance(value[0], list) and value[0] and isinstance(value[0][0], list)
    return "<rings>" if nested else "<ring>"


EdgeIndex = Annotated[int, Field(ge=0)]


def _edges_kind(value: object) -> str | None:
    if not isinstance(value, list):
        return None
    return "<rings>" if value and isinstance(value[0], list) else "<ring>"


RING_NEEDED = "a ring of at least 3 vertices, or a list of rings"
ImagePolygon = Annotated[
    Annotated[list[Pixel], Field(min_length=3), Tag("<ring>")]
    | Annotated[list[Annotated[list[Pixel], Field(min_length=3)]], Tag("<rings>")],
    choice(_ring_kind, RING_NEEDED),
]
WorldPolygon = Annotated[
    Annotated[list[Point], Field(min_length=3), Tag("<ring>")]
    | Annotated[list[Annotated[list[Point], Field(min_length=3)]], Tag("<rings>")],
    choice(_ring_kind, RING_NEEDED),
]


class ImageSeed(Item):
    """A pixel inside the region, which is grown from there."""

    seed: Pixel
    tolerance: Positive | None = Field(
        None, description="how far the color may differ; chosen from the image when left out"
    )


class ImageMask(Item):
    """A label image (0 is no region), a COCO or a labelme file, and which of its regions."""

    mask: FileName
    label: Annotated[
        Annotated[int, Tag("<number>")] | Annotated[str, Field(min_length=1), Tag("<name>")] | None,
        Field(
            description="which region, where the file holds several: a label image's value, a name, or the id of a "
            "COCO annotation"
        ),
    ] = None
    image: int | str | None = Field(
        None, description="which image of a COCO file that holds several: its id or its file name"
    )
    coverage: bool = Field(
        False,
        description="the file is a gray picture: each pixel's level over the largest is the fraction that is covered",
    )
    unknown: FileName | None = Field(
        None, description="a file of the same kinds: pixels that may be the region's or not, such as an occluder's"
    )
    unknown_label: Annotated[
        Annotated[int, Tag("<number>")] | Annotated[str, Field(min_length=1), Tag("<name>")] | None,
        Field(description="which region of it, where it holds several"),
    ] = None


class ImagePolygonSide(Item):
    """The region's outline: one ring, or an outer ring and its holes."""

    polygon: ImagePolygon
    hidden_edges: Annotated[
        Annotated[list[EdgeIndex], Tag("<ring>")] | Annotated[list[list[EdgeIndex]], Tag("<rings>")],
        choice(_edges_kind, "a list of edge indices, or one for each ring"),
        Field(
            description="edges that are not the region's own but an occluder's, or not seen; edge i goes from vertex i"
            " of a ring to the next"
        ),
    ] = Field(default_factory=list)


ImageSide = Annotated[
    Annotated[ImageSeed, Tag("<seed>")]
    | Annotated[ImageMask, Tag("<mask>")]
    | Annotated[ImagePolygonSide, Tag("<polygon>")],
    choice(key_among("seed", "mask", "polygon"), "one of seed, mask, polygon"),
]


class _WorldItem(Item):
    viewpoint: Annotated[
        Point | None,
        Field(
            description="a point on the side that the camera sees, such as the scanner's place; either side without it"
        ),
    ] = None


Radius = Annotated[
    Positive | None,
    Field(description="the region is the outline of its points by an alpha shape of this radius, not samples"),
]
Extends = Annotated[
    bool,
    Field(description="points on its plane that join it without a gap may be the region's, too, and are no evidence"),
]


class WorldSeed(_WorldItem):
    """A point on the region's plane, which is grown from there in the cloud."""

    seed: Point
    intensity_tolerance: Positive | None = Field(
        None,
        description="grow over points within this of the seed's intensity: separates a flush sign from its wall",
    )
    min_width_m: Positive | None = Field(
        None, description="parts of the patch narrower than this, in meters, such as posts in its plane, are left out"
    )
    radius_m: Radius = None
    extends: Extends = False


Indices = Annotated[list[Annotated[int, Field(ge=0)]], Field(min_length=3)]


class WorldPoints(_WorldItem):
    """The region's points: indices into the cloud, or a file of indices, of a mask, of labels, or of coordinates."""

    points: Annotated[
        Annotated[FileName, Tag("<file>")] | Annotated[Indices, Tag("<indices>")],
        choice(lambda value: {str: "<file>", list: "<indices>"}.get(type(value)), "a file or a list of indices"),
    ]
    label: int | None = Field(None, description="which label, where the file holds one for each point of the cloud")
    radius_m: Radius = None
    extends: Extends = False


class WorldPolygonSide(_WorldItem):
    """The region's outline: one ring, or an outer ring and its holes."""

    polygon: WorldPolygon


class WorldMesh(_WorldItem):
    """A mesh file of an open surface."""

    mesh: FileName


WorldSide = Annotated[
    Annotated[WorldSeed, Tag("<seed>")]
    | Annotated[WorldPoints, Tag("<points>")]
    | Annotated[WorldPolygonSide, Tag("<polygon>")]
    | Annotated[WorldMesh, Tag("<mesh>")],
    choice(key_among("seed", "points", "polygon", "mesh"), "one of seed, points, polygon, mesh"),
]


class RegionItem(Item):
    """One planar region, in the image and in the world."""

    name: Name
    image: ImageSide
    world: WorldSide


class ImageRegionItem(Item):
    """A planar region in the image without its world side."""

    name: Name
    image: ImageSide


class WorldRegionItem(Item):
    """A planar region in the world without its image side."""

    name: Name
    world: WorldSide


def _regions_kind(value: object) -> str | None:
    if isinstance(value, list):
        return "<list>"
    return "<planes>" if value == "planes" else None


class QuaternionPose(Item):
    """A pose as a quaternion and a translation."""

    quat_xyzw: Quaternion
    translation_m: Point


class MatrixPose(Item):
    """A pose as a matrix of 3 or 4 rows [R t]."""

    matrix: list[Row] = Field(min_length=3, max_length=4)


PoseItem = Annotated[
    Annotated[QuaternionPose, Tag("<quat_xyzw>")] | Annotated[MatrixPose, Tag("<matrix>")],
    choice(key_among("quat_xyzw", "matrix"), "{quat_xyzw, translation_m} or {matrix}"),
]


class CameraFromWorld(Item):
    """A rough pose that takes world points to the camera."""

    camera_from_world: PoseItem


class WorldFromCamera(Item):
    """A rough pose that takes camera points to the world."""

    world_from_camera: PoseItem


class PriorItem(Item):
    """The prior of the pose."""

    up: Annotated[Point | None, Field(description="the world direction that is up in the image")] = None
    up_sigma_deg: Annotated[
        Positive | None, Field(description="standard deviation of its angle from the image's up; 15 when left out")
    ] = None
    initial: (
        Annotated[
            Annotated[CameraFromWorld, Tag("<camera_from_world>")]
            | Annotated[WorldFromCamera, Tag("<world_from_camera>")],
            choice(key_among("camera_from_world", "world_from_camera"), "camera_from_world or world_from_camera"),
        ]
        | None
    ) = None
    initial_rotation_sigma_deg: Annotated[
        Positive | None,
        Field(description="standard deviation of the initial pose about each axis; without it, it is only a start"),
    ] = None
    initial_center_sigma_m: Annotated[
        Positive | None, Field(description="standard deviation of the initial camera center along each axis")
    ] = None
    camera_near: Annotated[
        Point | None,
        Field(description="a place that the camera stands near; sensor_origin when left out, nothing when null"),
    ] = None
    camera_near_sigma_m: Annotated[
        Positive | None,
        Field(description="standard deviation of its place about there along each axis; 2 when left out"),
    ] = None


class SolverItem(Item):
    """How the equations are set up and solved."""

    system: Literal["plane", "sphere"] = "plane"
    integration: Literal["boundary", "mesh", "pixels"] = "boundary"
    mesh_size: Annotated[
        Positive | None,
        Field(description="edge length of the mesh's triangles over the root of the region's area, with mesh alone"),
    ] = None
    refine: Annotated[
        Literal["contour", "none"],
        Field(description="whether the regions' pose is refined on their contours"),
    ] = "contour"
    driver: Literal["native", "scipy"] = "native"
    start: Annotated[
        Literal["global", "paper"], Field(description="paper: from the paper's own start, or the initial pose, alone")
    ] = "global"
    edges: Annotated[
        bool, Field(description="whether the edges of photo and cloud count beside the regions, where both are there")
    ] = True
    frame_sigma_deg: Annotated[
        NotNegative,
        Field(
            description="standard deviation of the rotation that calibration, time and scan of one frame add, degrees"
        ),
    ] = Solver.frame_sigma_deg
    frame_sigma_m: Annotated[NotNegative, Field(description="the same of the camera's place, meters")] = (
        Solver.frame_sigma_m
    )
    focal_sigma_percent: Annotated[
        NotNegative, Field(description="standard deviation of the calibration's focal lengths, percent")
    ] = Solver.focal_sigma_percent
    center_sigma_px: Annotated[
        NotNegative,
        Field(description="standard deviation of the calibration's image center along either axis, pixels"),
    ] = Solver.center_sigma_px
    max_rotation_sigma_deg: Annotated[
        NotNegative, Field(description="largest standard deviation of the rotation of a trusted pose, degrees")
    ] = Solver.max_rotation_sigma_deg
    max_translation_sigma_percent: Annotated[
        NotNegative, Field(description="the same of the translation, percent of the regions' median distance")
    ] = Solver.max_translation_sigma_percent


class CloudFile(Item):
    """A cloud's file, and the names of its columns where the file has none."""

    file: FileName
    columns: list[Annotated[str, Field(min_length=1)]] | None = Field(
        None,
        description="names of the columns of a .bin, .npy or text file, x, y and z among them; _ leaves one out",
        min_length=3,
    )


CloudItem = Annotated[
    Annotated[FileName, Tag("<path>")] | Annotated[CloudFile, Tag("<file>")],
    choice(
        lambda value: "<path>" if isinstance(value, str) else key_among("file")(value),
        "a path, or {file, columns} for a file that doesn't name its columns",
    ),
]

PLANES = "planes"
"""In place of a list of world regions: all that the cloud holds."""


class _Exposure(Item):
    """What one photo and one cloud show."""

    cloud: CloudItem | None = Field(
        None, description="not needed when every region's world side is a polygon or a mesh"
    )
    sensor_origin: Annotated[
        Point | None,
        Field(
            description="where the scanner of the cloud stood; from the cloud's file when left out, unknown when"
            " null, as of scans merged from several places"
        ),
    ] = None
    regions: Annotated[list[RegionItem], Field(description="regions with both sides")] = Field(default_factory=list)
    image_regions: Annotated[
        list[ImageRegionItem], Field(description="regions whose world sides are looked for among world_regions")
    ] = Field(default_factory=list)
    world_regions: Annotated[
        Annotated[list[WorldRegionItem], Tag("<list>")] | Annotated[Literal["planes"], Tag("<planes>")],
        choice(_regions_kind, "a list of regions, or planes for those that the cloud holds"),
        Field(description="regions whose image sides are looked for among image_regions; planes: all of the cloud"),
    ] = Field(default_factory=list)


class FrameItem(_Exposure):
    """One photo and one cloud of several, which were taken at one pose of the camera in the clouds' frame."""

    name: Name
    image: FileName


class SceneModel(_Exposure):
    """A camera, its image, a point cloud, and the planar regions that both show; or several frames of these."""

    model_config = ConfigDict(title="regionpose scene file")

    camera: CameraItem
    image: Annotated[FileName | None, Field(description="the photo; needed unless there are frames")] = None
    frames: Annotated[
        list[FrameItem], Field(description="several photos and clouds with one pose, in place of image, cloud, regions")
    ] = Field(default_factory=list)
    prior: PriorItem = PriorItem()
    solver: SolverItem = SolverItem()


EXPOSURE_KEYS = frozenset({*_Exposure.model_fields, "image"})
"""Keys of a frame, which a scene without frames holds itself."""
