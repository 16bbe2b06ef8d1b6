"""Settings → YAML text with a comment on every key, as `vdet config` prints it."""

import textwrap
from collections.abc import Iterator
from typing import Any, get_args

import yaml
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from vdet.config.schema import Section, Settings

HEADING = "# vdet settings. `vdet config` prints the effective ones."
WIDTH = 100


def render(settings: Settings) -> str:
    """Write settings as YAML; reading the text gives the same settings again.

    Each key is preceded by what it means; the keys of list items stand before the list.
    """
    return "\n".join([HEADING, *_section(settings, "")]) + "\n"


def _section(section: Section, indent: str, *, comments: bool = True) -> Iterator[str]:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if value is None and not comments:  # an item says only what it has
            continue
        if isinstance(value, Section):
            if not indent:
                yield ""
            yield from _comment(_first_line(type(value)), indent)
            yield f"{indent}{name}:"
            yield from _section(value, indent + "  ")
        elif isinstance(value, dict) and value:
            yield from _comment(field.description or "", indent)
            yield f"{indent}{name}:"
            yield from (f"{indent}  {_scalar(key)}: {_scalar(each)}" for key, each in value.items())
        elif item := _item_section(field):
            yield from _comment(field.description or "", indent)
            yield from _item_keys(item, indent)
            yield f"{indent}{name}:" if value else f"{indent}{name}: []"
            yield from _items(value, indent + "  ")
        else:
            if comments and field.description:
                yield from _comment(field.description, indent)
            yield f"{indent}{name}: {_scalar(value)}"


def _item_keys(item: type[Section], indent: str) -> Iterator[str]:
    what = _first_line(item)
    yield from _comment(f"Each item is {what[:1].lower()}{what[1:]}", indent)
    for name, field in item.model_fields.items():
        key, rest = f"{indent}#   ", f"{indent}#     "
        yield from textwrap.wrap(
            f"{name}: {field.description}", WIDTH, initial_indent=key, subsequent_indent=rest
        )


def _items(items: tuple[Section, ...], indent: str) -> Iterator[str]:
    for item in items:
        first, *rest = _section(item, indent + "  ", comments=False)
        yield f"{indent}- {first.strip()}"
        yield from rest


def _item_section(field: FieldInfo) -> type[Section] | None:
    """Return the section that the items of a list are; None for any other field."""
    items = get_args(field.annotation)
    if items and isinstance(items[0], type) and issubclass(items[0], Section):
        return items[0]
    return None


def _first_line(section: type[Section]) -> str:
    return (section.__doc__ or "").partition("\n")[0]


def _comment(text: str, indent: str) -> list[str]:
    prefix = f"{indent}# "
    return textwrap.wrap(text, WIDTH, initial_indent=prefix, subsequent_indent=prefix)


def _scalar(value: Any) -> str:
    plain = to_jsonable_python(value)  # of a tuple a list, of a section a mapping
    text: str = yaml.safe_dump(plain, default_flow_style=True, width=10_000)
    return text.removesuffix("\n").removesuffix("...").strip()
