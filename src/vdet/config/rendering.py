"""Settings → YAML text with a comment on every key, as `vdet config` prints it."""

import textwrap
from collections.abc import Iterator
from typing import Any, get_args

import yaml
from pydantic.fields import FieldInfo

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
        elif item := _kind_of_items(field):
            yield from _comment(f"{field.description}: {_first_line(item)}", indent)
            yield f"{indent}{name}:" if value else f"{indent}{name}: []"
            yield from _items(item, value, indent + "  ")
        else:
            if comments and field.description:
                yield from _comment(field.description, indent)
            yield f"{indent}{name}: {_scalar(value)}"


def _items(kind: type[Section], items: tuple[Section, ...], indent: str) -> Iterator[str]:
    for name, field in kind.model_fields.items():
        yield from _comment(f"{name}: {field.description}", indent)
    for item in items:
        first, *rest = _section(item, indent + "  ", comments=False)
        yield f"{indent}- {first.strip()}"
        yield from rest


def _kind_of_items(field: FieldInfo) -> type[Section] | None:
    """Return what a list of sections holds; None for any other field."""
    kinds = get_args(field.annotation)
    if kinds and isinstance(kinds[0], type) and issubclass(kinds[0], Section):
        return kinds[0]
    return None


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
