"""The picking page's server attacked: whatever doesn't come from its own page is refused."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest

httpx = pytest.importorskip("httpx")

from regionpose.app.guard import MOST_BYTES, Guard  # noqa: E402

PORT = 8123
HOME = f"http://127.0.0.1:{PORT}"
COOKIE = {"cookie": "the right one"}
TOKEN = "the-right-token"


class Behind:
    """An application that says what reached it."""

    def __init__(self) -> None:
        self.reached: list[str] = []

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        size = 0
        while True:
            message = await receive()
            if message["type"] == "http.disconnect":
                return
            size += len(message.get("body", b""))
            if not message.get("more_body"):
                break
        self.reached.append(scope["path"])
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": str(size).encode()})


def asked(guard: Guard, path: str, headers: Any = None, method: str = "GET", content: Any = None) -> Any:
    """The guard's answer to one request."""

    async def answered() -> Any:
        transport = httpx.ASGITransport(guard, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url=HOME) as client:
            return await client.request(method, path, headers=headers or {}, content=content)

    return asyncio.run(answered())


def cookie_of(guard: Guard) -> str:
    """The cookie for which the guard takes its address."""
    return str(asked(guard, guard.address.removeprefix(HOME)).headers["set-cookie"]).partition(";")[0]


def answer(
    path: str, headers: dict[str, str] | None = None, method: str = "GET", content: Any = None
) -> tuple[Any, Behind]:
    """The guard's answer, and what is behind it: the cookie and the token are the right ones where they say so."""
    behind = Behind()
    guard = Guard(behind, PORT, lambda _: None)
    given = dict(headers or {})
    if given.get("cookie") == COOKIE["cookie"]:
        given["cookie"] = cookie_of(guard)
    return asked(guard, path.replace(TOKEN, guard.address.partition("=")[2]), given, method, content), behind


def test_the_page_s_address_gives_a_cookie_and_leaves_the_address() -> None:
    behind = Behind()
    guard = Guard(behind, PORT, lambda _: None)
    token = guard.address.partition("=")[2]
    found = asked(guard, f"/?token={token}")
    assert found.status_code == 200
    assert 'location.replace("/")' in found.text and token not in found.text
    assert "HttpOnly" in found.headers["set-cookie"] and token not in found.headers["set-cookie"]
    assert "SameSite=Strict" in found.headers["set-cookie"]
    assert behind.reached == []


def test_an_address_works_once_and_the_next_one_is_said_where_it_is_used_again() -> None:
    said: list[str] = []
    guard = Guard(Behind(), PORT, said.append)
    first = guard.address.removeprefix(HOME)
    assert asked(guard, first, method="HEAD").status_code == 403
    cookie = {"cookie": cookie_of(guard)}
    assert asked(guard, "/?token=wrong").status_code == 403 and said == []
    assert asked(guard, first).status_code == 403
    assert asked(guard, first).status_code == 403
    assert said == [guard.address] and guard.address.removeprefix(HOME) != first
    assert asked(guard, first, cookie).status_code == 200
    assert asked(guard, said[0].removeprefix(HOME)).status_code == 200
    assert asked(guard, said[0].removeprefix(HOME)).status_code == 403
    assert asked(guard, "/", cookie).status_code == 200


def test_the_cookie_opens_the_page_which_may_load_nothing_from_elsewhere() -> None:
    found, behind = answer("/", COOKIE)
    assert found.status_code == 200
    assert behind.reached == ["/"]
    assert "default-src 'self'" in found.headers["content-security-policy"]
    assert "frame-ancestors 'none'" in found.headers["content-security-policy"]


@pytest.mark.parametrize(
    ("path", "headers", "status"),
    [
        ("/", {}, 403),
        ("/?token=wrong", {}, 403),
        ("/files/photo.jpg", {"cookie": f"regionpose_{PORT}=wrong"}, 403),
        ("/files/photo.jpg?token=" + TOKEN, {}, 403),
        (f"/?token={TOKEN}", {"host": f"evil.example:{PORT}"}, 421),
        (f"/?token={TOKEN}", {"origin": "https://evil.example"}, 403),
        ("/", COOKIE | {"host": f"evil.example:{PORT}"}, 421),
        ("/", COOKIE | {"host": "127.0.0.1:9999"}, 421),
        ("/", COOKIE | {"origin": "https://evil.example"}, 403),
        ("/", COOKIE | {"origin": "null"}, 403),
        ("/_nicegui_ws/socket.io/", COOKIE | {"origin": "http://127.0.0.1:9999"}, 403),
        ("/etc/passwd", COOKIE, 404),
        ("/files/..%2f..%2fetc%2fpasswd", COOKIE, 404),
        ("/files/%2e%2e/%2e%2e/etc/passwd", COOKIE, 404),
        ("/files/..\\..\\secret", COOKIE, 404),
        ("/_nicegui/3.0/static//etc/passwd", COOKIE, 404),
    ],
)
def test_others_are_refused(path: str, headers: dict[str, str], status: int) -> None:
    found, behind = answer(path, headers)
    assert found.status_code == status
    assert behind.reached == []


def test_files_are_read_only() -> None:
    assert answer("/files/photo.jpg", COOKIE, "POST", b"x")[0].status_code == 404
    assert answer("/files/photo.jpg", COOKIE, "DELETE")[0].status_code == 404


def test_a_body_that_says_it_is_a_gigabyte_is_refused_unread() -> None:
    headers = COOKIE | {"content-length": str(1 << 30)}
    assert answer("/_nicegui_ws/socket.io/", headers, "POST", b"x")[0].status_code == 413


@pytest.mark.parametrize("length", ["", "much", "-1", "9" * 40])
def test_a_size_that_is_none_is_refused(length: str) -> None:
    headers = COOKIE | {"content-length": length}
    assert answer("/_nicegui_ws/socket.io/", headers, "POST", b"x")[0].status_code == 413


def test_a_cookie_that_is_none_is_no_token() -> None:
    assert answer("/", {"cookie": 'a\x01b="; =;;'})[0].status_code == 403


def test_a_body_that_grows_without_saying_so_is_cut_off() -> None:
    async def endless() -> AsyncIterator[bytes]:
        for _ in range(64):
            yield b"x" * (MOST_BYTES // 16)

    with pytest.raises(AssertionError):
        # httpx misses the answer of an application whose client is said to be gone.
        answer("/_nicegui_ws/socket.io/", COOKIE, "POST", endless())


def test_a_socket_without_an_origin_or_with_another_one_is_closed() -> None:
    async def closed(headers: list[tuple[bytes, bytes]]) -> list[Any]:
        sent: list[Any] = []

        async def send(message: Any) -> None:
            sent.append(message)

        async def receive() -> Any:
            return {"type": "websocket.connect"}

        scope = {"type": "websocket", "path": "/_nicegui_ws/socket.io/", "raw_path": b"/", "query_string": b""}
        await guard({**scope, "headers": headers}, receive, send)
        return sent

    guard = Guard(Behind(), PORT, lambda _: None)
    host, cookie = (b"host", f"127.0.0.1:{PORT}".encode()), (b"cookie", cookie_of(guard).encode())
    for headers in ([host, cookie], [host, cookie, (b"origin", b"https://evil.example")]):
        assert asyncio.run(closed(headers))[0]["type"] == "websocket.close"
