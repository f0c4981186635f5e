"""Progress of long work: bars with rates at a terminal, nothing elsewhere, and nothing left behind."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import ClassVar, NamedTuple

import pytest
import waiting
from made_up_worlds import made_world
from PIL import Image
from regionpose.cli.bars import BYTES, ITEMS, PERCENT, StageLine
from regionpose.io.clouds import Cloud, write_ply
from rich.console import Console
from scene_files import scene_values, write_scene
from waiting import write_waiting_scene

pytestmark = pytest.mark.slow

pty = pytest.importorskip("pty")

AT_ONCE = "from regionpose.cli import console, main; console.SHOWN_AFTER_S = 0.0; raise SystemExit(main())"
"""A command whose progress is shown from the start."""

EACH_TIME = AT_ONCE.replace("import console, main; ", "import bars, console, main; bars.DRAWN_EVERY_S = ")
"""The same, drawn at each report of progress."""

STUDY = AT_ONCE.replace("import console, main;", "import console; from benchmarks.synthetic.command import main;")
"""The same of a study."""

POINTS = 300_000

SHOW_CURSOR, HIDE_CURSOR = "\x1b[?25h", "\x1b[?25l"
CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


class Seen(NamedTuple):
    """What a terminal on standard error got, what standard output got, and the exit code."""

    terminal: str
    output: str
    code: int

    @property
    def lines(self) -> list[str]:
        """All that was ever drawn, without colors and movements."""
        return [line for line in re.split(r"[\r\n]+", CODES.sub("", self.terminal)) if line.strip()]


def hear_ctrl_c() -> None:
    """Hear it, which what a shell starts in the background does not."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def at_terminal(
    *words: str | Path, end: Callable[[str, subprocess.Popen[str]], None] | None = None, program: str = AT_ONCE
) -> Seen:
    """A command with a terminal for its standard error; `end` is told what the terminal got so far."""
    screen, side = pty.openpty()
    command = [sys.executable, "-c", program, *(str(word) for word in words)]
    given = {**os.environ, "TERM": "xterm", "COLUMNS": "80", "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=side,
        text=True,
        env=given,
        cwd=waiting.FOLDER,
        preexec_fn=hear_ctrl_c,
    )
    os.close(side)
    got = b""
    try:
        for piece in pieces(screen):
            got += piece
            if end is not None:
                end(got.decode(errors="ignore"), process)
        output, _ = process.communicate(timeout=60)
    finally:
        process.kill()
        os.close(screen)
    return Seen(got.decode(), output, process.returncode)


def pieces(screen: int) -> Iterator[bytes]:
    """What a terminal gets until its program ends."""
    while True:
        try:
            piece = os.read(screen, 65536)
        except OSError:
            return
        if not piece:
            return
        yield piece


def remains(text: str) -> str:
    """What is left on a screen after all that was written and erased."""
    rows, row, column = [""], 0, 0
    for part in re.findall(r"\x1b\[[0-9;?]*[A-Za-z]|\r|\n|[^\x1b\r\n]+", text):
        if part == "\r":
            column = 0
        elif part == "\n":
            row += 1
            rows += [""] * (row + 1 - len(rows))
        elif part.endswith("A") and part[0] == "\x1b":
            row -= int(part[2:-1] or 1)
        elif part == "\x1b[2K":
            rows[row] = ""
        elif part[0] != "\x1b":
            rows[row] = rows[row][:column].ljust(column) + part + rows[row][column + len(part) :]
            column += len(part)
    return "\n".join(rows).strip() + f" at {row}, {column}"


@pytest.fixture(scope="module")
def cloud(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A text of points that takes tenths of a second to read."""
    path = tmp_path_factory.mktemp("cloud") / "cloud.xyz"
    path.write_text("".join(f"{k % 1009} {k % 997} {k % 13}.5\n" for k in range(POINTS)), encoding="ascii")
    return path


def test_reading_shows_a_bar_with_its_rate_at_a_terminal_alone(cloud: Path) -> None:
    seen = at_terminal("info", cloud, "--json")
    assert seen.code == 0 and shows_bytes(seen, "read cloud", cloud)
    assert any(f"spacing of {POINTS} points" in line for line in seen.lines)
    assert all(len(line) <= 80 for line in seen.lines)
    assert remains(seen.terminal) == " at 0, 0"
    assert seen.terminal.rfind(SHOW_CURSOR) > seen.terminal.rfind(HIDE_CURSOR)
    piped = subprocess.run(
        [sys.executable, "-c", AT_ONCE, "info", str(cloud), "--json"], capture_output=True, text=True, check=True
    )
    assert piped.stderr == "" and piped.stdout == seen.output


def shows_bytes(seen: Seen, stage: str, cloud: Path) -> bool:
    """Whether the stage had a bar of the bytes of the cloud's file."""
    size = cloud.stat().st_size / 1e6
    return any(re.search(rf"{stage} +[━╸╺]+ +[\d.]+/{size:.1f} MB +[\d.]+ MB/s", line) for line in seen.lines)


def test_a_scene_file_shows_the_bytes_of_its_cloud(cloud: Path, tmp_path: Path) -> None:
    scene = write_scene(tmp_path, scene_values() | {"cloud": str(cloud)})
    seen = at_terminal("segment", scene, "--out", tmp_path / "out")
    assert seen.code == 0 and shows_bytes(seen, "read files", cloud)
    assert remains(seen.terminal) == " at 0, 0"


def test_picking_shows_what_it_reads_until_the_page_is_there(cloud: Path, tmp_path: Path) -> None:
    pytest.importorskip("nicegui", reason="needs the extra pick")
    scene = write_scene(tmp_path, scene_values() | {"cloud": str(cloud)})

    left: list[str] = []

    def end(got: str, process: subprocess.Popen[str]) -> None:
        if SHOW_CURSOR in got and remains(got) == " at 0, 0" and not left:
            left.append(got)
            process.send_signal(signal.SIGINT)

    seen = at_terminal("pick", scene, "--no-browser", end=end)
    assert shows_bytes(seen, "read files", cloud)
    assert any(f"pictures of {POINTS} points" in line for line in seen.lines)
    assert left, "the bars are gone before the page is served"


def test_quiet_shows_nothing_at_a_terminal(cloud: Path) -> None:
    assert at_terminal("info", cloud, "--quiet").terminal == ""


def test_a_terminal_that_cannot_draw_over_a_line_shows_nothing(cloud: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from regionpose.cli import console

    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    monkeypatch.setenv("TERM", "dumb")
    with console.Progress(quiet=False) as progress:
        progress.begin("stage")
    assert terminal.getvalue() == ""


class Terminal(io.StringIO):
    """A file that claims to be a terminal."""

    def isatty(self) -> bool:
        return True


def test_ctrl_c_leaves_a_clean_terminal_with_its_cursor(tmp_path: Path) -> None:
    scene = write_waiting_scene(tmp_path)
    interrupted: list[bool] = []

    def end(got: str, process: subprocess.Popen[str]) -> None:
        if "image regions" in got and not interrupted:
            interrupted.append(True)
            process.send_signal(signal.SIGINT)

    seen = at_terminal("estimate", scene, "--out", tmp_path / "out", *waiting.ARGUMENTS, end=end)
    assert seen.code == 130 and HIDE_CURSOR in seen.terminal
    assert seen.terminal.rfind(SHOW_CURSOR) > seen.terminal.rfind(HIDE_CURSOR)
    assert "image regions" not in remains(seen.terminal)


def test_a_study_shows_its_rate_and_leaves_nothing(tmp_path: Path) -> None:
    words = ("--scenes", "6", "--planes", "3", "--noise", "0", "--no-plots", "-j", "1", "--out", tmp_path / "rows.csv")
    seen = at_terminal("perspective", *words, program=STUDY)
    assert seen.code == 0 and "written:" in seen.output
    assert any(re.search(r"perspective .*\d+/\d+ +[\d.]+(/s| s each)", line) for line in seen.lines)
    assert remains(seen.terminal) == " at 0, 0"


def test_a_search_shows_the_time_that_is_left(tmp_path: Path) -> None:
    world = made_world(5)
    Image.fromarray(world.photo).save(tmp_path / "photo.png")
    write_ply(tmp_path / "scan.ply", Cloud.from_points(world.points, intensity=world.intensity))
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 480 320 260 260 240 160\n", encoding="ascii")
    words = ("--camera", tmp_path / "cameras.txt", "--up", "z", "--mount", "front", "--json")
    seen = at_terminal("calibrate", tmp_path / "photo.png", tmp_path / "scan.ply", *words, program=EACH_TIME)
    assert seen.code in (0, 3) and remains(seen.terminal) == " at 0, 0"
    bars = [re.search(r"edges [━╸╺]+ +(\d+)% \d:\d\d:\d\d \d:\d\d:\d\d left", line) for line in seen.lines]
    shown = [int(bar[1]) for bar in bars if bar]
    assert len(set(shown)) > 10 and shown == sorted(shown)


class Clock:
    """A clock that stands still until it is set."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


class FreeWhereDrawn(StageLine):
    """A line that sees, wherever it is drawn, whether another thread could look at its tasks."""

    free: ClassVar[list[bool]] = []

    def refresh(self) -> None:
        """Look from another thread, as the one that draws by itself does."""
        looking = threading.Thread(target=lambda: self.tasks, daemon=True)
        looking.start()
        looking.join(1.0)
        self.free.append(not looking.is_alive())
        super().refresh()


def test_no_lock_is_held_where_the_line_is_drawn() -> None:
    line = FreeWhereDrawn(0.0, Clock())
    line.begin("read the cloud")
    line.set_amount(PERCENT, 0.5, 1.0)
    line.begin("write the cloud")
    assert len(line.free) >= 3 and all(line.free)


def drawn(line: StageLine) -> str:
    """What the line shows at this moment."""
    screen = Console(width=80, file=io.StringIO())
    screen.print(line.get_renderable())
    assert isinstance(screen.file, io.StringIO)
    return screen.file.getvalue().strip()


def test_what_takes_less_than_a_second_shows_nothing() -> None:
    line = StageLine(1.0, clock := Clock())
    line.begin("read cloud")
    clock.seconds += 0.9
    assert drawn(line) == ""
    clock.seconds += 0.2
    line.begin("planes")
    assert "planes" in drawn(line) and "0:00:00" in drawn(line), "short stages of long work are shown"


def test_stages_of_unknown_amount_show_their_time() -> None:
    line = StageLine(1.0, clock := Clock())
    line.begin("pose [1/2]")
    clock.seconds += 65.0
    assert re.fullmatch(r"\S pose \[1/2\] 0:01:05", drawn(line))


@pytest.mark.parametrize(
    ("kind", "amounts", "shown"),
    [
        (BYTES, (0.0, 160e6, 320e6, 640e6), r"320\.0/640\.0 MB 40\.0 MB/s 0:00:08 0:00:08 left"),
        (PERCENT, (0.0, 0.25, 0.5, 1.0), r"50% 0:00:08 0:00:08 left"),
        (ITEMS, (0, 1, 2, 4), r"2/4 4\.0 s each 0:00:08 0:00:08 left"),
        (ITEMS, (0, 20, 40, 80), r"40/80 5\.0/s 0:00:08 0:00:08 left"),
    ],
)
def test_known_amounts_show_their_rate_and_the_time_left(
    kind: tuple[object, ...], amounts: tuple[float, ...], shown: str
) -> None:
    line = StageLine(1.0, clock := Clock())
    line.begin("stage")
    for amount in amounts[:3]:
        line.set_amount(kind, amount, amounts[3])  # type: ignore[arg-type]
        clock.seconds += 4.0
    clock.seconds -= 4.0
    assert re.search(rf"stage [━╸╺]+ +{shown}$", drawn(line))
    line.set_amount(kind, amounts[3], amounts[3])  # type: ignore[arg-type]
    clock.seconds += 4.0
    assert re.fullmatch(r"\S stage 0:00:12", drawn(line)), "what follows is of unknown amount"


def test_a_long_name_loses_its_middle_to_the_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    line = StageLine(1.0, clock := Clock())
    line.begin("frame 2 of 500, photo-of-the-long-corridor-000123: world regions")
    line.set_amount(PERCENT, 0.5, 1.0)
    clock.seconds += 4.0
    assert re.fullmatch(r"frame 2 of 500, p….*: world regions [━╸╺]{10} +50% 0:00:04 -:--:-- left", drawn(line))
