"""Settings → YAML text with a comment on every key, as `vdet config` prints it."""

import ast
import contextlib
import inspect
import textwrap
from collections.abc import Iterator, Mapping
from inspect import isclass
from itertools import pairwise
from typing import Any, get_args, get_origin

import yaml
from pydantic.fields import FieldInfo
from pydantic_core import to_jsonable_python

from vdet.config.loading import shapes_in
from vdet.config.scene import FRACTIONS, Shape
from vdet.config.schema import Section, Settings

HEADING = "# vdet settings. `vdet config` prints the effective ones."
WIDTH = 100


def render_settings(settings: Settings) -> str:
    """Write settings as YAML; reading the text gives the same settings again.

    Each key is preceded by what it means; the keys of list items stand before the list.
    """
    # An item says only what it has, and its size only if it differs from that of the file.
    values = to_jsonable_python(settings, exclude_none=True)
    for _, shape in shapes_in(values):
        if shape["size"] == list(settings.camera.size or FRACTIONS):
            del shape["size"]
    return "\n".join([HEADING, *_section(settings, values, "")]) + "\n"


def explanations(section: type[Section]) -> Mapping[str, str]:
    """Return what each key of a section means.

    It is the description of its field, or else the text below the field in the source. That is read
    here, and not by pydantic: parsing all sections would take a third of the start of a command.
    """
    texts: dict[str, str] = {}
    for item in reversed(section.__mro__):
        if not issubclass(item, Section):
            continue
        with contextlib.suppress(OSError):  # its source is not there
            (kind,) = ast.parse(textwrap.dedent(inspect.getsource(item))).body
            for field, text in pairwise(kind.body if isinstance(kind, ast.ClassDef) else ()):
                match field, text:
                    case ast.AnnAssign(ast.Name(name)), ast.Expr(ast.Constant(str(words))):
                        texts[name] = inspect.cleandoc(words)
    described = {name: field.description for name, field in section.model_fields.items()}
    return texts | {name: text for name, text in described.items() if text}


def _section(section: Section, values: Mapping[str, Any], indent: str) -> Iterator[str]:
    texts = explanations(type(section))
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if name == "size" and isinstance(section, Shape) and name not in values:
            continue
        if not indent:
            yield ""
        if isinstance(value, Section):
            yield from _comment(_first_line(type(value)), indent)
            yield f"{indent}{name}:"
            yield from _section(value, values[name], indent + "  ")
            continue
        for paragraph in texts.get(name, "").split("\n\n"):
            yield from _comment(paragraph, indent)
        yield from _item_keys(field, indent)
        plain = values.get(name)
        style, width = None if isinstance(plain, list) else False, WIDTH - len(indent)
        text = yaml.safe_dump({name: plain}, default_flow_style=style, sort_keys=False, width=width)
        yield from textwrap.indent(text, indent).splitlines()


def _item_keys(field: FieldInfo, indent: str) -> Iterator[str]:
    """Yield comments on the keys of the sections in a list, or of a section that may be null."""
    for item in get_args(field.annotation):
        if not (isclass(item) and issubclass(item, Section)):
            continue
        subject = "Each item" if get_origin(field.annotation) is tuple else "It"
        title = _first_line(item)
        yield from _comment(f"{subject} is {title[:1].lower()}{title[1:]}", indent)
        texts = explanations(item)
        for name in item.model_fields:
            if name == "size" and issubclass(item, Shape):
                continue  # explained at camera.size
            yield from textwrap.wrap(
                f"{name}: {texts.get(name, '')}",
                WIDTH,
                initial_indent=f"{indent}#   ",
                subsequent_indent=f"{indent}#     ",
            )


def _first_line(section: type[Section]) -> str:
    return (section.__doc__ or "").partition("\n")[0]


def _comment(text: str, indent: str) -> list[str]:
    prefix = f"{indent}# "
    return textwrap.wrap(text, WIDTH, initial_indent=prefix, subsequent_indent=prefix)
