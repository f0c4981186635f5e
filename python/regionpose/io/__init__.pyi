"""Public names and their homes."""

from .calibrations.poses import read_pose as read_pose
from .calibrations.text import CalibrationError as CalibrationError
from .clouds.depth import cloud_from_depth as cloud_from_depth
from .clouds.errors import CloudError as CloudError
from .clouds.ply_writer import write_ply as write_ply
from .exports.writing import write_pose as write_pose
from .masks.readers import mask_from_file as mask_from_file
from .masks.readers import masks_from_file as masks_from_file
from .masks.readers import masks_from_segmenter as masks_from_segmenter
from .masks.readers import region_from_file as region_from_file
from .masks.readers import regions_from_file as regions_from_file
from .reading import FileError as FileError

__all__: list[str]
