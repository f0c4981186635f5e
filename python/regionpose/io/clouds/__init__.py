"""Point clouds and meshes in and out: files of many kinds, depth images, and a PLY writer that loses nothing."""

from __future__ import annotations

from regionpose.io.clouds.cloud import Cloud
from regionpose.io.clouds.depth import cloud_from_depth
from regionpose.io.clouds.errors import CloudError
from regionpose.io.clouds.kinds import read_cloud
from regionpose.io.clouds.ply_writer import write_ply
from regionpose.validation.extras import MissingExtraError

__all__ = ["Cloud", "CloudError", "MissingExtraError", "cloud_from_depth", "read_cloud", "write_ply"]
