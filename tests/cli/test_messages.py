"""Lines, log records and progress bars on standard error."""

import functools
import io

import pytest
from tqdm import tqdm

from vdet.cli.messages import files_bar


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


def test_there_is_no_bar_with_quiet(terminal: Terminal) -> None:
    with files_bar(4, quiet=True) as advance:
        advance(200)
    assert terminal.getvalue() == ""
