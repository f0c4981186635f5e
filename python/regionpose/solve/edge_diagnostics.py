"""The evidence of the edges of photos and clouds for a pose, as `regionpose.alignment` finds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionpose.geometry.pose import Pose
from regionpose.validation.arrays import KeptArrays

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class EdgeMode(KeptArrays):
    """A maximum of the posterior of the pose by edges.

    Parameters
    ----------
    pose : Pose
        `camera_from_world`.
    covariance : (6, 6) array
        Of its left increment, rad and meters, by the edges' noise alone.
    log_mass : float
        Logarithm of the integral of the posterior about it, where that of the prior is 1: the log odds that photo and
        cloud agree there rather than by chance anywhere.
    log_ratio : float
        Logarithm of the likelihood ratio at the maximum itself.
    edges : int
        How many edges of the cloud the photo shows there, of all frames.
    """

    pose: Pose
    covariance: Array
    log_mass: float
    log_ratio: float
    edges: int

    def __repr__(self) -> str:
        """The pose and how likely it is."""
        return f"EdgeMode({self.pose!r}, log_mass={self.log_mass:.1f}, edges={self.edges})"


@dataclass(frozen=True)
class Occlusion:
    """How much of a region the cloud hides at a pose, of the part that the photo shows.

    Parameters
    ----------
    hidden_fraction : float
        Of that part's area, 0 to 1; NaN where the projected region lies beside the observed one.
    distance_m : float
        From the camera to what hides it, meters, the median; NaN where nothing does.
    region_distance_m : float
        From the camera to the middle of that part, meters; NaN where there is none.
    is_hidden : bool
        Whether most of it is hidden, which contradicts the photo.
    """

    hidden_fraction: float
    distance_m: float
    region_distance_m: float
    is_hidden: bool


@dataclass(frozen=True, eq=False, repr=False)
class Alignment(KeptArrays):
    """How well photo and cloud agree at a pose (docs/math.md, section 18).

    Parameters
    ----------
    places : (n, 2) array
        Pixels of the photo where the cloud's edges, of depth and of intensity, project at the pose.
    agrees : (n,) array of bool
        Whether the photo more likely than not shows an edge there.
    edge_log_odds : float
        Logarithm of the odds that edges agree at a pose within half a degree and 10 cm (1 sigma) of this one, rather
        than by chance; 0 where none are in view.
    log_odds : float
        The same with what the cloud hides: lowered by log 9 where it hides a region.
    nearest : Pose
        The likeliest of these poses; the pose itself where none is likelier than chance.
    occlusions : tuple of Occlusion
        How much of each region the cloud hides; empty where no regions of the world were given.
    """

    places: Array
    agrees: NDArray[np.bool_]
    edge_log_odds: float
    log_odds: float
    nearest: Pose
    occlusions: tuple[Occlusion, ...] = ()

    @property
    def edge_fraction(self) -> float:
        """Fraction of the cloud's edges in view that lie on edges of the photo; NaN without any."""
        return float(np.mean(self.agrees)) if len(self.agrees) else float("nan")

    def __repr__(self) -> str:
        """The number of edges, how many of them agree, and the log odds."""
        hidden = f", hidden={sum(each.is_hidden for each in self.occlusions)}" if self.occlusions else ""
        odds = f"edge_fraction={self.edge_fraction:.2f}, log_odds={self.log_odds:.2f}"
        return f"Alignment(edges={len(self.places)}, {odds}{hidden})"


@dataclass(frozen=True, eq=False, repr=False)
class FocalEvidence(KeptArrays):
    """The evidence of the edges of photos and clouds for the focal lengths.

    Parameters
    ----------
    log_odds : float
        Logarithm of the odds that they are the given ones, against others.
    factor : float
        By which the given ones are multiplied where photo and cloud agree best.
    shift : (6,) array
        Left increment of the pose, rad and meters, if they are a percent longer, to first order.
    """

    log_odds: float
    factor: float
    shift: Array

    @property
    def shift_m(self) -> float:
        """How far a percent moves the camera center, meters."""
        return float(np.linalg.norm(self.shift[3:]))

    def __repr__(self) -> str:
        """The log odds, the likeliest factor, and how far a percent moves the camera."""
        values = f"log_odds={self.log_odds:.1f}, factor={self.factor:.3f}, shift_m={self.shift_m:.4f}"
        return f"FocalEvidence({values})"
