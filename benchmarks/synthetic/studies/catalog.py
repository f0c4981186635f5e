"""The studies of the benchmark, by name."""

from __future__ import annotations

import typing

from benchmarks.synthetic.studies.conditions import Grid, Mistake, NoiseModel
from benchmarks.synthetic.studies.mistakes import draw_mistaken_problem
from benchmarks.synthetic.studies.mixes import DRAWN, draw_mixed_problem
from benchmarks.synthetic.studies.study import Chart, Study

NOISE = (0.0, 0.02, 0.05, 0.08, 0.12, 0.2)
"""Shares of a region's area that segmentation errors change (the paper's levels)."""

CUTS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4)
"""Shares of a region's area that something hides or a border cuts."""

PLANES = (1, 2, 3)
SQUARES: tuple[Grid, ...] = (
    *({"planes": (1, 3), "noise": (0.05, 0.2), "squares": (size,)} for size in (1.0 / 16.0, 1.0 / 5.0)),
    {"planes": (1, 3), "noise": (0.05, 0.1), "squares": (1.0 / 30.0,)},
    *(
        {"planes": (1, 3), "disturbance": ("painted",), "noise": (noise,), "squares": (size,)}
        for size, noise in ((1.0 / 30.0, 0.06), (1.0 / 16.0, 0.12), (0.1, 0.2), (0.2, 0.2))
    ),
)
"""Sides of segmentation errors' squares, in sizes of the region, and shares that these can reach of any template."""

GRAZING_DEG = (1.0, 2.0, 3.0, 5.0, 7.5, 10.0, 15.0, 20.0, 25.0, 30.0)
TURNS_DEG = tuple(float(turn) for turn in range(-180, 180, 15))
PAPER_START = 'prior={"up":[0,-1,0]} refine=null start=paper'
"""The paper's start, right in the plane where the plane is not turned: the template's up is the world's -y."""

INTEGRALS = ("", "integration=boundary system=sphere", "integration=mesh", "integration=mesh system=sphere")
MESHES = (
    *(f"integration=mesh mesh_size={size}" for size in (0.2, 0.1, 0.05)),
    *(f"integration=mesh mesh_size={size} system=sphere" for size in (1.0, 0.5, 0.2, 0.1, 0.05)),
)
"""Meshes by the length of their edges, a share of the region's size."""

SYMMETRIES = ("asymmetric", "symmetric")
SCANS = ("outline", "samples")
SCANNED: Grid = {"templates": ("asymmetric",), "scan": ("samples",), "range_noise_m": (0.01,)}
"""Regions that a lidar samples with the range noise of most."""

SCAN_CHANGES: tuple[Grid, ...] = tuple(
    {"planes": (3,), "lidar_beams": (64,), **changed}
    for changed in (
        {"range_noise_m": (0.0, 0.03)},
        {"divergence_mrad": (3.0,)},
        {"mislabeled": (0.03, 0.1)},
        {"noise": (0.05,)},
        {"masks": ("drawn",), "templates": ("polygons",)},
        {"camera": ("omnidirectional",)},
        {"cut": ("scanner", "box")},
        {"cut": ("scanner", "box"), "planes": (1,)},
        {"lidar_beams": (8, 512)},
    )
)
"""What else is wrong with a scan, each alone, and a very sparse and a dense one."""

KNOWN = ("nothing", "up", "side", "near", "initial", "up and side")

BY_NOISE = Chart("sorted", lines="noise", panels="planes")
SOLVED_BY_NOISE = Chart("solved", lines="planes", across="noise")
COVERAGE_BY_NOISE = Chart("coverage", lines="noise", panels="planes")


def _by_noise(name: str, camera: str, description: str) -> Study:
    grid: Grid = {"camera": (camera,), "side": ("2d", "3d"), "planes": PLANES, "noise": NOISE}
    more = SQUARES if camera == "perspective" else ()
    return Study(name, description, [grid, *more], [BY_NOISE, SOLVED_BY_NOISE, COVERAGE_BY_NOISE])


def _cut(name: str, disturbance: str, sides: tuple[str, ...], description: str) -> Study:
    grid: Grid = {"disturbance": (disturbance,), "side": sides, "planes": PLANES, "noise": CUTS}
    return Study(name, description, [grid], [BY_NOISE, SOLVED_BY_NOISE, COVERAGE_BY_NOISE])


_ALL = (
    _by_noise("perspective", "perspective", "Errors of a pinhole camera by planes and segmentation error."),
    _by_noise("omnidirectional", "omnidirectional", "Errors of a 180 deg fisheye by planes and segmentation error."),
    Study(
        "integration",
        "Error and time of sums over the boundary, meshes of several sizes and the mask's pixels.",
        [
            {
                "camera": ("omnidirectional",),
                "planes": (1, 3),
                "noise": (0.0, 0.05),
                "solver": (*INTEGRALS, "integration=pixels system=sphere"),
            },
            {
                "camera": ("omnidirectional",),
                "planes": (1, 3),
                "masks": ("polygon",),
                "solver": (*INTEGRALS, *MESHES),
            },
        ],
        [Chart("cost", lines="solver", panels="planes")],
    ),
    Study(
        "regions",
        "Errors by the number of planes, 1 to 5, and with two regions on each of three.",
        [
            {"noise": (0.0, 0.05, 0.12), "planes": (1, 2, 3, 4, 5)},
            {"noise": (0.0, 0.05, 0.12), "planes": (3,), "regions_per_plane": (2,)},
        ],
        [
            Chart("sorted", lines="regions_given", panels="noise"),
            Chart("solved", lines="noise", across="regions_given"),
        ],
    ),
    Study(
        "degeneracy",
        "Success by the angle between plane and line of sight, and by the plane's turn in itself, symmetric or not.",
        [
            {"templates": SYMMETRIES, "grazing_deg": GRAZING_DEG},
            {"templates": SYMMETRIES, "turn_deg": TURNS_DEG, "world": ("first",)},
        ],
        [
            Chart("solved", lines="templates", across="grazing_deg"),
            Chart("solved", lines="templates", across="turn_deg"),
        ],
    ),
    Study(
        "initialization",
        "The paper's start alone against the global search, by the plane's turn in itself.",
        [
            {
                "camera": ("perspective", "omnidirectional"),
                "templates": ("asymmetric",),
                "solver": ("", PAPER_START),
                "turn_deg": TURNS_DEG,
                "world": ("first",),
            }
        ],
        [Chart("solved", lines="solver", panels="camera", across="turn_deg")],
    ),
    _cut("occlusion", "occlusion", ("2d", "3d"), "Errors when a half plane hides a part of each region."),
    _cut("truncation", "truncation", ("2d",), "Errors when the image border cuts the regions."),
    Study(
        "lidar",
        "Errors of outlines of a lidar's points and of all its beams as samples, by beams and by what is wrong.",
        [
            {**SCANNED, "scan": SCANS, "planes": (1, 3), "lidar_beams": (16, 32, 64, 128)},
            *({**SCANNED, **changed} for changed in SCAN_CHANGES),
        ],
        [
            Chart("sorted", lines="lidar_beams", panels="planes"),
            Chart("solved", lines="scan", panels="planes", across="lidar_beams"),
            Chart("coverage", lines="scan", panels="planes"),
        ],
    ),
    Study(
        "calibration",
        "Errors of a camera whose focal length and principal point are not quite known.",
        [{"planes": PLANES, "center_error_px": (0.0, 3.0), "focal_error": (0.0, 0.001, 0.003, 0.01)}],
        [
            Chart("sorted", lines="focal_error", panels="planes"),
            Chart("solved", lines="planes", panels="center_error_px", across="focal_error"),
        ],
    ),
    Study(
        "outlier",
        "Success and warnings where one region is another shape or lies elsewhere, on the mask or in the world.",
        [{"side": ("2d", "3d"), "planes": (3, 4, 5), "noise": (0.0, 0.05), "wrong": ("shape", "place")}],
        [Chart("solved", lines="planes", panels="wrong", across="noise")],
    ),
    Study(
        "trust",
        "Whether warnings tell right from wrong poses: every kind of error, each as strong as the seed draws it.",
        [{"camera": ("perspective", "omnidirectional"), "model": typing.get_args(NoiseModel)}],
        [
            Chart("sorted", lines="model", panels="camera"),
            Chart("coverage", lines="model", panels="camera"),
            Chart("confidence", lines="model", panels="camera"),
        ],
        problem=draw_mixed_problem,
        drawn=DRAWN,
        exact_exposure=False,
    ),
    Study(
        "mistakes",
        "Whether the verdict tells what users get wrong: swapped, mirrored or replaced regions, rough corners.",
        [{"camera": ("perspective", "fisheye"), "mistake": typing.get_args(Mistake)}],
        [Chart("sorted", lines="mistake", panels="camera"), Chart("confidence", lines="mistake", panels="camera")],
        problem=draw_mistaken_problem,
        drawn=("planes",),
        exact_exposure=False,
    ),
    Study(
        "priors",
        "What an up direction, visible sides, the camera's place or a rough pose do for one plane and for three.",
        [{"planes": (1, 3), "prior": KNOWN, "noise": (0.0, 0.05, 0.2)}],
        [Chart("solved", lines="prior", panels="planes", across="noise")],
    ),
)

STUDIES: dict[str, Study] = {study.name: study for study in _ALL}
"""The studies by name."""


def study_named(name: str) -> Study:
    """The study of that name; ValueError lists the known names."""
    if name not in STUDIES:
        raise ValueError(f"no study is named {name!r}; the studies are {', '.join(STUDIES)}")
    return STUDIES[name]
