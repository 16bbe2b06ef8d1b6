"""Settings → YAML text with a comment on every key, as `vdet config` prints it."""

import ast
import contextlib
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import get_args

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


def explanations(section: type[Section]) -> Mapping[str, str]:
    """Return what each key of a section means.

    It is the description of its field, or else the text below the field in the source. That is read
    here, and not by pydantic: parsing all sections would take a third of the start of a command.
    """
    found: dict[str, str] = {}
    for each in reversed(section.__mro__):
        if not issubclass(each, Section):
            continue
        with contextlib.suppress(OSError):  # its source is not there
            (kind,) = ast.parse(textwrap.dedent(inspect.getsource(each))).body
            for field, text in pairwise(kind.body if isinstance(kind, ast.ClassDef) else ()):
                match field, text:
                    case ast.AnnAssign(ast.Name(name)), ast.Expr(ast.Constant(str(words))):
                        found[name] = inspect.cleandoc(words)
    described = {name: field.description for name, field in section.model_fields.items()}
    return found | {name: text for name, text in described.items() if text}


def _section(section: Section, indent: str) -> Iterator[str]:
    texts = explanations(type(section))
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, Section):
            if not indent:
                yield ""
            yield from _comment(_first_line(type(value)), indent)
            yield f"{indent}{name}:"
            yield from _section(value, indent + "  ")
            continue
        yield from _comment(texts.get(name, ""), indent)
        if item := _item_section(field):
            yield from _item_keys(item, indent)
        # An item of a list says only what it has.
        plain = value if value is None else to_jsonable_python(value, exclude_none=True)
        style, width = None if isinstance(plain, list) else False, WIDTH - len(indent)
        text = yaml.safe_dump({name: plain}, default_flow_style=style, sort_keys=False, width=width)
        yield from textwrap.indent(text, indent).splitlines()


def _item_keys(item: type[Section], indent: str) -> Iterator[str]:
    what = _first_line(item)
    yield from _comment(f"Each item is {what[:1].lower()}{what[1:]}", indent)
    texts = explanations(item)
    for name in item.model_fields:
        key, rest = f"{indent}#   ", f"{indent}#     "
        yield from textwrap.wrap(
            f"{name}: {texts.get(name, '')}", WIDTH, initial_indent=key, subsequent_indent=rest
        )


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
