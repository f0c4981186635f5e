"""The compiled core: rings, meshes, moments, problems and their estimates."""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "TRUSTED",
    "AlignmentFrame",
    "CloudEdges",
    "Density",
    "Estimate",
    "LocalWeights",
    "Minimum",
    "ObservedRegion",
    "Prior",
    "Problem",
    "Projection",
    "Search",
    "Solution",
    "WorldRegion",
    "__version__",
    "alpha_shape",
    "blurred",
    "bridging_gap",
    "cells_along",
    "color_levels",
    "contour_pieces",
    "edge_spreads",
    "estimate_batch",
    "even_mesh",
    "even_spacing",
    "flood_levels",
    "mask_contours",
    "mesh_planar_moments",
    "mesh_spherical_moments",
    "nearest_edges",
    "outline_sums",
    "pixel_moments",
    "planar_moments",
    "plane_rings",
    "png_bytes",
    "quad_solid_angles",
    "retract_pose",
    "robust_plane",
    "rotation_confidence",
    "search_poses",
    "spherical_moments",
    "triangulate",
    "work_counter",
]
__version__: Final[str]

TRUSTED: Final[float]
"""Confidence above which a pose is trusted."""

def planar_moments(rings: Iterable[ArrayLike], order: int) -> NDArray[np.float64]:
    """Moments of a planar region, (order + 1, order + 1): `[i, j]` is the integral of `x^i y^j`, 0 above the order."""

def spherical_moments(rings: Iterable[ArrayLike], order: int) -> NDArray[np.float64]:
    """Moments of a region of the unit sphere, (order + 1,) * 3: `[l, m, n]` is the integral of `x^l y^m z^n`."""

def mesh_planar_moments(vertices: ArrayLike, triangles: ArrayLike, order: int) -> NDArray[np.float64]:
    """Moments, as of `planar_moments`, of triangles (k, 3) between vertices (v, 2)."""

def mesh_spherical_moments(
    vertices: ArrayLike, triangles: ArrayLike, order: int, *, subdivision: int = 4
) -> NDArray[np.float64]:
    """Moments, as of `spherical_moments`, of triangles (k, 3) between vertices (v, 3) seen from the origin."""

def pixel_moments(bearings: ArrayLike, solid_angles: ArrayLike, order: int) -> NDArray[np.float64]:
    """Moments, as of `spherical_moments`, of pixels with bearings (n, 3) and solid angles (n,) in steradians."""

def quad_solid_angles(corners: ArrayLike) -> NDArray[np.float64]:
    """Solid angles (n,), steradians, of quadrilaterals of bearings (4 n, 3), row by row four corners in turn."""

def plane_rings(rings: Iterable[ArrayLike], *, polygon: bool = True) -> list[NDArray[np.float64]]:
    """Rings (n, 2) checked and oriented; with `polygon`, every ring after the first has to be a hole in it."""

def mask_contours(
    mask: NDArray[np.generic],
) -> tuple[list[NDArray[np.float64]], tuple[int, int, int, int], bool]:
    """Rings (n, 2) of a mask (h, w), its window (left, top, right, bottom), and whether it is binary."""

def color_levels(colors: NDArray[np.float32], color: Sequence[float], step: float, most: int) -> NDArray[np.uint16]:
    """How many steps (h, w) the colors (h, w, 3) lie from one (3,), rounded up, no more than `most`."""

def flood_levels(levels: NDArray[np.uint16], start: tuple[int, int]) -> NDArray[np.uint16]:
    """The least level (h, w) at which a flood from a start (row, column) arrives at each pixel of levels (h, w)."""

def outline_sums(arrivals: NDArray[np.uint16], colors: NDArray[np.float32], count: int) -> list[NDArray[np.float64]]:
    """Sums of the contrast across, and numbers of pixel edges, (count,) each, on the outlines of the regions
    {arrivals (h, w) <= k} of a picture of colors (h, w, 3).
    """

def png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file of a picture (h, w, 3)."""

def contour_pieces(rings: Iterable[ArrayLike], on_border: Iterable[NDArray[np.bool_]]) -> list[NDArray[np.float64]]:
    """Means (m, 2) of equally long parts of closed rings (n, 2) in pixels, without those on edges marked (n,)."""

def nearest_edges(rings: Iterable[ArrayLike], points: ArrayLike) -> NDArray[np.int64]:
    """Index (m,) of the edge of closed rings (n, 2) nearest to each of the points (m, 2), counted ring after ring."""

def blurred(picture: NDArray[np.float32], weights: ArrayLike) -> NDArray[np.float32]:
    """A picture (h, w) spread down its columns and along its rows, mirrored beyond its sides.

    `weights` (r + 1,): of the pixel itself, and of those that are 1 to r pixels away to either side.
    """

def triangulate(
    rings: Iterable[ArrayLike], *, max_area: float | None = None, min_angle: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (v, 2) and triangles (k, 3) of a mesh of a region; `min_angle` in degrees."""

def even_mesh(rings: Iterable[ArrayLike], edge_length: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices (v, 2) and triangles (k, 3) of a mesh of a region, of nearly one size and shape."""

def alpha_shape(points: ArrayLike, radius: float) -> list[NDArray[np.float64]]:
    """Rings (m, 2) of the outline of points (n, 2), outer ones counter-clockwise, holes clockwise."""

def bridging_gap(points: ArrayLike) -> float:
    """The least length of steps by which 98 % of the points (n, 2) are reached from one another."""

def even_spacing(points: ArrayLike) -> NDArray[np.float64]:
    """A matrix (2, 2) such that samples (n, 2) are equally far apart in all directions in `points @ matrix`."""

def retract_pose(
    rotation: ArrayLike, translation: ArrayLike, increment: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotation (3, 3) and translation (3,) of a pose with a left increment (6,) applied, `[omega (rad), tau]`."""

def robust_plane(
    points: ArrayLike, sensor: ArrayLike | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """A plane through most of the points (n, 3): its origin (3,), axes u, v, normal as rows (3, 3), and the indices of
    the points on it.
    """

def cells_along(
    points: ArrayLike, cells: NDArray[np.intp], shape: tuple[int, int], angle_deg: float
) -> NDArray[np.bool_]:
    """Cells of a grid with points (n, 3) whose normal, with those of the cells around, is within an angle of the third
    axis, or unknown; `cells` (n, 2): the row and column of each.
    """

def rotation_confidence(covariance: ArrayLike) -> float:
    """Probability that the rotation error of a pose at the right mode, of this covariance (6, 6) of its left increment,
    is below 5 degrees.
    """

def estimate_batch(
    problems: Sequence[tuple[Sequence[ObservedRegion], Sequence[WorldRegion]]],
    priors: Sequence[Prior | None],
    *,
    threads: int | None = None,
    system: Literal["plane", "sphere"] = "plane",
    integration: Literal["boundary", "mesh", "pixels"] = "boundary",
    mesh_size: float | None = None,
    start: Literal["global", "paper"] = "global",
    refine: Literal["contour"] | None = "contour",
    frame_sigma: tuple[float, float, float, float] | None = None,
    limits: tuple[float, float] | None = None,
) -> list[Estimate | str | None]:
    """Estimates of many problems by the native solver, each with its prior, in order; None for one without a pose in
    view, and what is wrong with it for one that is refused.
    """

def work_counter() -> int:
    """Work charged so far to the budgets of searches and meshes of this process, in evaluated edges."""

_WarningParts = tuple[str, list[int], dict[str, float | str | tuple[float, ...]]]

@final
class Projection:
    """The projection of a camera as a table over a cube of bearings."""

    def __new__(cls, size: Sequence[float], project: Callable[[NDArray[np.float64]], ArrayLike]) -> Projection:
        """Of an image of `size` (width, height), pixels; `project` takes bearings (n, 3) to pixels (n, 2)."""

    def zoomed(self, factor: float, principal: ArrayLike) -> Projection:
        """That of the camera with focal lengths multiplied by a factor and its principal point at a pixel (2,)."""

    def project(self, bearings: ArrayLike) -> NDArray[np.float64]:
        """Pixels (n, 2) of bearings (n, 3), NaN where the camera sees none."""

@final
class CloudEdges:
    """Edges of a cloud in the world, as seen from a place."""

    def __new__(
        cls,
        points: ArrayLike,
        place: ArrayLike,
        cell: float,
        gap: float,
        step_fraction: float,
        shades: NDArray[np.float64] | None = None,
        axes: ArrayLike | None = None,
        angle: float = ...,
    ) -> CloudEdges:
        """Of points (n, 3) from a place (3,); `cell`, `gap`, rad; `step_fraction` of the inverse distance; `shades`
        (n,); within an `angle`, rad, of `axes` (m, 3).
        """

    def __len__(self) -> int: ...

@final
class AlignmentFrame:
    """A photo and the edges of a cloud."""

    def __new__(
        cls,
        projection: Projection,
        half_field: float,
        ratios: Sequence[tuple[NDArray[np.float32], int]],
        edges: CloudEdges,
        origin: ArrayLike,
    ) -> AlignmentFrame:
        """Of log likelihood ratios (4, h, w) by spread, each with its reduction; `half_field`, rad; `origin` (3,)."""

    def with_edges(self, edges: CloudEdges) -> AlignmentFrame:
        """The same photo with other edges."""

    def with_projection(self, projection: Projection, half_field: float) -> AlignmentFrame:
        """The same photo and edges as another camera has them."""

    def at_spread(self, spread: int) -> AlignmentFrame:
        """The same, which spreads finer than one, by its number, do not make finer."""

    def log_ratio(self, rotation: ArrayLike, translation: ArrayLike, spread: int) -> tuple[float, int]:
        """Sum of log likelihood ratios at a pose, by the number of a spread, and how many edges the photo shows."""

    def project_edges(
        self, rotation: ArrayLike, translation: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Pixels (n, 2) at which edges project at a pose, and the directions (n,) across them."""

@final
class Density:
    """A density of poses."""

    @staticmethod
    def of_prior(prior: Prior) -> Density:
        """That of a prior with a position of the camera; ValueError for others."""

    @staticmethod
    def student(rotation: ArrayLike, translation: ArrayLike, covariance: ArrayLike) -> Density:
        """Student's about a pose, of a covariance (6, 6) of its left increment."""

    def distinct_poses(self, frames: Sequence[AlignmentFrame]) -> float:
        """How many of its poses the widest spread of the edges of frames distinguishes."""

    def log_at(self, rotation: ArrayLike, translation: ArrayLike) -> float:
        """The logarithm of the density at a pose."""

@final
class LocalWeights:
    """Weights of frames by spread, by null poses about a pose."""

    def __new__(cls, frames: Sequence[AlignmentFrame], rotation: ArrayLike, translation: ArrayLike) -> LocalWeights: ...
    def maximum(
        self, frames: Sequence[AlignmentFrame], density: Density, rotation: ArrayLike, translation: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float, float, int] | None:
        """The maximum of the posterior reached from a start, as one of `search_poses`; None without information."""

def search_poses(
    frames: Sequence[AlignmentFrame],
    density: Density,
    starts: Sequence[tuple[ArrayLike, ArrayLike]],
    draws: int,
    kept: Sequence[int],
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float, float, int]]:
    """Maxima of the posterior, of the largest mass first: rotation (3, 3), translation (3,), covariance (6, 6), log
    mass about it, log likelihood ratio at it, number of edges. What `progress` raises ends the search.
    """

def edge_spreads() -> list[float]:
    """The spreads of edges, pixels, from wide to narrow."""

@final
class ObservedRegion:
    """A region as the camera sees it: rings of bearings (n, 3), its area in pixels, and its pixels to sum over.

    `borders`: the image's border beside the region, lines of bearings (m, 3), where it may have cut the region.
    `hidden`: stretches of the rings that aren't its own boundary, lines of bearings (m, 3).
    """

    def __new__(
        cls,
        rings: Iterable[ArrayLike],
        pixel_area: float,
        *,
        borders: Iterable[ArrayLike] | None = None,
        hidden: Iterable[ArrayLike] | None = None,
        pixel_bearings: ArrayLike | None = None,
        pixel_solid_angles: ArrayLike | None = None,
    ) -> ObservedRegion: ...

@final
class WorldRegion:
    """A region of the 3D data: planar with holes, or a triangulated open surface."""

    @staticmethod
    def from_rings(rings: Iterable[ArrayLike]) -> WorldRegion:
        """The planar region inside the first ring (n, 3) and outside the others."""

    @staticmethod
    def from_outline(origin: ArrayLike, axes: ArrayLike, rings: Iterable[ArrayLike]) -> WorldRegion:
        """The planar region of rings (n, 2) in a plane's coordinates `origin + u axes[0] + v axes[1]`."""

    @staticmethod
    def from_mesh(vertices: ArrayLike, triangles: ArrayLike) -> WorldRegion:
        """The region covered by an open surface of triangles (k, 3) between vertices (v, 3)."""

    def with_viewpoint(self, viewpoint: ArrayLike) -> WorldRegion:
        """The same region of which a viewpoint (3,) lies on the side that the camera sees."""

    def with_samples(
        self, inside: ArrayLike, outside: ArrayLike, enclosed: ArrayLike, *, is_line: bool = False
    ) -> WorldRegion:
        """The same region with places (n, 3) inside, (m, 3) outside, and (k, 3) outside that it encloses; `is_line`
        where they lie on one line, so that its extent across is unknown.
        """

    @property
    def is_line(self) -> bool:
        """Whether its samples lie on one line."""

    @property
    def samples(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
        """Places (n, 3) inside, (m, 3) outside of the region, and (k, 3) outside that it encloses, or None."""

    @property
    def viewpoint(self) -> NDArray[np.float64] | None:
        """The viewpoint, (3,), or None."""

    @property
    def rings(self) -> list[NDArray[np.float64]]:
        """Boundary rings, each (n, 3)."""

    @property
    def origin(self) -> NDArray[np.float64]:
        """A point of the plane, (3,)."""

    @property
    def axes(self) -> NDArray[np.float64]:
        """Rows: the plane's axes u and v and its normal, (3, 3)."""

    @property
    def outline(self) -> list[NDArray[np.float64]]:
        """Rings in plane coordinates, each (n, 2), outer ones counter-clockwise."""

    @property
    def area(self) -> float:
        """Area in plane coordinates."""

    @property
    def surface(self) -> tuple[NDArray[np.float64], NDArray[np.int64]] | None:
        """Vertices (v, 3) and triangles (k, 3) of a region that is not planar, else None."""

    @property
    def is_planar(self) -> bool:
        """Whether the region lies in one plane."""

@final
class Minimum:
    """Where a least squares ended: the pose `camera_from_world` and how it got there."""

    def __new__(
        cls,
        rotation: ArrayLike,
        translation: ArrayLike,
        cost: float,
        converged: bool,
        termination: str,
        evaluations: int,
    ) -> Minimum: ...
    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3)."""

    @property
    def translation(self) -> NDArray[np.float64]:
        """(3,)."""

    @property
    def cost(self) -> float:
        """Squared norm of the whitened residuals."""

    @property
    def converged(self) -> bool:
        """Whether a tolerance ended it."""

    @property
    def termination(self) -> str:
        """What ended it."""

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations."""

@final
class Solution:
    """A pose `camera_from_world` and how well its projected regions cover the observed ones."""

    @property
    def rotation(self) -> NDArray[np.float64]:
        """(3, 3)."""

    @property
    def quaternion(self) -> NDArray[np.float64]:
        """(4,), the same rotation as x, y, z, w."""

    @property
    def translation(self) -> NDArray[np.float64]:
        """(3,)."""

    @property
    def converged(self) -> bool:
        """Whether the least squares ended at a minimum; true where the pose was refined on the contours."""

    @property
    def termination(self) -> str:
        """What ended it."""

    @property
    def overlap_error(self) -> float:
        """The paper's delta of all regions together, a fraction."""

    @property
    def region_overlap_errors(self) -> NDArray[np.float64]:
        """The same, region by region, (k,)."""

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(6, 6) of the left increment `[omega (rad), tau]`."""

    @property
    def focal_shift(self) -> NDArray[np.float64]:
        """Derivative (6,) of the pose, a left increment, by the logarithm of the focal lengths; NaN where a direction
        is left free.
        """

    @property
    def confidence(self) -> float:
        """Probability that the true pose is within 5 degrees."""

    @property
    def mode_probability(self) -> float:
        """Posterior probability of this mode; nearby modes count separately."""

@final
class Estimate:
    """The pose of a camera, its fit, confidence and warnings."""

    @property
    def best(self) -> Solution:
        """The best pose."""

    @property
    def boundary_noise(self) -> float:
        """Standard deviation of the contour that the fit shows, pixels."""

    @property
    def outlier_fraction(self) -> float | None:
        """Fraction of the contour that is an outlier; None where the pose is that of the moments."""

    @property
    def probability(self) -> float:
        """Probability that one of the solutions is within 5 degrees of the true pose (P of docs/math.md, eq. 15.1)."""

    @property
    def log_odds(self) -> float:
        """Log odds that the best pose is the right mode (docs/math.md, eq. 15.3)."""

    @property
    def evidence(self) -> NDArray[np.float64]:
        """What they are computed from, (3,): regions that belong to the pose, the share of them that contradicts it,
        and the noise of the contours, pixels (docs/math.md, eq. 15.3).
        """

    @property
    def alternatives(self) -> list[Solution]:
        """The other poses that fit as well and that the prior leaves, best first."""

    @property
    def shared_edges(self) -> list[tuple[list[int], NDArray[np.float64]]]:
        """(regions, ends (2, 3)) of each edge that two regions share."""

    @property
    def warnings(self) -> list[_WarningParts]:
        """(code, regions, values by name) of each warning."""

    @property
    def evaluations(self) -> int:
        """Evaluations of the equations over all minima."""

    @property
    def pixel_angle(self) -> float:
        """Angle of a pixel where the regions are seen, radians: the root of its mean square over them."""

    @property
    def distance(self) -> float:
        """Median distance of the regions from the camera at the best pose."""

@final
class Prior:
    """A prior on a pose; `initial` as rotation (3, 3) and translation (3,)."""

    def __new__(
        cls,
        *,
        up: ArrayLike | None = None,
        up_sigma_deg: float | None = None,
        initial: tuple[ArrayLike, ArrayLike] | None = None,
        initial_rotation_sigma_deg: float | None = None,
        initial_center_sigma_m: float | None = None,
        camera_near: ArrayLike | None = None,
        camera_near_sigma_m: float | None = None,
    ) -> Prior: ...
    @property
    def camera_near_sigma_m(self) -> float | None:
        """Deviation of the camera's place, meters, the conventional one where none was given; None without a place."""

    def penalty(self, rotation: ArrayLike, translation: ArrayLike, covariance: ArrayLike) -> float:
        """Sum of the squared deviations from the terms of the prior, in standard deviations and each capped, of a pose
        with this covariance (6, 6) of its left increment.
        """

    def gaussian(self, rotation: ArrayLike, translation: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The prior as a Gaussian in information form of the left increment x from a pose, `exp(vector . x - x .
        information x / 2)`: information (6, 6) and vector (6,).
        """

@final
class Problem:
    """Pairs of image and world regions, ready to be solved."""

    def __new__(
        cls,
        observed: Sequence[ObservedRegion],
        worlds: Sequence[WorldRegion],
        *,
        system: Literal["plane", "sphere"],
        integration: Literal["boundary", "mesh", "pixels"],
        mesh_size: float | None = None,
    ) -> Problem: ...
    def search(
        self,
        *,
        start: Literal["global", "paper"] = "global",
        prior: Prior | None = None,
        refine: Literal["contour"] | None = "contour",
        frame_sigma: tuple[float, float, float, float] | None = None,
        limits: tuple[float, float] | None = None,
    ) -> Search:
        """The poses that may be the solution, and the equations to polish them by."""

    def evaluate(
        self, rotation: ArrayLike, translation: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """The paper's residuals (m,) at a pose, and their derivatives (m, 6) by a left increment; None out of view."""

    @property
    def work(self) -> int:
        """Cost of one evaluation of all of the problem, in units of `work_counter`."""

    def overlap_errors(self, rotation: ArrayLike, translation: ArrayLike) -> tuple[float, NDArray[np.float64]]:
        """Overlap error of all regions together at a pose, and of each (k,)."""

    def weak_geometry(
        self,
        rotation: ArrayLike,
        translation: ArrayLike,
        covariance: ArrayLike,
        *,
        limits: tuple[float, float] | None = None,
    ) -> _WarningParts | None:
        """The warning, as of `Estimate.warnings`, of a pose of this covariance (6, 6) where that exceeds `limits`,
        degrees and a fraction of the distance; else None.
        """

    def estimate(
        self,
        *,
        start: Literal["global", "paper"] = "global",
        prior: Prior | None = None,
        refine: Literal["contour"] | None = "contour",
        frame_sigma: tuple[float, float, float, float] | None = None,
        limits: tuple[float, float] | None = None,
    ) -> Estimate | None:
        """The estimate by the native driver; None without a pose in view."""

@final
class Search:
    """What a search found: candidates, and their equations on the scale of the boundary noise."""

    @property
    def candidates(self) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Poses (rotation (3, 3), translation (3,)) near which to solve the moments' equations, best first; none where
        the contours determine the pose.
        """

    def evaluate(
        self, rotation: ArrayLike, translation: ArrayLike, increment: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Residuals (m,) at a pose with a left increment (6,) applied, in pixels of boundary noise, and their
        derivatives (m, 6) by that increment; None out of view.
        """

    def distance(self, rotation: ArrayLike, translation: ArrayLike) -> float:
        """Distance from the camera to the middle of the regions."""

    def assess(self, minima: Sequence[Minimum]) -> Estimate | None:
        """The estimate, with the minima that a driver found from the candidates; None without a pose in view."""
