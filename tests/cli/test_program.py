"""The program as a whole: help, versions, errors as text, exit codes."""

import logging
import re
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

import vdet
from conftest import Run
from vdet.cli.messages import print_lines


def test_the_version_is_that_at_the_top_of_the_changelog(run: Run) -> None:
    assert run("--version").out == f"vdet, version {vdet.__version__}\n"
    changelog = Path(__file__).parents[2] / "CHANGELOG.md"
    assert re.findall("^## (.*)", changelog.read_text("utf-8"), re.MULTILINE)[0] == vdet.__version__


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


def test_another_package_adds_a_command_and_a_broken_one_breaks_only_itself(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    @click.command()
    def hello() -> None:
        print_lines("hello from outside")

    points = [
        EntryPoint(name, f"{module}:hello", "vdet.commands")
        for name, module in (("hello", "their_package"), ("broken", "no_such_package"))
    ]

    def entry_points(group: str, name: str | None = None) -> list[EntryPoint]:
        return [point for point in points if point.group == group and name in (None, point.name)]

    monkeypatch.setattr("vdet.plugins.entry_points", entry_points)
    monkeypatch.setitem(sys.modules, "their_package", SimpleNamespace(hello=hello))
    listed = run("--help").out
    assert "  hello " in listed
    assert "  broken " in listed
    assert run("hello").out == "hello from outside\n"
    broken = run("broken")
    assert (broken.code, broken.err.count("\n")) == (1, 1)
    assert "broken: no_such_package:hello cannot be loaded" in broken.err
    assert run("config").code == 0
