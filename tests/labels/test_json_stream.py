"""Lists of a JSON document, read in pieces of any size."""

import io
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdet.labels import json_stream
from vdet.labels.json_stream import JsonLists

scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
values = st.recursive(
    scalars, lambda each: st.lists(each) | st.dictionaries(st.text(), each), max_leaves=8
)
documents = st.dictionaries(st.sampled_from(["images", "ännotations", "info"]), values, min_size=1)


@given(documents, st.integers(1, 40), st.sampled_from([None, 1]), st.booleans())
def test_entries_do_not_depend_on_the_pieces(
    document: dict[str, object], chunk: int, indent: int | None, escaped: bool
) -> None:
    text = json.dumps(document, indent=indent, ensure_ascii=escaped)
    lists = JsonLists(io.BytesIO(text.encode("utf-8-sig")))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(json_stream, "_CHUNK", chunk)
        found = [
            (name, number, json.loads(entry))
            for name, number, entry in lists.entries({"images", "ännotations"})
        ]
    wanted = {
        name: each if isinstance(each, list) else [each]
        for name, each in document.items()
        if name != "info" and isinstance(each, list | dict)
    }
    assert lists.found == {name for name in wanted if isinstance(document[name], list)}
    assert found == [
        (name, n, each) for name, them in wanted.items() for n, each in enumerate(them)
    ]
