"""Mutated files through every reader: each is read, or refused with the package's own error that names it.

    python fuzz/readers.py --seconds 60
    python fuzz/readers.py --kind pcd --files 100000 --seed 3

A find is a foreign exception, a message without the file's name, a file left open, and a file below a megabyte that
takes more than 500 MB or over ten seconds of processor time. It is written to the folder of `--keep`; the exit code is
1 if there were any. Runs on Linux.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from random import Random

from mutation import mutated
from regionpose.io.calibrations import CalibrationError
from regionpose.io.clouds import CloudError
from regionpose.io.reading import FileError
from regionpose.scene.document import SceneError
from samples import Sample, samples

OWN = (ValueError, FileError, CloudError, CalibrationError, SceneError)
"""Errors of the package; ValueError itself, not what numpy and others derive from it."""

MOST_MEMORY = 500 * 2**20
LONGEST = 10
"""Bytes and seconds of processor time that a file below a megabyte may take."""

CALIBRATIONS = Path(__file__).parents[1] / "tests" / "python" / "samples"


class Slow(BaseException):
    """A file took too long."""


def find(sample: Sample, content: bytes, folder: Path) -> str | None:
    """What is wrong with how a file is read; None where nothing is."""
    path = folder / sample.name
    path.write_bytes(content)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sample.read(path)
    except (MemoryError, Slow) as error:
        return type(error).__name__
    except Exception as error:
        if type(error) not in OWN:
            return f"{type(error).__name__}: {error}"
        return None if path.name in str(error) else f"no name: {error}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return None


def run(given: argparse.Namespace) -> Counter[tuple[str, str]]:
    """The finds, each kind of file in turn, and how often each came."""
    chosen = [sample for sample in samples(CALIBRATIONS) if given.kind in sample.name]
    if not chosen:
        sys.exit(f"--kind: found {given.kind!r}; needed part of a sample's name")
    random, found = Random(given.seed), Counter[tuple[str, str]]()
    handles = len(os.listdir("/proc/self/fd"))
    end, count = time.monotonic() + given.seconds, 0
    with tempfile.TemporaryDirectory() as name:
        while time.monotonic() < end and count < given.files:
            sample = chosen[count % len(chosen)]
            content = sample.seal(mutated(sample.content, random))
            what = find(sample, content, Path(name))
            count += 1
            if what is not None:
                key = sample.name, " ".join(re.findall(r"[A-Za-z]{3,}", what))[:50]
                if not found[key] and given.keep is not None:
                    given.keep.mkdir(exist_ok=True)
                    (given.keep / f"{len(found)}-{sample.name}").write_bytes(content)
                found[key] += 1
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss >> 10
    left = len(os.listdir("/proc/self/fd")) - handles
    if left > 0:
        found["any", f"{left} files left open"] += 1
    print(f"{count} files of {len(chosen)} kinds with the seed {given.seed}; most memory {most} MB; {len(found)} finds")
    return found


def main() -> int:
    """Run as the arguments say; 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=1e9)
    parser.add_argument("--files", type=int, default=10**9)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", default="", help="part of a sample's name")
    parser.add_argument("--keep", type=Path, help="folder for the files found")
    given = parser.parse_args()

    def too_long(*_: object) -> None:
        raise Slow

    signal.signal(signal.SIGPROF, too_long)
    samples(CALIBRATIONS)  # The libraries are loaded now, and their memory is not the files'.
    held = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    resource.setrlimit(resource.RLIMIT_AS, (held + MOST_MEMORY, resource.getrlimit(resource.RLIMIT_AS)[1]))
    found = run(given)
    for (name, what), times in found.most_common():
        print(f"{times:6d}  {name}: {what}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
