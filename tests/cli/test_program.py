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
from vdet.cli.command import print_lines


def test_the_version_is_that_of_the_last_release_in_the_changelog(run: Run) -> None:
    """`--skip-existing` makes the outputs of another version again."""
    assert run("--version").out == f"vdet, version {vdet.__version__}\n"
    changelog = (Path(__file__).parents[2] / "CHANGELOG.md").read_text("utf-8")
    assert vdet.__version__ == re.findall(r"^## (\S+) \(", changelog, re.MULTILINE)[0]


def test_debug_shows_the_traceback(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VDET_DEBUG", "1")
    result = run("info", tmp_path / "none.mp4")
    assert result.code == 1
    assert "Traceback" in result.err


@pytest.mark.parametrize("quiet", [("-q", "config"), ("config", "-q"), ("config", "--quiet")])
def test_quiet_and_verbose_work_before_and_after_the_command(
    run: Run, quiet: tuple[str, ...]
) -> None:
    run(*quiet, code=0)
    assert logging.getLogger("vdet").level == logging.ERROR
    run("config", "-v", code=0)
    assert logging.getLogger("vdet").level == logging.DEBUG
    run("-q", "config", "-v", code=0)
    assert logging.getLogger("vdet").level == logging.ERROR


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
    run("config", code=0)
