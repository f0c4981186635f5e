"""Public names and their homes."""

from .demo import DemoRegion as DemoRegion
from .demo import DemoScene as DemoScene
from .demo import demo_folder as demo_folder
from .demo import load_demo as load_demo

__all__: list[str]
