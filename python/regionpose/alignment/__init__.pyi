"""Public names and their homes."""

from .agreement import Alignment as Alignment
from .focal import FocalEvidence as FocalEvidence
from .pose_search import EdgeMode as EdgeMode
from .visibility import Occlusion as Occlusion

__all__: list[str]
