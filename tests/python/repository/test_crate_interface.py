"""The crate's public interface changes on purpose only."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def test_the_interface_of_the_crate_is_the_one_that_is_written_down() -> None:
    tool = ROOT / "tools" / "crate_interface.py"
    found = subprocess.run([sys.executable, str(tool)], capture_output=True, text=True, check=True).stdout
    assert "pub struct Estimate" in found and "    pub fn estimate(&self) -> Result<Estimate>" in found
    # After a change on purpose: python tools/crate_interface.py > tests/rust/interface.txt
    assert found == (ROOT / "tests" / "rust" / "interface.txt").read_text(encoding="utf-8")
