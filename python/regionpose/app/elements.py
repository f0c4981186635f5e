"""The page's own elements: a picture to click on, a cloud to turn, small buttons, and messages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from nicegui import ui
from nicegui.element import Element

TOASTS: Final = "bottom-left"
"""Where messages appear: over the end of the list of regions, and no tool."""


class PictureView(Element, component="picture_view.js"):
    """A picture with outlines over it, for clicks, polygons and their vertices.

    Events: `pick` {x, y, again}, `polygon` {ring, hidden}, `rings` {key, rings, hidden}; pixels, an integer a pixel's
    center. `choose` {key}: a click on a region's name. `over`: a picture drawn over it with `opacity`, 0 to 1; none
    where it is empty.
    """

    def __init__(self, size: tuple[int, int], *, least: float = 0.0) -> None:
        """An empty view of a picture of `size` (width, height) that fills at least a fraction of the view's height."""
        super().__init__()
        width, height = size
        self._props.update(
            src="", width=width, height=height, shapes=[], projected=[], mode="click", loupe=True, busy="", least=least
        )
        self._props.update(over="", opacity=1.0)
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


def small_button(icon: str, title: str, action: Callable[[], Any] | None, *, stop: bool = False) -> ui.button:
    """A small button with an icon; `stop`: a click on it is not one on what is around it."""
    button = ui.button(icon=icon).props("flat dense round size=sm color=grey-8").tooltip(title)
    if action is not None:
        button.on("click.stop" if stop else "click", action)
    elif stop:
        button.on("click.stop")
    return button


def toggle(options: dict[Any, str], value: object, action: Callable[[], Any]) -> ui.toggle:
    """Buttons of which one is chosen; `options`: what each value is called."""
    buttons = ui.toggle(options, value=value, on_change=action)
    return buttons.props("dense unelevated no-caps size=12.5px color=grey-2 text-color=grey-8 toggle-color=blue-7")


def notify(message: str) -> None:
    """Notify the user of what is done."""
    ui.notify(message, type="positive", position=TOASTS)


def notify_error(message: str) -> None:
    """Show an error message, long enough to be read."""
    ui.notify(message, type="negative", position=TOASTS, multi_line=True, timeout=7000, close_button="OK")
