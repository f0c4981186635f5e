"""The page's question where the scanner stood."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui

from regionpose.app.elements import notify_error
from regionpose.app.shared_session import SharedSession
from regionpose.app.texts import SCANNER_QUESTION, scanner_text

Answered = Callable[[list[float] | None], Awaitable[None]]


class ScannerDialog:
    """A button that shows where the scanner stood, and its dialog: opened by itself where no place is given,
    before regions rest on it.
    """

    def __init__(self, shared: SharedSession, answered: Answered) -> None:
        """Build the button and the dialog; `answered` gets the place, or None for scans of several places."""
        self._shared, self._answered = shared, answered
        self._button = ui.button(icon="sensors", on_click=self._ask).props("flat dense no-caps size=12.5px")
        self._button.tooltip("Where the scanner stood, in the cloud's frame").mark("scanner")
        with ui.dialog() as self._dialog, ui.card().style("max-width:520px;padding:20px 26px"):
            ui.html(SCANNER_QUESTION, sanitize=False)
            with ui.row().style("gap:16px"):
                self._numbers = [ui.number(axis, suffix="m").props("dense").style("width:110px") for axis in "xyz"]
            with ui.row().style("gap:12px;margin-top:12px"):
                ui.button("There", on_click=self._there).props("unelevated dense no-caps").mark("there")
                ui.button("At several places", on_click=self._several).props("flat dense no-caps")
                ui.button("I don't know", on_click=self._dialog.close).props("flat dense no-caps")
        self._has_asked = False
        self.show()

    def show(self) -> None:
        """Show the scanner's place on the button."""
        session = self._shared.session
        self._button.set_text(scanner_text(session.scanner, session.lacks_scanner))
        self._button.props(f"color={'orange-9' if session.lacks_scanner else 'grey-8'}")
        # The pose by edges assumes the cloud's zero, and reports that.
        if session.lacks_scanner and not self._has_asked and (session.regions or not session.searches_edges):
            self._has_asked = True
            self._ask()

    def _ask(self) -> None:
        session = self._shared.session
        place = self._shared.proposal if session.scanner is None else session.scanner
        for number, value in zip(self._numbers, [None] * 3 if place is None else place.tolist(), strict=True):
            number.set_value(value)
        self._dialog.open()

    async def _there(self) -> None:
        values = [number.value for number in self._numbers]
        if any(value is None for value in values):
            notify_error("needed three numbers, meters")
            return
        self._dialog.close()
        await self._answered([float(value) for value in values])

    async def _several(self) -> None:
        self._dialog.close()
        await self._answered(None)
