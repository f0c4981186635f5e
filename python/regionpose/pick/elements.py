"""The page's own two elements: a picture to click on and a cloud to turn."""

from __future__ import annotations

from typing import Any

from nicegui.element import Element


class PictureView(Element, component="picture_view.js"):
    """A picture with outlines over it, for clicks, polygons and their vertices.

    Events: `pick` {x, y, again}, `polygon` {ring, hidden}, `rings` {key, rings, hidden}; pixels, an integer a pixel's
    center.
    """

    def __init__(self, size: tuple[int, int], *, least: float = 0.0) -> None:
        """An empty view of a picture of `size` (width, height) that fills at least a share of the view's height."""
        super().__init__()
        width, height = size
        self._props.update(
            src="", width=width, height=height, shapes=[], projected=[], mode="click", loupe=True, busy="", least=least
        )
        self._props["show-projected"] = True
        self._props["show-outlines"] = True

    def show(self, **props: Any) -> None:
        """Set what the view shows; keys as its component's props."""
        changed = {key.replace("_", "-"): value for key, value in props.items()}
        if any(self._props.get(key) != value for key, value in changed.items()):
            self._props.update(changed)
            self.update()


class CloudView(Element, component="cloud_view.js"):
    """Points in 3D with outlines. Event: `pick` {origin, direction, again}, about the points' own zero."""

    def __init__(self, *, eye: list[float], zenith: list[float], reach: float) -> None:
        """A view from `eye`, meters, of points within `reach` of zero; `zenith`: the direction up."""
        super().__init__()
        self._props.update(
            points="files/points.bin", colors="", shapes=[], eye=eye, zenith=zenith, reach=reach, busy=""
        )

    def show(self, **props: Any) -> None:
        """Set what the view shows."""
        if any(self._props.get(key) != value for key, value in props.items()):
            self._props.update(props)
            self.update()
