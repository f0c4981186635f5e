"""What a scene file may hold, as pydantic models; their JSON schema is what `regionpose schema` prints."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from regionpose.scene.document import brief


def _numbers(count: int, needed: str) -> Callable[[object], object]:
    """A check that a value is a list of `count` finite numbers."""

    def check(value: object) -> object:
        if not isinstance(value, list):
            raise PydanticCustomError(
                "numbers", "found {found}; needed {needed}", {"found": brief(value), "needed": needed}
            )
        odd = next((item for item in value if not _is_number(item)), None)
        if odd is not None or len(value) != count:
            found = brief(odd) if odd is not None else f"{len(value)} numbers"
            raise PydanticCustomError("numbers", "found {found}; needed {needed}", {"found": found, "needed": needed})
        return value

    return check


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FileName = Annotated[str, Field(min_length=1, description="a path, relative to the scene file")]
Pixel = Annotated[
    list[Number],
    BeforeValidator(_numbers(2, "[x, y]")),
    Field(min_length=2, max_length=2, description="[x, y], pixels"),
]
Point = Annotated[
    list[Number],
    BeforeValidator(_numbers(3, "[x, y, z]")),
    Field(min_length=3, max_length=3, description="[x, y, z], meters, world frame"),
]
Quaternion = Annotated[
    list[Number],
    BeforeValidator(_numbers(4, "[x, y, z, w]")),
    Field(min_length=4, max_length=4, description="[x, y, z, w]"),
]
Row = Annotated[list[Number], BeforeValidator(_numbers(4, "4 numbers")), Field(min_length=4, max_length=4)]
Coefficients4 = Annotated[list[Number], BeforeValidator(_numbers(4, "4 numbers")), Field(min_length=4, max_length=4)]
Pair = Annotated[list[Number], BeforeValidator(_numbers(2, "2 numbers")), Field(min_length=2, max_length=2)]


HIDDEN = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
"""Control characters, breaks of lines, and turns of the direction of writing."""

LONGEST_NAME = 200
"""Characters of a region's name: what a line and a table hold."""


class Item(BaseModel):
    """A mapping of the scene file: unknown keys are errors, and nothing is converted."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        for key in value:
            if key not in cls.model_fields:
                known = ", ".join(cls.model_fields)
                raise PydanticCustomError(
                    "unknown_key", "found an unknown key; needed one of {known}", {"known": known, "key": str(key)}
                )
        return value


def _key_among(*keys: str) -> Callable[[object], str | None]:
    """The tag of the first of `keys` that a mapping holds."""

    def kind(value: object) -> str | None:
        if not isinstance(value, dict):
            return None
        return next((f"<{key}>" for key in keys if key in value), None)

    return kind


def _choice(kind: Callable[[Any], str | None], needed: str) -> Discriminator:
    return Discriminator(kind, custom_error_type="choice", custom_error_message=needed)


class _Camera(Item):
    resized: bool = Field(
        False, description="the image is a resized copy of the photos that were calibrated: the camera is scaled to it"
    )


class CameraFile(_Camera):
    """A calibration file, and which of its cameras."""

    file: FileName
    name: str | None = Field(None, description="which camera, where the file holds several")
    model: Literal["pinhole", "fisheye", "unified", "ocam"] | None = Field(
        None, description="the camera model, where the file doesn't say"
    )


class _Intrinsics(_Camera):
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    width: int | None = Field(None, gt=0, description="pixels")
    height: int | None = Field(None, gt=0, description="pixels")


class InlinePinhole(_Intrinsics):
    """A perspective camera; OpenCV's distortion coefficients (0, 4, 5 or 8)."""

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


class InlineOcam(_Camera):
    """Scaramuzza's omnidirectional camera: bearing (x, y, a0 + a1 rho + ...), a0 > 0; center as [column, row]."""

    model: Literal["ocam"]
    polynomial: list[Number] = Field(min_length=1)
    center: Pair
    stretch: list[Pair] = Field(default_factory=lambda: [[1.0, 0.0], [0.0, 1.0]], min_length=2, max_length=2)
    width: int | None = Field(None, gt=0)
    height: int | None = Field(None, gt=0)


InlineCamera = InlinePinhole | InlineFisheye | InlineUnified | InlineOcam


def _camera_kind(value: object) -> str | None:
    if isinstance(value, str):
        return "<path>"
    if isinstance(value, dict) and "file" in value:
        return "<file>"
    model = value.get("model") if isinstance(value, dict) else None
    return f"<{model}>" if model in ("pinhole", "fisheye", "unified", "ocam") else None


CameraItem = Annotated[
    Annotated[FileName, Tag("<path>")]
    | Annotated[CameraFile, Tag("<file>")]
    | Annotated[InlinePinhole, Tag("<pinhole>")]
    | Annotated[InlineFisheye, Tag("<fisheye>")]
    | Annotated[InlineUnified, Tag("<unified>")]
    | Annotated[InlineOcam, Tag("<ocam>")],
    _choice(_camera_kind, "a calibration file, {file, name}, or a model: pinhole, fisheye, unified or ocam"),
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
    _choice(_ring_kind, RING_NEEDED),
]
WorldPolygon = Annotated[
    Annotated[list[Point], Field(min_length=3), Tag("<ring>")]
    | Annotated[list[Annotated[list[Point], Field(min_length=3)]], Tag("<rings>")],
    _choice(_ring_kind, RING_NEEDED),
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
        description="the file is a gray picture: each pixel's level over the largest is the share that is covered",
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
        _choice(_edges_kind, "a list of edge indices, or one for each ring"),
        Field(
            description="edges that are not the region's own but an occluder's, or not seen; edge i goes from vertex i"
            " of a ring to the next"
        ),
    ] = []


ImageSide = Annotated[
    Annotated[ImageSeed, Tag("<seed>")]
    | Annotated[ImageMask, Tag("<mask>")]
    | Annotated[ImagePolygonSide, Tag("<polygon>")],
    _choice(_key_among("seed", "mask", "polygon"), "one of seed, mask, polygon"),
]


class _WorldItem(Item):
    seen_from: Annotated[
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
    Field(description="points on its plane that join it without a gap may be the region's, too, and say nothing"),
]


class WorldSeed(_WorldItem):
    """A point on the region's plane, which is grown from there in the cloud."""

    seed: Point
    intensity_tolerance: Positive | None = Field(
        None,
        description="grow over points within this of the seed's intensity: tells a flush sign from its wall",
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
        _choice(lambda value: {str: "<file>", list: "<indices>"}.get(type(value)), "a file or a list of indices"),
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
    _choice(_key_among("seed", "points", "polygon", "mesh"), "one of seed, points, polygon, mesh"),
]


def _visible(name: str) -> str:
    """A check that a name has no characters that break lines or turn the direction of what follows."""
    hidden = HIDDEN.search(name)
    if hidden is not None:
        message = "found the character U+{code}; needed a name without control characters"
        raise PydanticCustomError("numbers", message, {"code": f"{ord(hidden.group()):04X}"})
    return name


Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(_visible)]


class RegionItem(Item):
    """One planar region, in the image and in the world."""

    name: Name
    image: ImageSide
    world: WorldSide


class ImageRegionItem(Item):
    """A planar region in the image, whose world side is not known."""

    name: Name
    image: ImageSide


class WorldRegionItem(Item):
    """A planar region in the world, whose side in the image is not known."""

    name: Name
    world: WorldSide


class QuaternionPose(Item):
    """A pose as a quaternion and a translation."""

    quat_xyzw: Quaternion
    translation_m: Point


class MatrixPose(Item):
    """A pose as a matrix of 3 or 4 rows [R t]."""

    matrix: list[Row] = Field(min_length=3, max_length=4)


PoseItem = Annotated[
    Annotated[QuaternionPose, Tag("<quat_xyzw>")] | Annotated[MatrixPose, Tag("<matrix>")],
    _choice(_key_among("quat_xyzw", "matrix"), "{quat_xyzw, translation_m} or {matrix}"),
]


class CameraFromWorld(Item):
    """A rough pose that takes world points to the camera."""

    camera_from_world: PoseItem


class WorldFromCamera(Item):
    """A rough pose that takes camera points to the world."""

    world_from_camera: PoseItem


class PriorItem(Item):
    """What is known of the pose beforehand."""

    up: Annotated[Point | None, Field(description="the world direction that is up in the image")] = None
    up_sigma_deg: Annotated[
        Positive | None, Field(description="standard deviation of its angle from the image's up; 15 when left out")
    ] = None
    initial: (
        Annotated[
            Annotated[CameraFromWorld, Tag("<camera_from_world>")]
            | Annotated[WorldFromCamera, Tag("<world_from_camera>")],
            _choice(_key_among("camera_from_world", "world_from_camera"), "camera_from_world or world_from_camera"),
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
        Literal["contour", "scene", "none"],
        Field(description="scene: on the regions' contours, then on the edges of the rest of photo and cloud"),
    ] = "contour"
    driver: Annotated[Literal["scipy", "native"] | None, Field(description="scipy when left out")] = None
    start: Annotated[
        Literal["global", "paper"], Field(description="paper: from the paper's own start, or the initial pose, alone")
    ] = "global"
    witness: Annotated[
        bool, Field(description="whether photo and cloud are compared away from the regions, where both are there")
    ] = True


class SceneModel(Item):
    """A camera, its image, a point cloud, and the planar regions that both show."""

    model_config = ConfigDict(title="regionpose scene file")

    camera: CameraItem
    image: FileName
    cloud: FileName | None = Field(None, description="not needed when every region's world side is a polygon or a mesh")
    sensor_origin: Annotated[
        Point | None,
        Field(
            description="where the scanner of the cloud stood; what the cloud's file says when left out, unknown when"
            " null, as of scans merged from several places"
        ),
    ] = None
    regions: list[RegionItem] = Field(min_length=1)
    image_regions: Annotated[
        list[ImageRegionItem], Field(description="regions that `regionpose pick` keeps until they are paired; unused")
    ] = []
    world_regions: Annotated[
        list[WorldRegionItem], Field(description="regions that `regionpose pick` keeps until they are paired; unused")
    ] = []
    prior: PriorItem = PriorItem()
    solver: SolverItem = SolverItem()
