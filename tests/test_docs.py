"""The pages for users: links lead somewhere, and every command shown is understood."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest
from docs.commands import PAGE

from vdet.cli.command import cli
from vdet.cli.options import SettingsSource

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "data/README.md")),
    *sorted(ROOT.glob("docs/*.md")),
]
LONGEST_README = 120

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)#?([^)\s]*)\)")
COMMAND = re.compile(r"^ {4}(vdet .*)$|`(vdet [a-z-][^`…]*)`", re.MULTILINE)
TARGET = re.compile(r"(?:^ {4}|`)make ([a-z]+)", re.MULTILINE)


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def anchors_of(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as code hosts make them."""
    headings = re.findall(r"^#+ (.*)$", text_of(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


COMMANDS = [
    (name_of(page), line or span)
    for page in PAGES
    if page.name != "extending.md"  # its commands need its package: test_extending runs them
    for line, span in COMMAND.findall(text_of(page))
]


def check(words: list[str]) -> None:
    """Parse a command line without running it, and read its settings, unless it is only a name."""
    command: click.Command = cli
    context = click.Context(cli, info_name="vdet")
    while isinstance(command, click.Group):
        _, words, _ = command.make_parser(context).parse_args(words)
        if not words:
            return
        name, found, words = command.resolve_command(context, words)
        assert found is not None, name
        command, context = found, click.Context(found, info_name=name, parent=context)
    if not words:
        return
    values = command.make_context(command.name, words).params
    if set(values.get("configs", ())) <= {"default", "svm", "seed"}:  # others are the reader's own
        SettingsSource(values.get("configs", ()), values.get("assignments", ())).load()


def test_the_readme_is_short() -> None:
    assert len(text_of(ROOT / "README.md").splitlines()) <= LONGEST_README


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    for path, anchor in LINK.findall(text_of(page)):
        target = (page.parent / path).resolve() if path else page
        assert target.is_file(), path
        assert not anchor or anchor in anchors_of(target), f"{path}#{anchor}"


def test_the_readme_names_every_page() -> None:
    named = {path for path, _ in LINK.findall(text_of(ROOT / "README.md"))}
    assert {name_of(page) for page in PAGES[1:]} <= named


@pytest.mark.parametrize(("page", "line"), COMMANDS)
def test_every_command_shown_is_understood(page: str, line: str) -> None:
    words = shlex.split(line.partition(" > ")[0], comments=True)[1:]
    try:
        check(words)
    except click.UsageError as error:
        pytest.fail(f"{page}: {line}: {error.format_message()}")


def test_every_make_target_named_is_there() -> None:
    makefile = text_of(ROOT / "Makefile")
    for page in PAGES:
        for target in TARGET.findall(text_of(page)):
            assert f"\n{target}:" in makefile, f"{name_of(page)}: make {target}"


def test_packages_that_the_program_tells_to_install_are_those_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    known = {re.split("[<>=!]", requirement)[0] for group in groups for requirement in group}
    hints = [
        hint
        for path in (ROOT / "src").rglob("*.py")
        for hint in re.findall(r"pip install '?([^\n{'<]+?)[\n\".;'<]", text_of(path))
    ]
    assert hints
    assert {package for hint in hints for package in hint.split()} <= known
    texts = "".join(map(text_of, [*PAGES, *(ROOT / "src").rglob("*.py")]))
    extras = re.findall(r"vdet\[([a-z]+)\]", texts)
    assert set(extras) <= set(project["optional-dependencies"])


def test_the_page_of_commands_is_their_help() -> None:
    # In a process of its own: click keeps the help option that a command was first given.
    code = "from docs.commands import commands_page; print(commands_page(), end='')"
    made = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True)
    assert PAGE.read_text(encoding="utf-8") == made.stdout.decode(), "run make commands"
