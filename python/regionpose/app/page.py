"""The page itself: NiceGUI elements that show a shared session and pass on what is done to them."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import run, ui
from nicegui.events import KeyEventArguments

from regionpose.app.elements import CloudView, PictureView, notify, notify_error, small_button, toggle
from regionpose.app.frames import Frames, FrameSession
from regionpose.app.parts import Picked
from regionpose.app.prior_dialog import PriorDialog, UpChoice
from regionpose.app.prior_settings import PriorSettings
from regionpose.app.region_list import RegionList
from regionpose.app.scanner_dialog import ScannerDialog
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.app.texts import HELP, cloud_hint, outcome_html, photo_hint

REFRESH_S = 0.12
"""Seconds between looks at whether the shared session has changed: other pages and the estimate do so on their own."""

STRIP_FRACTION = 0.45
"""Fraction of the view's height that the range image takes at least: that of a lidar is a long strip."""

OPACITY = 0.7
"""Of the cloud over the photo at first: both are seen."""

POSES = ("Likeliest", "Runner-up")
"""What the poses are called at which the cloud is drawn over the photo."""

STYLE = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")
MODES = {"click": "Click", "polygon": "Polygon", "hide": "Hidden edges"}
CLOUD_MODES = {"click": "Click", "cut": "Cut out"}


class Page:
    """One open page. Its own: tool, view and what it has shown; everything else is the shared session's."""

    def __init__(self, shared: SharedSession) -> None:
        """Build the page."""
        self.shared, self.revision_drawn, self.mode, self._built_for = shared, -1, "click", shared.session
        ui.add_css(STYLE)
        ui.page_title(f"{shared.session.path.name} · regionpose pick")
        with ui.element("div").classes("rp"):
            self._bar()
            self._photo()
            self._cloud()
            self._list()
            self._pose()
        ui.keyboard(on_key=self._key)
        ui.timer(REFRESH_S, self._refresh)

    @property
    def session(self) -> Session:
        """The shared session."""
        return self.shared.session

    @property
    def selected(self) -> Picked | None:
        """The region that is worked on."""
        key = self.session.sketch.selected
        return None if key is None else self.session.sketch.region(key)

    def _bar(self) -> None:
        with ui.element("div").classes("rp-bar"):
            ui.html('<span class="rp-brand">regionpose</span>', sanitize=False)
            self.file = ui.html("", sanitize=False).classes("rp-file")
            if isinstance(self.session, FrameSession):
                self._frame_buttons(self.session.frames)
            ui.element("div").classes("rp-grow")
            self.undo = small_button("undo", "Undo (Ctrl Z)", lambda: self._edit(Session.undo))
            self.redo = small_button("redo", "Redo (Ctrl Y)", lambda: self._edit(Session.redo))
            with ui.dialog() as help_page, ui.card().style("max-width:720px;padding:20px 26px"):
                ui.html(HELP, sanitize=False)
            small_button("help_outline", "Help", help_page.open)
            self.save = ui.button("Save", icon="save", on_click=self._save).props("unelevated dense no-caps")
            self.save.tooltip("Save the scene file and its masks (Ctrl S)").mark("save")

    def _frame_buttons(self, frames: Frames) -> None:
        """The frame that is shown, and the way to the one before and after."""
        small_button("chevron_left", "The frame before (Page Up)", lambda: self._turn(-1)).mark("before")
        name = f"{frames.index + 1} of {len(frames)}: {frames.names[frames.index]}"
        ui.label(name).classes("rp-file").mark("frame")
        small_button("chevron_right", "The next frame (Page Down)", lambda: self._turn(1)).mark("next")

    async def _turn(self, step: int) -> None:
        """Go to another frame."""
        session = self.session
        if not isinstance(session, FrameSession) or not 0 <= session.frames.index + step < len(session.frames):
            return
        self.photo.show(busy="reading the frame …")
        try:
            other = await run.io_bound(session.frames.session_at, session.frames.index + step)
            if other is not None:
                await run.io_bound(self.shared.show_session, other)
        except (ValueError, OSError) as error:
            notify_error(str(error))
        self.photo.show(busy="")
        self._refresh()

    def _photo(self) -> None:
        height, width = self.session.image.shape[:2]
        with ui.element("div").classes("rp-card"):
            with ui.element("div").classes("rp-head"):
                ui.html('<span class="rp-title">Photo</span>', sanitize=False)
                self.modes = toggle(MODES, "click", self._choose_mode)
                ui.element("div").classes("rp-grow")
                hint = "Draw the cloud by its distance at the pose (D)"
                self.depth = _switch("Depth", hint, self._show_depth, on=self.shared.shows_depth).mark("depth")
                self.outlines = _switch("Projected", "Show the outlines that the pose projects (O)", self._show_photo)
                self.loupe = _switch("Loupe", "Show a loupe beside the pointer", self._show_photo)
            with ui.element("div").classes("rp-view"):
                self.photo = PictureView((width, height))
                self.photo.on("pick", lambda e: self._click_photo(e.args))
                self.photo.on("polygon", lambda e: self._drawn(e.args))
                self.photo.on("rings", lambda e: self._moved(e.args))
                self.photo.on("choose", lambda e: self._select(e.args))
                self._depth_tools()
            self.photo_hint = ui.html("", sanitize=False).classes("rp-hint")

    def _depth_tools(self) -> None:
        """How the cloud over the photo is shown: how opaque, and at which pose."""
        with ui.element("div").classes("rp-depth") as self.depth_tools:
            ui.label("Opacity")
            self.opacity = ui.slider(min=0.0, max=1.0, step=0.05, value=OPACITY, on_change=self._show_photo)
            self.opacity.props("dense dark").mark("opacity")
            options = dict(enumerate(POSES))
            self.at = toggle(options, 0, self._show_photo).mark("runner-up")
            self.at.tooltip("Where the cloud is drawn: at the pose, or at the next likeliest one (R)")

    def _cloud(self) -> None:
        shared = self.shared
        reach = float(np.percentile(np.linalg.norm(shared.cloud.local_points - shared.middle, axis=1), 90))
        up, ahead = shared.range_view.axes.up, shared.range_view.axes.ahead
        eye = -1.3 * reach * ahead + 0.9 * reach * up
        with ui.element("div").classes("rp-card"):
            with ui.element("div").classes("rp-head"):
                ui.html('<span class="rp-title">Cloud</span>', sanitize=False)
                self.cloud_modes = toggle(CLOUD_MODES, "click", self._choose_cloud_mode)
                self.tabs = toggle({"range": "Range image", "solid": "3D"}, "range", self._choose_tab)
                ui.element("div").classes("rp-grow")
                self.scanner = ScannerDialog(shared, self._set_scanner)
                self.coloring = toggle(shared.colorings, shared.coloring, self._color)
            with ui.element("div").classes("rp-view"):
                self.range = PictureView(shared.range_view.size, least=STRIP_FRACTION)
                self.range.on("pick", lambda e: self._click_range(e.args))
                self.range.on("polygon", lambda e: self._cut(e.args))
                self.range.on("choose", lambda e: self._select(e.args))
                self.solid = CloudView(eye=eye.tolist(), zenith=up.tolist(), reach=reach)
                self.solid.on("pick", lambda e: self._click_solid(e.args))
                self.solid.set_visibility(False)
            self.cloud_hint = ui.html("", sanitize=False).classes("rp-hint")

    def _list(self) -> None:
        with ui.element("div").classes("rp-card"):
            with ui.element("div").classes("rp-head"):
                ui.html('<span class="rp-title">Regions</span>', sanitize=False)
                self.count = ui.html("", sanitize=False).classes("rp-file")
                ui.element("div").classes("rp-grow")
                self.new = ui.button("New region", icon="add", on_click=self._new).props("flat dense no-caps")
                self.new.tooltip("The next click begins a new region (N)")
            with ui.element("div").classes("rp-scroll"):
                self.rows = RegionList(self.shared, self._edit, self._choose)

    def _pose(self) -> None:
        with ui.element("div").classes("rp-card"):
            with ui.element("div").classes("rp-head"):
                ui.html('<span class="rp-title">Pose</span>', sanitize=False)
                ui.element("div").classes("rp-grow")
                self.prior = PriorDialog(self.shared, self._set_prior_settings)
                self.stage = ui.label().classes("rp-stage").mark("stage")
                self.stop = ui.button("Stop", icon="stop", on_click=self.shared.stop).props("flat dense no-caps")
                self.stop.tooltip("Wait no longer: a pose of the regions alone stays (Esc)")
                self.again = ui.button("Estimate", icon="play_arrow", on_click=self.shared.estimate_again)
                self.again.props("flat dense no-caps").tooltip("Go on with what was stopped")
            self.upright = UpChoice(self.shared, self._set_prior_settings)
            with ui.element("div").classes("rp-scroll"):
                self.verdict = ui.html("", sanitize=False).classes("rp-pose").mark("verdict")

    def _refresh(self) -> None:
        """Show what has changed since the last look."""
        if self.shared.session is not self._built_for:
            ui.navigate.reload()  # Another frame: photo and cloud are of another size.
            return
        stage = self.shared.stage
        self.stage.set_text(stage)
        self.stop.set_visibility(bool(stage))
        self.again.set_visibility(not stage and self.shared.outcome.state == "stopped")
        stamp = self.shared.revision
        if stamp == self.revision_drawn:
            return
        self.revision_drawn = stamp
        session = self.session
        edited = " · not saved" if session.can_save else ""
        self.file.set_content(f"<b>{escape(session.path.name)}</b>{edited}")
        self.undo.set_enabled(session.can_undo)
        self.redo.set_enabled(session.can_redo)
        self.save.set_enabled(session.can_save)
        self.scanner.show()
        self.prior.show()
        self.upright.show()
        self.depth.set_value(self.shared.shows_depth)
        self.coloring.set_options(self.shared.colorings, value=self.shared.coloring)
        self._show_photo()
        self._show_cloud()
        self._show_rows()
        self.verdict.set_content(outcome_html(self.shared.outcome))

    def _show_photo(self) -> None:
        projected = self.shared.projected_shapes()
        self.photo.show(src="files/photo.jpg", shapes=self.shared.photo_shapes(), projected=projected, mode=self.mode)
        self._show_over()
        self.photo.show(show_projected=self.outlines.value, loupe=self.loupe.value)
        self.range.show(loupe=self.loupe.value)
        self.photo_hint.set_content(photo_hint(self.selected, self.mode))

    def _show_over(self) -> None:
        """The cloud over the photo, where there is a pose."""
        files = self.shared.depth_files
        at = int(self.at.value or 0) if len(files) > 1 else 0
        self.depth_tools.set_visibility(bool(files))
        self.at.set_visibility(len(files) > 1)
        self.photo.show(over=files[at] if files else "", opacity=float(self.opacity.value))

    def _show_cloud(self) -> None:
        stamp = f"?{self.shared.pictured}"
        width, height = self.shared.range_view.size
        self.range.show(src=f"files/range.jpg{stamp}", shapes=self.shared.range_shapes(), width=width, height=height)
        self.solid.show(colors=f"files/colors.bin{stamp}", shapes=self.shared.solid_shapes())
        self.cloud_hint.set_content(cloud_hint(self.selected, self.cloud_modes.value == "cut"))

    def _show_rows(self, *, rebuild: bool = False) -> None:
        regions, pairs = self.session.regions, len(self.session.pairs)
        self.count.set_content(f"{pairs} of {len(regions)} paired" if regions else "")
        self.rows.show(rebuild=rebuild)

    async def _click_photo(self, args: dict[str, Any]) -> None:
        again, pixel = bool(args.get("again")), _numbers(args, "x", "y")
        await self._grow(self.photo, "growing the mask …", lambda s: s.click_photo(pixel, again=again))

    async def _click_range(self, args: dict[str, Any]) -> None:
        again, pixel = bool(args.get("again")), _numbers(args, "x", "y")
        await self._grow(
            self.range, "growing the plane …", lambda s: s.click_cloud(self.shared.pixel_in_range(*pixel), again=again)
        )

    async def _click_solid(self, args: dict[str, Any]) -> None:
        again = bool(args.get("again"))
        origin, ahead = (np.array(args[name], dtype=np.float64) for name in ("origin", "direction"))
        await self._grow(
            self.solid,
            "growing the plane …",
            lambda s: s.click_cloud(self.shared.point_on_ray(origin, ahead), again=again),
        )

    async def _set_scanner(self, place: list[float] | None) -> None:
        await self._grow(self.range, "looking from there …", lambda session: session.set_scanner(place))

    async def _set_prior_settings(self, settings: PriorSettings) -> bool:
        return await self._edit(lambda session: session.set_prior_settings(settings))

    async def _drawn(self, args: dict[str, Any]) -> None:
        await self._edit(lambda session: session.draw_polygon(args["ring"], hidden=args["hidden"]))
        self.modes.set_value("click")

    async def _cut(self, args: dict[str, Any]) -> None:
        await self._grow(self.range, "fitting the plane …", self.shared.cut_in_range(args["ring"]))
        self.cloud_modes.set_value("click")

    async def _moved(self, args: dict[str, Any]) -> None:
        await self._edit(lambda session: session.edit_polygon(int(args["key"]), args["rings"], args["hidden"]))

    async def _choose(self, key: int, side: str, index: int) -> None:
        view = self.photo if side == "image" else self.range
        await self._grow(view, "growing …", lambda session: session.choose(key, side, index))

    async def _grow(self, view: PictureView | CloudView, message: str, action: Callable[[Session], object]) -> None:
        view.show(busy=message)
        await self._edit(action)
        view.show(busy="")

    async def _edit(self, action: Callable[[Session], object]) -> bool:
        """Edit the session away from the page's own thread, and show errors; return whether there were none."""
        is_done = True
        try:
            await run.io_bound(self.shared.edit, action)
        except (ValueError, TypeError, KeyError) as error:
            notify_error(str(error))
            is_done, self.revision_drawn = False, -1
            self._show_rows(rebuild=True)  # A name that was refused goes.
        self._refresh()
        return is_done

    async def _save(self) -> None:
        try:
            written = await run.io_bound(self.shared.save)
            count = len(written or []) - 1
            masks = f" and {count} mask{'s' if count != 1 else ''}" if count else ""
            notify(f"Saved {self.session.path.name}{masks}")
        except (ValueError, OSError) as error:
            notify_error(str(error))
        self._refresh()

    async def _select(self, args: dict[str, Any]) -> None:
        await self._edit(lambda session: session.select(int(args["key"])))

    async def _new(self) -> None:
        await self._edit(lambda session: session.select(None))

    def _choose_mode(self) -> None:
        self.mode = str(self.modes.value)
        self._show_photo()

    async def _show_depth(self) -> None:
        if self.depth.value != self.shared.shows_depth:
            await run.io_bound(self.shared.show_depth, bool(self.depth.value))
            self._refresh()

    def _choose_cloud_mode(self) -> None:
        cuts = self.cloud_modes.value == "cut"
        if cuts:
            self.tabs.set_value("range")
        self.range.show(mode="cut" if cuts else "click")
        self._show_cloud()

    def _choose_tab(self) -> None:
        if self.tabs.value == "solid":
            self.cloud_modes.set_value("click")
        self.solid.set_visibility(self.tabs.value == "solid")
        self.range.set_visibility(self.tabs.value == "range")

    async def _color(self) -> None:
        if self.coloring.value != self.shared.coloring:
            await run.io_bound(self.shared.color_by, str(self.coloring.value))
            self._refresh()

    async def _key(self, event: KeyEventArguments) -> None:
        if not event.action.keydown:
            return
        key = str(event.key.name).lower()
        if event.modifiers.ctrl or event.modifiers.meta:
            await self._command("y" if key == "z" and event.modifiers.shift else key)
        elif key in ("c", "p", "h"):
            self.modes.set_value({"c": "click", "p": "polygon", "h": "hide"}[key])
        elif key == "x":
            self.cloud_modes.set_value("click" if self.cloud_modes.value == "cut" else "cut")
        elif key in ("pageup", "pagedown"):
            await self._turn(1 if key == "pagedown" else -1)
        elif key == "d":
            self.depth.set_value(not self.depth.value)
        elif key == "r":
            self.at.set_value(0 if self.at.value else 1)
        elif key == "o":
            self.outlines.set_value(not self.outlines.value)
        elif key == "n":
            await self._new()
        elif key == "escape" and self.mode == self.cloud_modes.value == "click":
            self.shared.stop()  # While the user draws, it takes the corners back.
        elif self.selected is not None:
            await self._key_of_region(self.selected, key)

    async def _command(self, key: str) -> None:
        if key == "s":
            await self._save()
        elif key in ("z", "y"):
            await self._edit(Session.undo if key == "z" else Session.redo)

    async def _key_of_region(self, selected: Picked, key: str) -> None:
        if key == "delete":
            await self._edit(lambda session: session.remove(selected.key))
        elif key in ("1", "2", "3", "4", "5") and selected.image is not None and len(selected.image) >= int(key):
            await self._choose(selected.key, "image", int(key) - 1)


def _switch(title: str, hint: str, action: Callable[[], Any], *, on: bool = True) -> ui.switch:
    return ui.switch(title, value=on, on_change=action).props("dense size=xs").tooltip(hint)


def _numbers(args: dict[str, Any], *names: str) -> tuple[float, ...]:
    return tuple(float(args[name]) for name in names)
