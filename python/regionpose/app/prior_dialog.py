"""The page's dialog for the prior of the pose."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace

from nicegui import ui

from regionpose.app.elements import notify_error, toggle
from regionpose.app.prior_settings import AHEAD_SIGMA_DEG, NEAR_SIGMA_M, PriorSettings, Triple
from regionpose.app.shared_session import SharedSession
from regionpose.app.texts import PRIOR_QUESTION
from regionpose.solve.prior import MOUNT_SIGMA_M, UP_SIGMA_DEG

Answered = Callable[[PriorSettings], Awaitable[bool]]

ANY_DIRECTION = "any"

UPWARD: dict[str, Triple] = {
    "z": (0.0, 0.0, 1.0),
    "-z": (0.0, 0.0, -1.0),
    "y": (0.0, 1.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "x": (1.0, 0.0, 0.0),
    "-x": (-1.0, 0.0, 0.0),
}
"""Directions of a cloud's frame that may be up, by what the page calls them."""


class PriorDialog:
    """A button that shows the prior of the pose, and its dialog."""

    def __init__(self, shared: SharedSession, answered: Answered) -> None:
        """Build the button and the dialog; `answered` gets the settings and returns whether they were accepted."""
        self._shared, self._answered = shared, answered
        self._button = ui.button(icon="explore", on_click=self._ask).props("flat dense no-caps size=12.5px")
        self._button.tooltip("The prior of the pose: place, viewing direction, up").mark("prior")
        with ui.dialog() as self._dialog, ui.card().style("max-width:560px;padding:20px 26px"):
            ui.html(PRIOR_QUESTION, sanitize=False)
            self._near = _Vector("The camera stands near", "m", "within, m")
            self._anywhere = ui.checkbox("or anywhere, also far from the scanner").props("dense")
            self._ahead = _Vector("It looks along", "", "to, degrees")
            self._up = _Vector("Up in the photo is", "", "to, degrees")
            with ui.row().style("gap:12px;margin-top:12px"):
                ui.button("Use it", on_click=self._use).props("unelevated dense no-caps").mark("use-prior")
                ui.button("No prior", on_click=self._forget).props("flat dense no-caps")
                ui.button("Leave it", on_click=self._dialog.close).props("flat dense no-caps")
        self.show()

    def show(self) -> None:
        """Show the prior on the button."""
        text = self._shared.session.prior_settings.text
        self._button.set_text(f"Prior: {text}" if text else "Prior …")
        self._button.props(f"color={'blue-8' if text else 'grey-8'}")

    def _ask(self) -> None:
        settings, scanner = self._shared.session.prior_settings, self._shared.session.scanner
        place = None if scanner is None else (float(scanner[0]), float(scanner[1]), float(scanner[2]))
        usual_m = MOUNT_SIGMA_M if self._shared.session.searches_edges else NEAR_SIGMA_M
        self._near.set(settings.near or place, settings.near_sigma_m or usual_m)
        self._anywhere.set_value(settings.is_anywhere)
        self._ahead.set(settings.ahead, settings.ahead_sigma_deg or AHEAD_SIGMA_DEG)
        self._up.set(settings.up, settings.up_sigma_deg or 15.0)
        self._dialog.open()

    async def _use(self) -> None:
        scanner = self._shared.session.scanner
        try:
            near, ahead, up = (vector.value for vector in (self._near, self._ahead, self._up))
        except ValueError as error:
            notify_error(str(error))
            return
        at_scanner = near is not None and scanner is not None and near == tuple(scanner.tolist())
        settings = PriorSettings(
            near=None if at_scanner else near,
            near_sigma_m=self._near.sigma if near is not None else None,
            is_anywhere=bool(self._anywhere.value),
            ahead=ahead,
            ahead_sigma_deg=self._ahead.sigma if ahead is not None else None,
            up=up,
            up_sigma_deg=self._up.sigma if up is not None else None,
        )
        if await self._answered(settings):  # A refused prior stays open for correction.
            self._dialog.close()

    async def _forget(self) -> None:
        self._dialog.close()
        await self._answered(PriorSettings())


class UpChoice:
    """A row of buttons for the up direction in the cloud's frame, where the pose comes from edges."""

    def __init__(self, shared: SharedSession, answered: Answered) -> None:
        """Build the row; `answered` as of `PriorDialog`."""
        self._shared, self._answered = shared, answered
        with ui.element("div").classes("rp-up") as self._row:
            ui.label("The camera is upright; up in the cloud is")
            options = {name: name for name in (ANY_DIRECTION, *UPWARD)}
            self._choice = toggle(options, self._chosen, self._choose).mark("up")
            self._choice.tooltip(f"To some {UP_SIGMA_DEG:g} degrees: far fewer poses are searched")
        self.show()

    @property
    def _chosen(self) -> str | None:
        """The button of the current up direction; None for another direction."""
        up = self._shared.session.prior_settings.up
        return ANY_DIRECTION if up is None else next((name for name, axis in UPWARD.items() if axis == up), None)

    def show(self) -> None:
        """Show the current settings."""
        self._row.set_visibility(self._shared.session.searches_edges)
        self._choice.set_value(self._chosen)

    async def _choose(self) -> None:
        name = self._choice.value
        if name is None or name == self._chosen:
            return
        up = UPWARD.get(name)
        sigma_deg = None if up is None else UP_SIGMA_DEG
        await self._answered(replace(self._shared.session.prior_settings, up=up, up_sigma_deg=sigma_deg))


class _Vector:
    """Three numbers and their standard deviation."""

    def __init__(self, title: str, unit: str, within: str) -> None:
        ui.label(title).classes("rp-title").style("margin-top:8px")
        with ui.row().style("gap:14px"):
            suffix = f"suffix={unit}" if unit else ""
            self._numbers = [ui.number(axis).props(f"dense {suffix}").style("width:92px") for axis in "xyz"]
            self._sigma = ui.number(within).props("dense").style("width:110px")
        self._title = title

    def set(self, values: Triple | None, sigma: float) -> None:
        for number, value in zip(self._numbers, [None] * 3 if values is None else values, strict=True):
            number.set_value(None if value is None else round(value, 6))
        self._sigma.set_value(sigma)

    @property
    def value(self) -> Triple | None:
        given = [number.value for number in self._numbers]
        if all(value is None for value in given):
            return None
        if any(value is None for value in given):
            raise ValueError(f"{self._title}: needed three numbers, or none")
        x, y, z = (float(value) for value in given if value is not None)
        return x, y, z

    @property
    def sigma(self) -> float | None:
        return None if self._sigma.value is None else float(self._sigma.value)
