"""Public names and their homes."""

from .cloud import grow_plane as grow_plane
from .image import grow_image_region as grow_image_region
from .mesh_facets import regions_from_mesh as regions_from_mesh
from .planes import find_planes as find_planes
from .segmenters import PredictorSegmenter as PredictorSegmenter

__all__: list[str]
