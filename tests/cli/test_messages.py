"""Lines, log records and progress bars on standard error."""

import functools
import io
from pathlib import Path

import pytest
from tqdm import tqdm

from conftest import Run
from running import write_drive
from vdet.cli.messages import counted, files_bar


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    terminal = Terminal()
    bar = functools.partial(tqdm, file=terminal, mininterval=0)
    monkeypatch.setattr("vdet.cli.messages.tqdm", bar)
    return terminal


def test_a_batch_has_a_bar_over_files_with_the_rate_of_all_frames_and_the_time_left(
    terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    seconds = iter([100.0, 104.0, 110.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(seconds))
    with files_bar(4, quiet=False) as advance:
        advance(200)
        assert "50.0 frames/s" in terminal.getvalue()
        advance(400)
        last = terminal.getvalue().rpartition("\r")[2]
    assert "2/4" in last
    assert "60.0 frames/s" in last
    assert "<" in last  # tqdm's mark before the time that is left


FORGED = "a\x1b]0;title\x07\nvdet: all is well\u202e.mp4"
SHOWN = "a\\x1b]0;title\\x07\\nvdet: all is well\\u202e.mp4"


class TestNamesThatControlATerminal:
    """A name of a file can neither forge a line nor reach the terminal raw."""

    def test_an_error(self, run: Run, tmp_path: Path) -> None:
        result = run("detect-video", tmp_path / FORGED, tmp_path / "out.mp4")
        assert result.err == f"vdet: {tmp_path}/{SHOWN}: there is no such file; check the name\n"

    def test_each_mistake_in_settings_has_a_line(self, run: Run, tmp_path: Path) -> None:
        path = tmp_path / FORGED
        path.write_text("tracker: {neded: 3}\noutput: {crf: 99}\n")
        result = run("config", "-c", path)
        lines = result.err.splitlines()
        assert len(lines) == 2
        assert all(line.startswith(f"vdet: {tmp_path}/{SHOWN}:") for line in lines)

    def test_wrong_usage(self, run: Run) -> None:
        result = run("config", FORGED)
        assert result.code == 2
        assert SHOWN in result.err

    def test_results_and_warnings_of_a_batch(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "in").mkdir()
        write_drive(tmp_path / "in" / FORGED, 2)
        (tmp_path / "in" / f"b{FORGED}").touch()
        arguments = ("detect-video", tmp_path / "in", "-d", tmp_path / "out", "--jobs", "1")
        planned = run(*arguments, "--dry-run").out.splitlines()
        assert len(planned) == 2
        assert SHOWN in planned[0]
        done = run(*arguments).err.splitlines()
        assert len(done) == 3
        assert sum(SHOWN in line for line in done) == 2
        assert all(line.isprintable() for line in (*planned, *done))

    def test_a_name_that_is_no_utf_8(self, run: Run, tmp_path: Path) -> None:
        result = run("detect-video", tmp_path / "\udcff.mp4", tmp_path / "out.mp4")
        assert f"{tmp_path}/\\udcff.mp4: there is no such file" in result.err


def test_there_is_no_bar_with_quiet(terminal: Terminal) -> None:
    with files_bar(4, quiet=True) as advance:
        advance(200)
    assert terminal.getvalue() == ""


@pytest.mark.parametrize(("number", "text"), [(0, "0 files"), (1, "1 file"), (2, "2 files")])
def test_a_number_has_its_noun(number: int, text: str) -> None:
    assert counted(number, "file") == text
