"""Lines, log records and progress bars on standard error."""

import io
import logging
from pathlib import Path
from typing import Any

import pytest
from tqdm import tqdm

from conftest import Run
from running import write_drive
from vdet.cli.command import LOG, is_quiet, progress_bars


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    terminal = Terminal()

    class Bar(tqdm):  # type: ignore[type-arg]
        def __init__(self, **options: Any) -> None:
            super().__init__(file=terminal, mininterval=0, **options)

    monkeypatch.setattr("tqdm.tqdm", Bar)
    monkeypatch.setattr("vdet.cli.command._shows_bars", lambda: not is_quiet())
    return terminal


def test_each_step_ends_the_bar_of_the_one_before(terminal: Terminal) -> None:
    with progress_bars(" patches") as progress:
        progress("fitting", None)
        assert "fitting …" in terminal.getvalue()
        progress("describing", 3)(3)
    assert "fitting" not in terminal.getvalue().rpartition("\r")[2]
    assert "describing: 100%" in terminal.getvalue()
    assert "3/3" in terminal.getvalue()


FORGED = "a\x1b]0;title\x07\nvdet: all is well\u202e.mp4"
SHOWN = "a\\x1b]0;title\\x07\\nvdet: all is well\\u202e.mp4"


class TestNamesThatControlATerminal:
    """A name of a file can neither forge a line nor reach the terminal raw."""

    @pytest.mark.parametrize(("name", "shown"), [(FORGED, SHOWN), ("\udcff", "\\udcff")])
    def test_an_error(self, run: Run, tmp_path: Path, name: str, shown: str) -> None:
        result = run("detect-video", tmp_path / name, tmp_path / "out.mp4")
        assert result.err == f"vdet: {tmp_path}/{shown}: not found; check the name\n"

    def test_each_mistake_in_settings_has_a_line(self, run: Run, tmp_path: Path) -> None:
        path = tmp_path / FORGED
        path.write_text("tracker: {confirm_second: 3}\noutput: {crf: 99}\n")
        result = run("config", "-c", path)
        lines = result.err.splitlines()
        assert len(lines) == 2
        assert all(line.startswith(f"vdet: {tmp_path}/{SHOWN}:") for line in lines)

    def test_results_and_warnings_of_a_batch(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "in").mkdir()
        write_drive(tmp_path / "in" / FORGED, 2)
        (tmp_path / "in" / f"b{FORGED}").touch()
        arguments = ("detect-video", tmp_path / "in", "-d", tmp_path / "out", "--jobs", "1")
        done = run(*arguments).err.splitlines()
        assert len(done) == 3
        assert sum(SHOWN in line for line in done) == 2
        assert all(line.isprintable() for line in done)


def test_there_is_no_bar_with_quiet(terminal: Terminal) -> None:
    LOG.setLevel(logging.ERROR)
    with progress_bars("") as progress:
        progress("fitting", None)
    assert terminal.getvalue() == ""
