"""Point clouds and meshes in and out: files of many kinds, depth images, and a PLY writer that loses nothing."""

from __future__ import annotations

from regionpose.clouds.cloud import Cloud
from regionpose.clouds.depth import cloud_from_depth
from regionpose.clouds.errors import CloudError
from regionpose.clouds.kinds import read_cloud
from regionpose.clouds.ply_writer import write_ply
from regionpose.extras import MissingExtraError

__all__ = ["Cloud", "CloudError", "MissingExtraError", "cloud_from_depth", "read_cloud", "write_ply"]
