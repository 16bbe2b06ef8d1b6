from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from vdet.config.loading import parse_assignment, parse_document, read_document
from vdet.errors import ConfigError

TEXTS = st.text(max_size=20)
WORDS = st.none() | st.booleans() | st.integers(-(2**63), 2**63) | TEXTS
VALUES: st.SearchStrategy[Any] = st.recursive(
    WORDS | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(TEXTS, inner, max_size=3),
    max_leaves=5,
)
MARKS = (
    *("a", "1", ":", ": ", "- ", "? ", "\n", " ", "{", "}", "[", "]", ",", "&a ", "*a", "!!x "),
    *("'", '"', "\\", "\\U", "\\x", "|", ">", "%", "%YAML ", "---", "...", "#", "\t", "\0", "é"),
)


@settings(max_examples=30)
@given(st.dictionaries(TEXTS, VALUES, max_size=3))
def test_plain_values_are_read_as_they_were_written(values: dict[str, Any]) -> None:
    assert parse_document(yaml.safe_dump(values), "my.yaml").values == values


@given(st.lists(st.sampled_from(MARKS), max_size=30).map("".join) | st.text())
def test_any_text_is_a_document_or_refused_line_by_line(text: str) -> None:
    try:
        document = parse_document(text, "my.yaml")
    except ConfigError as error:
        lines = str(error).split("\n")
        assert all(line.startswith("my.yaml:") and line.isprintable() for line in lines)
    else:
        assert isinstance(document.values, dict)
    try:
        parse_assignment(text)
    except ConfigError as error:
        assert str(error).startswith("assignments")  # noqa: PT017


def test_every_key_has_the_place_where_it_or_the_nearest_thing_around_it_stands() -> None:
    document = parse_document("a:\n  b: 1\n  c: [x, {d: 2}]\n", "my.yaml")
    assert document.values == {"a": {"b": 1, "c": ["x", {"d": 2}]}}
    places: dict[tuple[str | int, ...], str] = {
        ("a", "b"): "2:3",
        ("a", "c", 0): "3:7",
        ("a", "c", 1, "d"): "3:11",
        ("a", "x"): "1:1",
        ("x",): "1:1",
    }
    assert {key: document.position_of(key) for key in places} == {
        key: f"my.yaml:{place}" for key, place in places.items()
    }
    assert parse_assignment("a.b.c=1").position_of(("a",)) == "assignments"
    assert parse_document("", "empty.yaml").position_of(("a",)) == "empty.yaml"


@pytest.mark.parametrize(
    ("text", "values"),
    [
        *((text, {}) for text in ("", "\n", "# nothing\n", "---\n", "null", "{}")),
        ("a: 1e-3", {"a": 0.001}),
        ("a: 1E3", {"a": 1000.0}),
        ("a: .5e1", {"a": 5.0}),
        ("a: yes", {"a": "yes"}),
        ("a: ~", {"a": None}),
        ("a: ['0550', 0, 0.5, 0x1F]", {"a": ["0550", 0, 0.5, 31]}),
        ("1: a\ntrue: b\n<<: {c: 1}", {"1": "a", "true": "b", "<<": {"c": 1}}),
    ],
)
def test_scalars_are_those_of_yaml_with_exponents_and_all_keys_are_text(
    text: str, values: object
) -> None:
    assert parse_document(text, "my.yaml").values == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("words", "1:1: expected settings (key: value), got 'words'"),
        ("- a\n- b", "1:1: expected settings (key: value), got ['a', 'b']"),
        ("a: 1\nb: {c: 1, c: 2}\na: 3\n", "2:11: is not YAML: c appears twice; remove one"),
        ("? [a, b]\n: 1", "1:3: is not YAML: a sequence cannot be a key"),
        ("{a: 1}: 2", "1:1: is not YAML: a mapping cannot be a key"),
        ("a: 2001-99-99", "1:4: is not YAML: month must be in 1..12"),
        ("a: [1, 2", "1:9: is not YAML: "),
        *(
            (f"a: [0, {n}]", f"1:8: is not YAML: {n} is octal")
            for n in ("0550", "-010", "08", "00")
        ),
        *(
            (f"a: {text}", f"1:4: is not YAML: found character '{text[0]}' that cannot start")
            for text in ("%Y%m%d", "@gate", "`x`")
        ),
        ("a: 1\n b: 2", "2:3: is not YAML: mapping values are not allowed here"),
        ("--- 1\n--- 2", "2:1: is not YAML: but found another document"),
        ("%YAML 9.9\n---\na: 1", "1:1: is not YAML: found incompatible YAML document"),
    ],
)
def test_what_is_not_yaml_is_refused_where_it_goes_wrong(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_document(text, "my.yaml")
    assert str(error.value).startswith(f"my.yaml:{message}")
    assert "\n" not in str(error.value)


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "my.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\n")
    assert read_document(path).values == {"a": 1}


@pytest.mark.parametrize(
    ("text", "values"),
    [
        (" heat.blur = 3 # px", {"heat": {"blur": 3}}),
        ("train.svm.C=1e-3", {"train": {"svm": {"C": 0.001}}}),
        ("a=b=c", {"a": "b=c"}),
        ("heat={frames: 3, blur: 0}", {"heat": {"frames": 3, "blur": 0}}),
        ("heat=", {"heat": None}),
    ],
)
def test_an_assignment_is_a_document_of_one_key(text: str, values: object) -> None:
    assert parse_assignment(text).values == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        *(
            (text, f"assignments: {text}: expected KEY=VALUE, as in output.crf=18")
            for text in ("", "heat.frames", "=3", "heat..frames=3", ".a=1")
        ),
        ("heat=[", "assignments:1:2: is not YAML"),
        ("heat=*x", "assignments:1:1: is not YAML: aliases (*name) are not accepted; quote"),
        ("heat={a: 1, a: 2}", "assignments:1:8: is not YAML: a appears twice"),
        ("heat=\ud800", "assignments: is not YAML: unacceptable character"),
    ],
)
def test_an_assignment_needs_a_whole_key_and_a_value_in_yaml(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_assignment(text)
    assert str(error.value).startswith(message)
