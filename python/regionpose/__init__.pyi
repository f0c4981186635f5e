"""Absolute pose of a central camera from planar regions, without correspondences; the public names and their homes."""

from . import cameras as cameras
from . import datasets as datasets
from . import fusion as fusion
from . import io as io
from . import kernels as kernels
from . import regions as regions
from . import scene as scene
from . import segment as segment
from . import solve as solve
from .alignment.agreement import check_alignment as check_alignment
from .alignment.calibration import calibrate as calibrate
from .cameras import FisheyeCamera as FisheyeCamera
from .cameras import PinholeCamera as PinholeCamera
from .fusion.colors import colorize as colorize
from .geometry.pose import Pose as Pose
from .io.calibrations import load_camera as load_camera
from .io.clouds import Cloud as Cloud
from .io.clouds import read_cloud as read_cloud
from .regions.image import ImageRegion as ImageRegion
from .regions.world import WorldRegion as WorldRegion
from .scene.estimate import estimate_scene as estimate_scene
from .scene.loading import load_scene as load_scene
from .solve.batch import estimate_poses as estimate_poses
from .solve.estimate import PoseError as PoseError
from .solve.estimate import PoseEstimate as PoseEstimate
from .solve.frame import Frame as Frame
from .solve.matching import match_regions as match_regions
from .solve.options import Solver as Solver
from .solve.prior import Prior as Prior
from .solve.rig import estimate_rig as estimate_rig
from .solve.single import estimate_pose as estimate_pose
from .solve.status import PoseStatus as PoseStatus
from .solve.warning import PoseWarning as PoseWarning
from .solve.warning_code import WarningCode as WarningCode
from .viz.overlays import overlay_depth as overlay_depth
from .viz.overlays import overlay_regions as overlay_regions

__all__: list[str]
__version__: str
