"""Runs ended while they save: by Ctrl-C, SIGTERM and SIGKILL at random times, into empty folders and over older files.

    python fuzz/kills.py --kills 40 --seed 3

Half of the signals come at any time of the saving, the others while files change places. After each all files must be
the old ones or all the new ones, with the modes that the old ones had, and nothing else be there. SIGKILL may leave
some of both, and a hidden folder; then another run into the same folder must end that. What is found is printed; the
exit code is 1 if there was anything. Runs on Linux.
"""

from __future__ import annotations

import argparse
import os
import signal
import stat
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random
from typing import NamedTuple

sys.path.append(str(Path(__file__).parents[1] / "tests" / "python" / "support"))

from regionpose.cli import main as command
from regionpose.io.outputs import text_writer, write_files
from regionpose.io.outputs.hidden import HIDDEN
from regionpose.io.outputs.placing import JOURNAL, NEW
from scene_files import write_scene

NAMES = ("overlay.png", "report.html", "result.json")
OLD, MODE = "old", 0o600
REPLACED, NEXT = "replaced", "next"
"""Files that say that there were older ones, and that another run was there."""

EXIT = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}
UNEXPECTED = 70
"""Of a run that ends by an exception."""

MOST_PLACING_S = 2e-3
"""A few times what three files take to change places."""

POLL_S, START_S = 2e-4, 60.0


class Seen(NamedTuple):
    """The state of each file, and what else is in the folder."""

    files: dict[str, str]
    others: list[str]

    @property
    def state(self) -> str:
        """Of all files together."""
        states = set(self.files.values())
        return "mixed" if len(states) > 1 else states.pop()

    def is_whole(self, before: str) -> bool:
        """Whether a run that found files in a state left them all so, or all new, and nothing else."""
        return self.state in (before, "new") and not self.others


def seen(out: Path) -> Seen:
    """What is in a folder."""
    files = {}
    for name in NAMES:
        path = out / name
        if not path.exists():
            files[name] = "missing"
            continue
        files[name] = "old" if path.read_bytes() == OLD.encode() else "new"
        if stat.S_IMODE(path.stat().st_mode) != MODE and (out / REPLACED).exists():
            files[name] += " of another mode"
    return Seen(files, [path.name for path in out.iterdir() if path.name not in (*NAMES, REPLACED, NEXT)])


def prepared(folder: Path, number: int) -> tuple[Path, str]:
    """A new output folder, every other one with older files, and the state of these."""
    out = folder / str(number)
    out.mkdir()
    if number % 2:
        return out, "missing"
    (out / REPLACED).touch()
    for name in NAMES:
        (out / name).write_text(OLD, encoding="utf-8")
        (out / name).chmod(MODE)
    return out, "old"


def started(scene: Path, out: Path) -> int:
    """The number of a process that estimates a scene into a folder."""
    number = os.fork()
    if number:
        return number
    code = UNEXPECTED
    try:
        said = os.open(out.parent / f"{out.name}.txt", os.O_WRONLY | os.O_CREAT)
        os.dup2(said, 1)
        os.dup2(said, 2)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = command(["estimate", str(scene), "--out", str(out), "--force", "--quiet"])
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def saves(out: Path, what: str) -> bool:
    """Whether a run into a folder has come to its new files, or to the journal of their moves."""
    return any((path / what).exists() for path in out.glob(f"{HIDDEN}*"))


def ended(process: int, out: Path, number: signal.Signals, rng: Random, longest: float) -> int:
    """The exit code of a run that a signal reaches while it saves."""
    placing = rng.random() < 0.5
    begun = time.monotonic()
    while not saves(out, JOURNAL if placing else NEW) and time.monotonic() < begun + START_S:
        if os.waitid(os.P_PID, process, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            break
        if not placing:
            time.sleep(POLL_S)
    time.sleep(rng.uniform(0.0, MOST_PLACING_S if placing else longest))
    os.kill(process, number)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def saving_s(scene: Path, folder: Path) -> float:
    """How long the saving takes, undisturbed."""
    out, _ = prepared(folder, 0)
    process, begun = started(scene, out), time.monotonic()
    while not saves(out, NEW):
        time.sleep(POLL_S)
        begun = time.monotonic()
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    if code != 0 or not seen(out).is_whole("old"):
        sys.exit(f"a run that nothing disturbs ends with {code} and leaves {seen(out)}")
    return time.monotonic() - begun


def find(scene: Path, folder: Path, number: int, kind: signal.Signals, rng: Random, longest: float) -> tuple[str, bool]:
    """What a signal left, in a few words, and whether that is a find."""
    out, before = prepared(folder, number)
    code = ended(started(scene, out), out, kind, rng, longest)
    left = seen(out)
    words = f"{kind.name}: exit code {code}, {left.state}" + (" and a hidden folder" if left.others else "")
    wrong = code not in (0, EXIT[kind])
    if kind is not signal.SIGKILL:
        return words, wrong or not left.is_whole(before)
    write_files(out, {NEXT: text_writer("")}, force=True)
    mended = seen(out)
    return f"{words}; after the next run {mended.state}", wrong or not mended.is_whole(before)


def main() -> int:
    """Print what the signals left."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=40, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    rng, found, kinds = Random(given.seed), 0, Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        scene = write_scene(folder)
        longest = saving_s(scene, folder)
        numbers = iter(range(1, 1 + len(EXIT) * given.kills))
        for kind in EXIT:
            for _ in range(given.kills):
                number = next(numbers)
                words, is_find = find(scene, folder, number, kind, rng, longest)
                kinds[words] += 1
                if is_find:
                    found += 1
                    print(f"found: run {number}, {words}: {seen(folder / str(number))}", flush=True)
                    print((folder / f"{number}.txt").read_text(encoding="utf-8"), flush=True)
    for words, count in sorted(kinds.items()):
        print(f"{count:5} {words}")
    print(f"{len(EXIT) * given.kills} signals, {found} finds")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
