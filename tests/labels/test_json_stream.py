"""Lists of a JSON document, read in pieces of any size."""

import io
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from vdet.labels import json_stream
from vdet.labels.json_stream import JsonLists

KINDS = dict.fromkeys(("images", "ännotations", "data.boxes"), TypeAdapter[Any](Any))
scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
values = st.recursive(
    scalars, lambda each: st.lists(each) | st.dictionaries(st.text(), each), max_leaves=8
)
documents = st.fixed_dictionaries(
    {"info": values, "data": st.just(0) | st.dictionaries(st.sampled_from(["boxes", "b"]), values)},
    optional={"images": values, "ännotations": values},
)


@given(documents, st.integers(1, 40), st.sampled_from([None, 1]), st.booleans())
def test_entries_do_not_depend_on_the_pieces(
    document: dict[str, Any], chunk: int, indent: int | None, escaped: bool
) -> None:
    text = json.dumps(document, indent=indent, ensure_ascii=escaped)
    lists = JsonLists(io.BytesIO(text.encode("utf-8-sig")).read, KINDS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(json_stream, "_CHUNK", chunk)
        found = list(lists)
    flat = dict(document)
    if inner := flat.pop("data"):
        flat |= {f"data.{name}": value for name, value in inner.items()}
    wanted = {name: value for name, value in flat.items() if name in KINDS}
    assert lists.found == {name for name, value in wanted.items() if isinstance(value, list)}
    assert sorted(found, key=str) == sorted(
        [
            (name, number, each)
            for name, value in wanted.items()
            if isinstance(value, list | dict)
            for number, each in enumerate(value if isinstance(value, list) else [value])
        ],
        key=str,
    )
