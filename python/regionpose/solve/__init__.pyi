"""Public names and their homes."""

from .core_inputs import overlap_errors as overlap_errors
from .edge_diagnostics import Alignment as Alignment
from .edge_diagnostics import EdgeMode as EdgeMode
from .edge_diagnostics import FocalEvidence as FocalEvidence
from .edge_diagnostics import Occlusion as Occlusion
from .estimate import Alternative as Alternative
from .estimate import Diagnostics as Diagnostics
from .estimate import EdgeDiagnostics as EdgeDiagnostics
from .estimate import PoseSigma as PoseSigma
from .estimate import RegionsOnly as RegionsOnly
from .estimate import SharedEdge as SharedEdge
from .matching import RegionMatches as RegionMatches
from .rig_diagnostics import BetweenFrameSigma as BetweenFrameSigma
from .rig_diagnostics import CameraRefinement as CameraRefinement
from .rig_diagnostics import FrameFit as FrameFit
from .rig_diagnostics import LeaveOneOut as LeaveOneOut
from .rig_diagnostics import RigDiagnostics as RigDiagnostics

__all__: list[str]
