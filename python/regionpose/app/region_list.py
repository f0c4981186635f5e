"""The page's list of regions: names, both sides with their other proposals, how each fits, and what can be done."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from nicegui import ui

from regionpose.app.elements import small_button
from regionpose.app.parts import Picked
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession, color_of
from regionpose.app.texts import EDGES_ENOUGH, EMPTY_LIST
from regionpose.scene.fit import Fit

MASK_TO_POLYGON_PX = 1.0
"""Pixels that a polygon made of a mask may differ from its contour."""

Edit = Callable[[Callable[[Session], object]], Awaitable[object]]
Choose = Callable[[int, str, int], Awaitable[None]]


@dataclass(frozen=True)
class Row:
    """The parts of a region's row that change without it."""

    whole: ui.element
    fit: ui.label
    measure: ui.label

    def show(self, *, selected: bool, fit: Fit | None) -> None:
        """Mark whether it is selected, and show how its region fits."""
        self.whole.classes(add="rp-on" if selected else "", remove="" if selected else "rp-on")
        self.fit.set_text("" if fit is None else fit.value)
        self.measure.set_text("" if fit is None else fit.short_measure)


class RegionList:
    """The list. Its rows are rebuilt only where regions change, so that a name that is being typed stays."""

    def __init__(self, shared: SharedSession, edit: Edit, choose: Choose) -> None:
        """Build an empty list; `edit` changes the session, `choose` takes another proposal of a region's side."""
        self._shared, self._edit, self._choose = shared, edit, choose
        self._built: object = None
        self._rows: dict[int, Row] = {}
        self._box = ui.element("div")

    def show(self, *, rebuild: bool = False) -> None:
        """Show the session's regions; `rebuild`: also where they have not changed, after a refused edit."""
        session = self._shared.session
        built = [
            (picked.key, picked.name, picked.image and picked.image.chosen, picked.world and picked.world.chosen)
            for picked in session.regions
        ]
        if rebuild or built != self._built:
            self._built = built
            self._build(session.regions)
        fits, selected = self._shared.outcome.fits, session.sketch.selected
        for picked in session.regions:
            fit = fits.get(picked.key) if picked.is_paired else None
            self._rows[picked.key].show(selected=picked.key == selected, fit=fit)

    def _build(self, regions: tuple[Picked, ...]) -> None:
        self._box.clear()
        self._rows = {}
        with self._box:
            if not regions:
                ui.html(EDGES_ENOUGH * self._shared.session.searches_edges + EMPTY_LIST, sanitize=False)
                return
            with ui.element("div").classes("rp-row rp-rows-head"):
                for title in ("", "Name", "Photo", "Cloud", "Fit", ""):
                    ui.label(title).classes("rp-number" if title == "Fit" else "")
            for picked in regions:
                self._rows[picked.key] = self._row(picked)

    def _row(self, picked: Picked) -> Row:
        key = picked.key
        row = ui.element("div").classes("rp-row")
        # A click into the name goes on to the row: it selects, and the cursor stands there.
        row.on("click", lambda: self._edit(lambda session: session.select(key)))
        with row:
            ui.element("div").classes("rp-dot").style(f"background:{color_of(key)}")
            name = ui.input(value=picked.name).props("dense borderless").classes("rp-name")
            name.on("change", lambda: self._edit(lambda session: session.rename(key, name.value)))
            self._photo_side(picked)
            self._cloud_side(picked)
            with ui.element("div").classes("rp-side rp-number"):
                fit, measure = ui.label(), ui.label().classes("rp-soft")
            with ui.element("div").classes("rp-tools"):
                self._tools(picked)
        return Row(row, fit, measure)

    def _photo_side(self, picked: Picked) -> None:
        with ui.element("div").classes("rp-side"):
            if picked.image is None:
                ui.label("click it in the photo").classes("rp-none")
                return
            part = picked.image.chosen
            with ui.element("div").classes("rp-stops"):
                ui.label("polygon" if part.is_polygon else "mask")
                self._stops(picked.key, "image", len(picked.image), picked.image.index)
            ui.label(f"{part.region.area:,.0f} px").classes("rp-soft")

    def _cloud_side(self, picked: Picked) -> None:
        with ui.element("div").classes("rp-side"):
            if picked.world is None:
                ui.label("click it in the cloud").classes("rp-none")
                return
            side = picked.world.chosen.side
            with ui.element("div").classes("rp-stops"):
                count = "outline" if side.indices is None else f"{len(side.indices):,} points"
                ui.label(count)
                self._stops(picked.key, "world", len(picked.world), picked.world.index)
            ui.label(picked.world.chosen.label or f"{side.region.area:.2f} m²").classes("rp-soft")

    def _stops(self, key: int, side: str, count: int, index: int) -> None:
        if count > 1:
            slider = ui.slider(min=0, max=count - 1, value=index).props("snap markers dense")
            slider.on("change", lambda e: self._choose(key, side, int(e.args)), js_handler="(v) => emit(v)")
            slider.on("click.stop").tooltip("from small to large")

    def _tools(self, picked: Picked) -> None:
        key = picked.key
        if picked.image is not None and not picked.image.chosen.is_polygon:
            small_button(
                "polyline",
                "Make the mask a polygon, to move its vertices",
                lambda: self._edit(lambda session: session.as_polygon(key, MASK_TO_POLYGON_PX)),
                stop=True,
            )
        if picked.is_paired:
            small_button(
                "link_off",
                "Unpair: two regions of one",
                lambda: self._edit(lambda session: session.unpair(key)),
                stop=True,
            )
        else:
            self._pair_menu(picked)
        small_button(
            "delete_outline", "Remove (Delete)", lambda: self._edit(lambda session: session.remove(key)), stop=True
        )

    def _pair_menu(self, picked: Picked) -> None:
        regions = self._shared.session.regions
        partners = [o for o in regions if not o.is_paired and (o.image is None) != (picked.image is None)]
        if not partners:
            return
        with small_button("link", "Pair with …", None, stop=True), ui.menu():
            for partner in partners:
                ui.menu_item(partner.name, lambda key=partner.key: self._edit(lambda s: s.pair(picked.key, key)))
