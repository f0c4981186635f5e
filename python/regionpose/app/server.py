"""The picking page on this computer: bound to 127.0.0.1, behind the guard, nothing loaded from elsewhere."""

from __future__ import annotations

import socket
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Timer

from regionpose.app.guard import MOST_BYTES, Guard, redirect_page
from regionpose.app.shared_session import SharedSession
from regionpose.validation.extras import load_extra

OPENING_S = 1.0
"""Seconds until the browser is opened, by when the server listens."""

RECONNECT_S = 30.0
"""Seconds that a page which a busy computer keeps from answering is waited for. After NiceGUI's 3 it is loaded again,
and what is being drawn is lost: seen with the estimate and a browser without a graphics card on two busy cores.
"""


def serve(
    shared: SharedSession, *, port: int = 0, browser: bool = True, show_address: Callable[[str], object] = print
) -> None:
    """Serve a shared session's page until Ctrl-C; `show_address` is called with its address. `port` 0: any that is
    free.

    MissingExtraError without NiceGUI; OSError for a port that is taken.
    """
    load_extra("nicegui", "pick", "the picking page")
    from fastapi import FastAPI, Response
    from nicegui import ui

    from regionpose.app.page import Page

    def file(name: str) -> Response:
        served = shared.files.get(name)
        if served is None:
            return Response("no such file\n", status_code=404, media_type="text/plain")
        return Response(served.content, media_type=served.media, headers={"cache-control": "no-store"})

    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    app.add_api_route("/files/{name}", file, response_class=Response, response_model=None)
    ui.run_with(
        app,
        root=lambda: Page(shared),
        title="regionpose pick",
        dark=False,
        show_welcome_message=False,
        reconnect_timeout=RECONNECT_S,
    )
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listening:
        listening.bind(("127.0.0.1", port))
        # A browser that connects as soon as the address is shown waits until the page is there.
        listening.listen()
        guard = Guard(app, listening.getsockname()[1], show_address)
        show_address(guard.address)
        try:
            with _address_file(guard.address) as address:
                if browser:
                    Timer(OPENING_S, webbrowser.open, [address.as_uri()]).start()
                _run(guard, listening)
        finally:
            shared.close()


@contextmanager
def _address_file(address: str) -> Iterator[Path]:
    """A page that leads to an address with a token in it, for this user's eyes alone.

    Every user of the computer can read what a browser is started with: that names this file, and not the token.
    """
    with TemporaryDirectory(prefix="regionpose-") as folder:
        file = Path(folder) / "pick.html"
        file.touch(mode=0o600)
        file.write_text(redirect_page(address), encoding="utf-8")
        yield file


def _run(guard: Guard, listening: socket.socket) -> None:
    """Serve until Ctrl-C."""
    import uvicorn

    config = uvicorn.Config(
        guard, log_level="warning", ws_max_size=MOST_BYTES, server_header=False, timeout_graceful_shutdown=1
    )
    uvicorn.Server(config).run(sockets=[listening])
