"""A command run as from the shell."""

from __future__ import annotations

from pathlib import Path

import pytest
from regionpose.cli import main


def run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command line."""
    code = main([str(word) for word in words])
    said = capsys.readouterr()
    return code, said.out, said.err
