"""Access control of the picking page: only a browser of this computer that has the token."""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from contextlib import suppress
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

MOST_BYTES = 1 << 20
"""Bytes of a request or of a message from the page: a polygon of 10,000 vertices has a quarter of that."""

SERVED = ("/files/", "/_nicegui/", "/_nicegui_ws/")
"""What paths may begin with; the page itself is `/`."""

SOCKET = "/_nicegui_ws/"

POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline';"
    " img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws://{host}; frame-ancestors 'none';"
    " base-uri 'none'; form-action 'none'; object-src 'none'"
)
"""The page loads nothing from elsewhere and stands in no other page's frame; its library compiles its templates."""


class Guard:
    """An ASGI application that hands on what comes from its own page, and answers everything else with an error.

    A request must name this server's host, come from its own origin, carry the cookie that the page's first address
    was exchanged for, ask for a path of the list, and be small. The token in that address works once.
    """

    def __init__(self, app: App, port: int, show_address: Callable[[str], object] = print) -> None:
        """Guard an application that listens at `port` of this computer alone.

        `show_address` is called with the next address when the last one is used again, by another browser of the user.
        """
        self.app, self._show_address, self._port = app, show_address, port
        self._token, self._spent, self._is_shown = _secret(), set[str](), True
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._cookie, self._key = f"regionpose_{port}", _secret()

    @property
    def address(self) -> str:
        """The page's first address, for one browser."""
        return f"http://127.0.0.1:{self._port}/?token={self._token}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        headers = {key.decode("latin-1").lower(): value.decode("latin-1") for key, value in scope["headers"]}
        refusal = self._refusal(scope, headers)
        if refusal is not None:
            await _refuse(scope, send, *refusal)
        elif self._is_first(scope):
            await self._welcome(_query_token(scope), send)
        else:
            await self.app(scope, _bounded(receive), self._with_policy(send, headers["host"]))

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> tuple[int, str] | None:
        """The status and the reason for which a request is refused, None for one that is not."""
        if headers.get("host") not in self._hosts:
            return 421, "this page answers to 127.0.0.1 and localhost alone"
        origin = headers.get("origin")
        if (origin is None and scope["type"] == "websocket") or (
            origin is not None and origin.removeprefix("http://") not in self._hosts
        ):
            return 403, "this page takes no requests from other pages"
        if not self._has_cookie(headers) and not (self._is_first(scope) and _same(_query_token(scope), self._token)):
            return 403, self._unknown(_query_token(scope))
        if not _is_served(scope):
            return 404, "nothing is served here"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length[:20]) > MOST_BYTES:
            return 413, f"a request holds at most {MOST_BYTES} bytes"
        return None

    def _has_cookie(self, headers: dict[str, str]) -> bool:
        cookies: SimpleCookie = SimpleCookie()
        with suppress(CookieError):
            cookies.load(headers.get("cookie", ""))
        cookie = cookies.get(self._cookie)
        return cookie is not None and _same(cookie.value, self._key)

    def _unknown(self, token: str) -> str:
        """The reason to refuse a browser without the cookie; prints the next address where it used the last one."""
        if token not in self._spent:
            return "the address needs the token that `regionpose pick` printed"
        if not self._is_shown:
            self._is_shown = True
            self._show_address(self.address)
        return "this address has been used; needed the next one, which `regionpose pick` printed just now"

    def _is_first(self, scope: Scope) -> bool:
        """Whether this is the page's first address, with the token in it."""
        is_page = scope["type"] == "http" and scope["method"] == "GET" and scope["path"] == "/"
        return is_page and bool(_query_token(scope))

    async def _welcome(self, token: str, send: Send) -> None:
        """Take a token for a cookie and go on to the page, so that it stays out of the address and of its history.

        A page goes on, and not the answer's status: browsers keep a strict cookie to themselves where a file sent them.
        """
        if _same(token, self._token):
            self._spent.add(token)
            self._token, self._is_shown = _secret(), False
        cookie = f"{self._cookie}={self._key}; Path=/; HttpOnly; SameSite=Strict"
        headers = [(b"content-type", b"text/html"), (b"set-cookie", cookie.encode()), (b"cache-control", b"no-store")]
        headers.append((b"referrer-policy", b"no-referrer"))
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": redirect_page("/").encode()})

    def _with_policy(self, send: Send, host: str) -> Send:
        policy_headers = [
            (b"content-security-policy", POLICY.format(host=host).encode()),
            (b"x-content-type-options", b"nosniff"),
            (b"referrer-policy", b"no-referrer"),
        ]

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", []), *policy_headers]}
            await send(message)

        return sent


def redirect_page(address: str) -> str:
    """A page that leads to an address, and is no place to come back to."""
    return f"""<!DOCTYPE html><meta charset="utf-8"><title>regionpose pick</title>
<script>location.replace("{address}")</script><noscript><meta http-equiv="refresh" content="0;url={address}"></noscript>
"""


def _secret() -> str:
    return secrets.token_urlsafe(24)


def _same(given: str, secret: str) -> bool:
    return secrets.compare_digest(given.encode(), secret.encode())


def _query_token(scope: Scope) -> str:
    query: bytes = scope.get("query_string", b"")
    return parse_qs(query.decode("latin-1")).get("token", [""])[0]


def _is_served(scope: Scope) -> bool:
    """Whether the path is of the list and the method only reads, but for the page's own socket."""
    path: str = scope["path"]
    raw = scope.get("raw_path", b"").lower()
    if ".." in path or "\\" in path or b"%2e" in raw or b"%2f" in raw or b"%5c" in raw or "//" in path:
        return False
    if scope["type"] == "websocket":
        return path.startswith(SOCKET)
    reads = scope["method"] in {"GET", "HEAD"} or path.startswith(SOCKET)
    return reads and (path == "/" or path.startswith(SERVED))


def _bounded(receive: Receive) -> Receive:
    """A receiver that ends a request whose body is larger than announced."""
    taken = 0

    async def bounded() -> Message:
        nonlocal taken
        message = await receive()
        taken += len(message.get("body", b"") or b"") if message["type"] == "http.request" else 0
        return {"type": "http.disconnect"} if taken > MOST_BYTES else message

    return bounded


async def _refuse(scope: Scope, send: Send, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": reason})
        return
    body = f"{reason}\n".encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": [*headers, (b"connection", b"close")]})
    await send({"type": "http.response.body", "body": body})
