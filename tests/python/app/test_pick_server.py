"""The picking page's server as a process: what others see of it, and how it ends."""

from __future__ import annotations

import http.client
import os
import re
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest

pytest.importorskip("nicegui", reason="needs the extra pick")
resource = pytest.importorskip("resource", reason="needs POSIX")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name == "nt", reason="needs signals and a shell")]

BROWSER = """#!/bin/sh
printf '%s\\n' "$@" > {told}.part
mv {told}.part {told}
"""

WAIT_S = 120.0

PAGES = 50


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str, Path]]:
    """The process of a page, its address, and the file to which its browser writes what it was started with."""
    told, browser = tmp_path / "told", tmp_path / "browser"
    browser.write_text(BROWSER.format(told=told), encoding="utf-8")
    browser.chmod(0o755)
    command = [sys.executable, "-m", "regionpose", "pick", "--demo", "--quiet", str(tmp_path / "scene.yaml")]
    environment = {**os.environ, "BROWSER": str(browser), "TMPDIR": str(tmp_path)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        try:
            yield process, found.group(), told
        finally:
            process.kill()


def used_s(process: int) -> float:
    """Seconds of the processor that a process has used, which a busy machine changes little; all that it may have used
    where that is not known.
    """
    held = Path(f"/proc/{process}/stat")
    if not held.exists():
        return float("inf")
    fields = held.read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_a_browser_is_led_to_the_token_and_the_server_ends_soon_after_many_pages_without_a_socket(
    served: tuple[subprocess.Popen[str], str, Path],
) -> None:
    process, address, told = served
    end = time.monotonic() + WAIT_S
    while not told.exists() and time.monotonic() < end:
        time.sleep(0.05)
    (given,) = told.read_text(encoding="utf-8").split()
    assert "token" in address and "token" not in given and given.startswith("file://")
    file = Path(urlsplit(given).path)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600 and stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert f'"{address}"' in file.read_text(encoding="utf-8")

    parts = urlsplit(address)
    assert parts.hostname is not None
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=WAIT_S)
    connection.request("GET", f"/?{parts.query}")
    answer = connection.getresponse()
    cookie = answer.headers["set-cookie"].partition(";")[0]
    answer.read()
    for _ in range(PAGES):
        connection.request("GET", "/", headers={"cookie": cookie})
        answer = connection.getresponse()
        assert answer.status == 200
        answer.read()
    connection.close()
    before, ended = used_s(process.pid), resource.getrusage(resource.RUSAGE_CHILDREN)
    process.send_signal(signal.SIGINT)
    process.wait(timeout=WAIT_S)
    whole = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert whole.ru_utime + whole.ru_stime - ended.ru_utime - ended.ru_stime - before < 2.0
    assert not file.parent.exists()
