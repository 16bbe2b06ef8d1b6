"""The program as a whole: help, versions, errors as text, exit codes."""

import logging
from pathlib import Path

import pytest

import vdet
from conftest import Run


def test_help_lists_every_command(run: Run) -> None:
    result = run("--help")
    assert result.code == 0
    for command in ("train", "detect-image", "detect-video", "config", "demo"):
        assert command in result.out


def test_version(run: Run) -> None:
    assert vdet.__version__ in run("--version").out


def test_unknown_command_is_wrong_usage(run: Run) -> None:
    result = run("detekt-video")
    assert result.code == 2
    assert "No such command" in result.err


def test_an_error_is_one_line_without_traceback(run: Run, tmp_path: Path) -> None:
    result = run("detect-video", tmp_path / "none.mp4", tmp_path / "out.mp4")
    assert result.code == 1
    assert result.err.count("\n") == 1
    assert result.err.startswith("vdet: ")
    assert "Traceback" not in result.err


def test_debug_shows_the_traceback(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VDET_DEBUG", "1")
    result = run("info", tmp_path / "none.mp4")
    assert result.code == 1
    assert "Traceback" in result.err


def test_an_interrupt_ends_with_130(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("vdet.config.rendering.render", interrupt)
    result = run("config")
    assert result.code == 130
    assert "interrupted" in result.err


def test_a_bug_is_one_line_too(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("two\nlines")

    monkeypatch.setattr("vdet.config.rendering.render", fail)
    result = run("config")
    assert result.code == 1
    assert result.err.count("\n") == 1
    assert "internal error, please report it (RuntimeError: two lines)" in result.err


@pytest.mark.parametrize("quiet", [("-q", "config"), ("config", "-q"), ("config", "--quiet")])
def test_quiet_and_verbose_work_before_and_after_the_command(
    run: Run, quiet: tuple[str, ...]
) -> None:
    assert run(*quiet).code == 0
    assert logging.getLogger("vdet").level == logging.ERROR
    assert run("config", "-v").code == 0
    assert logging.getLogger("vdet").level == logging.DEBUG
    assert run("-q", "config", "-v").code == 0
    assert logging.getLogger("vdet").level == logging.ERROR


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--frames", 10**30), "'--frames'"),
        (("--threads", 10**30), "'--threads'"),
        (("--start", "999999999:00:00"), "is more than 10,000 hours"),
        (("--end", "999999999:00:00"), "is more than 10,000 hours"),
    ],
)
def test_numbers_that_are_too_large_are_wrong_usage(
    run: Run, options: tuple[str, object], words: str
) -> None:
    result = run("detect-video", "in.mp4", "out.mp4", *map(str, options))
    assert (result.code, words in result.err) == (2, True)
    assert run("eval", "tracks", "a.txt", "b.txt", "--until", str(10**30)).code == 2
