"""Settings → YAML text with a comment on every key, as `vdet config` prints it."""

import textwrap
from collections.abc import Iterator
from typing import Any

import yaml

from vdet.config.schema import Section, Settings

WIDTH = 100


def render(settings: Settings) -> str:
    """Write settings as YAML; reading the text gives the same settings again.

    Each key is preceded by what it means; a key of a list item only where it first appears.
    """
    heading = "# vdet settings. `vdet config` prints the effective ones."
    return "\n".join([heading, "", *_section(settings, "")]) + "\n"


def _section(section: Section, indent: str, *, comments: bool = True) -> Iterator[str]:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if value is None:
            continue
        if isinstance(value, Section):
            if not indent:
                yield ""
            yield from _comment(_first_line(type(value)), indent)
            yield f"{indent}{name}:"
            yield from _section(value, indent + "  ")
        elif _is_list_of_sections(value):
            yield from _comment(f"{field.description}: {_first_line(type(value[0]))}", indent)
            yield f"{indent}{name}:"
            yield from _items(value, indent + "  ")
        else:
            if comments and field.description:
                yield from _comment(field.description, indent)
            yield f"{indent}{name}: {_scalar(value)}"


def _items(items: tuple[Section, ...], indent: str) -> Iterator[str]:
    for name, field in type(items[0]).model_fields.items():
        yield from _comment(f"{name}: {field.description}", indent)
    for item in items:
        first, *rest = _section(item, indent + "  ", comments=False)
        yield f"{indent}- {first.strip()}"
        yield from rest


def _is_list_of_sections(value: object) -> bool:
    return isinstance(value, tuple) and bool(value) and isinstance(value[0], Section)


def _first_line(section: type[Section]) -> str:
    return (section.__doc__ or "").partition("\n")[0]


def _comment(text: str, indent: str) -> list[str]:
    prefix = f"{indent}# "
    return textwrap.wrap(text, WIDTH, initial_indent=prefix, subsequent_indent=prefix)


def _scalar(value: Any) -> str:
    if isinstance(value, tuple):
        value = list(value)
    text: str = yaml.safe_dump(value, default_flow_style=True, width=10_000)
    return text.removesuffix("\n").removesuffix("...").strip()
