"""What a page knows of its video, as data in the page: pages over many videos are made from it."""

import re
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vdet.errors import OutputError

_BLOCK = re.compile(r'<script type="application/json" id="vdet">(.*?)</script>', re.DOTALL)


class Facts(BaseModel):
    """A video in numbers; `still` is a small picture as a data URI.

    `seconds` is how much of the video was searched, `most` how many vehicles were shown at once.
    `counts` are by name.
    """

    model_config = ConfigDict(frozen=True)

    seconds: float = Field(ge=0)
    frames: int = Field(ge=0)
    vehicles: int = Field(ge=0)
    most: int = Field(ge=0)
    still: str = Field(pattern=r"^data:image/jpeg;base64,[A-Za-z0-9+/=]*$")
    counts: dict[str, int] = {}


def facts_html(facts: Facts) -> str:
    """Return the data as a part of a page that is not shown."""
    text = facts.model_dump_json().replace("<", "\\u003c")
    return f'<script type="application/json" id="vdet">{text}</script>\n'


def read_facts(page: Path) -> Facts:
    """Return what a page knows. Raises `OutputError` if it is no page of a video."""
    try:
        found = _BLOCK.search(page.read_text(encoding="utf-8"))
        if found:
            return Facts.model_validate_json(found.group(1))
    except (UnicodeDecodeError, ValidationError) as error:
        raise _refused(page) from error
    raise _refused(page)


def _refused(page: Path) -> OutputError:
    return OutputError(f"{page}: is no page of vdet on a video; remove it, and run again")
