"""Public names and their homes."""

from .confirmed import ConfirmedRegion as ConfirmedRegion
from .confirmed import ConfirmedRegions as ConfirmedRegions
from .confirmed import confirmed_regions as confirmed_regions
from .document import SceneError as SceneError
from .input_checks import check_camera as check_camera
from .input_checks import check_regions as check_regions
from .loading import Scene as Scene

__all__: list[str]
