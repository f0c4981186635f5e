"""What commands write: files whole or not at all, whatever ends them."""

from __future__ import annotations

import functools
import itertools
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
import waiting
from commands import run
from regionpose.cli import app, main
from regionpose.io.outputs import text_writer, write_files
from scene_files import scene_values, write_scene
from waiting import write_waiting_scene

START_S = 60.0
"""Imports on a busy machine."""


def refuse_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fail where the work begins before its output is refused."""

    def begun(*_: object) -> None:
        raise AssertionError("the work began before the refusal")

    monkeypatch.setattr("regionpose.scene.estimate.estimate_scene", begun)


def test_nothing_is_overwritten_without_force(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, out = write_scene(tmp_path), tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("mine", encoding="utf-8")
    with monkeypatch.context() as context:
        refuse_work(context)
        code, said, err = run(capsys, "estimate", scene, "--out", out)
    assert (code, said) == (2, "")
    assert "report.html: the file exists" in err and "force to replace it" in err
    assert [path.name for path in out.iterdir()] == ["report.html"]
    assert (out / "report.html").read_text(encoding="utf-8") == "mine"
    assert run(capsys, "estimate", scene, "--out", out, "--force")[0] == 0
    assert (out / "report.html").read_text(encoding="utf-8") != "mine"


def test_scenes_of_one_name_in_three_folders_have_results_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folders = [tmp_path / name for name in ("one", "other", "third")]
    for folder in folders:
        folder.mkdir()
        write_scene(folder)
    monkeypatch.chdir(tmp_path)
    for folder in folders:
        assert run(capsys, "estimate", f"{folder.name}/scene.yaml")[0] == 0
        assert (folder / "scene-result" / "result.json").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["one", "other", "third"]


def test_files_appear_together_or_not_at_all(tmp_path: Path) -> None:
    def fails(path: Path) -> None:
        path.write_text("half", encoding="utf-8")
        raise OSError("disk full")

    (tmp_path / "a").write_text("old", encoding="utf-8")
    with pytest.raises(OSError, match="disk full"):
        write_files(tmp_path, {"a": text_writer("new"), "b": fails}, force=True)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a").read_text(encoding="utf-8") == "old"


def test_an_output_below_a_file_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = write_scene(tmp_path)
    refuse_work(monkeypatch)
    code, _, err = run(capsys, "estimate", scene, "--out", scene / "out")
    assert code == 2
    assert "found a file; needed a folder" in err


def failing(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    """Make the last of the writing fail."""
    from regionpose.scene import bundle

    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(bundle, "save_png", fails)


def test_ctrl_c_leaves_nothing_behind_and_ends_with_130(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = write_scene(tmp_path)
    before = sorted(tmp_path.iterdir())
    failing(monkeypatch, KeyboardInterrupt())
    code, said, err = run(capsys, "estimate", scene, "--out", tmp_path / "new" / "out", "--quiet")
    # The pose and its verdict are there before anything is written.
    assert code == 130 and "trusted: " in said and "written: " not in said and "Traceback" not in err
    assert sorted(tmp_path.iterdir()) == before


def test_ctrl_c_after_the_last_of_the_work_ends_with_130(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes while the command puts back what SIGTERM did before."""
    before, handle = signal.getsignal(signal.SIGTERM), signal.signal
    came: list[int] = []

    def interrupted(number: int, handler: Any) -> Any:
        replaced = handle(number, handler)
        if handler is before and not came:
            came.append(number)
            raise KeyboardInterrupt
        return replaced

    monkeypatch.setattr(signal, "signal", interrupted)
    assert run(capsys, "schema")[0] == 130
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs a timer")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_sigterm_that_a_callback_loses_is_handled_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    handlers = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGALRM)]
    scene, out = write_scene(tmp_path), tmp_path / "out"
    ended: list[float] = []

    class Gone:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGTERM)

    def lost(*_: object) -> None:
        Gone()
        ended.append(time.monotonic())
        time.sleep(START_S)

    monkeypatch.setattr("regionpose.scene.estimate.estimate_scene", lost)
    assert run(capsys, "estimate", scene, "--out", out, "--quiet")[:2] == (143, "")
    assert len(ended) == 1 and time.monotonic() - ended[0] < START_S / 2.0
    assert not out.exists()
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGALRM)] == handlers


def test_sigterm_after_the_last_of_the_work_ends_with_143(capsys: pytest.CaptureFixture[str]) -> None:
    """It comes at any line on the way out of the block that handles it, and the handler from before is back."""
    handler, tracer, codes = signal.getsignal(signal.SIGTERM), sys.gettrace(), []
    for line in itertools.count(1):
        left, is_done = line, False

        def trace(frame: FrameType, event: str, _: object) -> Any:
            nonlocal left, is_done
            is_done = is_done or (event == "return" and frame.f_code is app._run.__code__)
            if frame.f_code.co_filename != app.__file__:
                return trace
            if is_done and signal.getsignal(signal.SIGTERM) is not handler:
                left -= event == "line"
                if event == "line" and left == 0:
                    signal.raise_signal(signal.SIGTERM)
            return trace

        sys.settrace(trace)
        try:
            codes.append(main(["--version"]))
        finally:
            sys.settrace(tracer)
        assert signal.getsignal(signal.SIGTERM) is handler, line
        if left > 0:
            break
    capsys.readouterr()
    assert codes == [143] * (len(codes) - 1) + [0] and len(codes) > 1


def test_ctrl_c_leaves_old_files_as_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, out = write_scene(tmp_path), tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("mine", encoding="utf-8")
    failing(monkeypatch, KeyboardInterrupt())
    assert main(["estimate", str(scene), "--out", str(out), "--force", "--quiet"]) == 130
    assert [path.name for path in out.iterdir()] == ["report.html"]
    assert (out / "report.html").read_text(encoding="utf-8") == "mine"


def started(scene: Path, out: Path) -> subprocess.Popen[bytes]:
    """A run of the command that has claimed its files."""
    command = [sys.executable, "-m", "regionpose", "estimate", str(scene), "--out", str(out), *waiting.ARGUMENTS]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=waiting.FOLDER)
    end = time.monotonic() + START_S

    def has_claimed() -> bool:
        return any(claim.stat().st_size for claim in out.glob(".regionpose-*/claim"))

    while not has_claimed() and process.poll() is None and time.monotonic() < end:
        time.sleep(0.05)
    assert has_claimed(), "nothing claimed"
    return process


def test_sigterm_leaves_nothing_behind(tmp_path: Path) -> None:
    scene = write_waiting_scene(tmp_path)
    before = sorted(tmp_path.iterdir())
    process = started(scene, tmp_path / "out")
    process.terminate()
    assert process.wait(timeout=60) == 143
    assert sorted(tmp_path.iterdir()) == before


def test_what_a_killed_run_left_is_removed_by_the_next(tmp_path: Path) -> None:
    scene, out = write_waiting_scene(tmp_path), tmp_path / "out"
    process = started(scene, out)
    process.kill()
    process.wait(timeout=60)
    assert [path.name.startswith(".regionpose-") for path in out.iterdir()] == [True]
    write_files(out, {"a": text_writer("new")}, force=False)
    assert [path.name for path in out.iterdir()] == ["a"]


def test_of_two_runs_into_one_folder_one_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out = write_waiting_scene(tmp_path), tmp_path / "out"
    process = started(scene, out)
    try:
        with pytest.raises(FileExistsError, match=r"report\.html: found another run that is about to write it"):
            write_files(out, {"report.html": text_writer("other")}, force=True)
        assert write_files(out, {"notes.txt": text_writer("mine")}, force=False) == [out / "notes.txt"]
        other = run(capsys, "estimate", scene, "--out", out, "--force", "--quiet")
        assert other[:2] == (2, "") and "found another run that is about to write it" in other[2]
    finally:
        process.terminate()
        process.wait(timeout=60)
    assert [path.name for path in out.iterdir()] == ["notes.txt"]


def test_a_link_in_the_output_folder_is_replaced_and_not_followed(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine", encoding="utf-8")
    out = tmp_path / "out"
    out.mkdir()
    (out / "result.json").symlink_to(tmp_path / "mine.txt")
    write_files(out, {"result.json": text_writer("new")}, force=True)
    assert (tmp_path / "mine.txt").read_text(encoding="utf-8") == "mine"
    assert not (out / "result.json").is_symlink()


def test_a_link_in_the_place_of_a_dead_run_s_folder_is_not_followed(tmp_path: Path) -> None:
    mine, out = tmp_path / "mine", tmp_path / "out"
    mine.mkdir()
    out.mkdir()
    (mine / "notes.txt").write_text("mine", encoding="utf-8")
    (out / ".regionpose-x").symlink_to(mine)
    write_files(out, {"a": text_writer("new")}, force=False)
    assert (mine / "notes.txt").read_text(encoding="utf-8") == "mine"
    assert (out / "a").read_text(encoding="utf-8") == "new"


def test_an_output_folder_that_is_a_link_is_written_to(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "real")
    assert write_files(tmp_path / "out", {"a": text_writer("new")}, force=False) == [tmp_path / "out" / "a"]
    assert [path.name for path in (tmp_path / "real").iterdir()] == ["a"]


def test_files_are_written_for_a_reader_that_is_gone(tmp_path: Path) -> None:
    scene, out = write_scene(tmp_path), tmp_path / "out"
    command = [sys.executable, "-m", "regionpose", "estimate", str(scene), "--out", str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        assert b"Traceback" not in process.stderr.read()
    assert {"result.json", "report.html", "overlay.png"} <= {path.name for path in out.iterdir()}


def limited(scene: Path, out: Path, most: int) -> subprocess.CompletedProcess[str]:
    """A run of the command whose files may hold so many bytes each: what a full disk does, without one."""
    resource = pytest.importorskip("resource")
    command = [sys.executable, "-m", "regionpose", "estimate", str(scene), "--out", str(out), "--force", "--quiet"]
    limit = functools.partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most))
    return subprocess.run(command, capture_output=True, text=True, preexec_fn=limit)


@pytest.mark.slow
@pytest.mark.parametrize("most", [0, 100, 4096])
def test_what_the_disk_does_not_hold_leaves_the_old_files(most: int, tmp_path: Path) -> None:
    """Whatever file meets the limit first, a table or a picture."""
    scene, out = write_scene(tmp_path), tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("mine", encoding="utf-8")
    done = limited(scene, out, most)
    assert done.returncode == 2 and "file too large" in done.stderr.lower(), done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [path.name for path in out.iterdir()] == ["report.html"]
    assert (out / "report.html").read_text(encoding="utf-8") == "mine"


def test_region_names_stay_in_the_output_folder(tmp_path: Path) -> None:
    values = scene_values()
    for region, name in zip(values["regions"], ("../../x", "/etc/passwd"), strict=True):
        region["name"] = name
        region["image"] = {"seed": [20.0, 20.0]}
    scene = write_scene(tmp_path, values)
    before = {path for path in tmp_path.rglob("*")}
    assert main(["segment", str(scene), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    made = {path for path in tmp_path.rglob("*")} - before - {tmp_path / "out"}
    assert sorted(path.relative_to(tmp_path / "out").as_posix() for path in made) == [
        "01-x.png",
        "02-etc-passwd.png",
        "scene.yaml",
    ]


def test_a_full_disk_is_one_line_and_a_mistake_of_ours_is_raised(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from regionpose.io.clouds import MissingExtraError

    scene, out = write_scene(tmp_path), tmp_path / "out"
    expected = OSError(28, "No space left on device", "cloud.ply"), MissingExtraError("needed regionpose[las]")
    for error, line in zip(expected, ("cloud.ply: no space left on device", "needed regionpose[las]"), strict=True):
        failing(monkeypatch, error)
        code, said, err = run(capsys, "estimate", scene, "--out", out, "--quiet")
        assert (code, err) == (2, f"error: {line}\n") and "trusted: " in said and "written: " not in said
    for unexpected in (KeyError("pose"), ImportError("scipy is broken"), MemoryError()):
        failing(monkeypatch, unexpected)
        with pytest.raises(type(unexpected)):
            main(["estimate", str(scene), "--out", str(out), "--quiet"])
    assert not out.exists()
