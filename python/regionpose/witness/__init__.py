"""The rest of a scene as witness of a pose: how well cloud and photo agree where no region is."""

from regionpose.witness.alignment import Alignment, check_alignment
from regionpose.witness.odds import weighed
from regionpose.witness.photo import Photo

__all__ = ["Alignment", "Photo", "check_alignment", "weighed"]
