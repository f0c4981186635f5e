"""Public names and their homes."""

from .between_frame_sigma import BetweenFrameSigma as BetweenFrameSigma
from .core_inputs import overlap_errors as overlap_errors
from .estimate import Alternative as Alternative
from .estimate import SharedEdge as SharedEdge
from .intrinsics import CameraRefinement as CameraRefinement
from .matching import RegionMatches as RegionMatches
from .rig import FrameFit as FrameFit
from .rig import LeaveOneOut as LeaveOneOut

__all__: list[str]
