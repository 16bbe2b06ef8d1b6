from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from vdet.config.document import (
    Document,
    parse_assignment,
    parse_document,
    read_document,
)
from vdet.errors import ConfigError


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as error:
        parse_document(text, "my.yaml")
    return str(error.value)


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


@settings(max_examples=50)
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


def test_every_key_has_the_place_where_it_stands() -> None:
    document = parse_document("a:\n  b: 1\n  c: [x, {d: 2}]\n", "my.yaml")
    assert document.values == {"a": {"b": 1, "c": ["x", {"d": 2}]}}
    assert document.places == {
        (): "my.yaml:1:1",
        ("a",): "my.yaml:1:1",
        ("a", "b"): "my.yaml:2:3",
        ("a", "c"): "my.yaml:3:3",
        ("a", "c", 0): "my.yaml:3:7",
        ("a", "c", 1): "my.yaml:3:10",
        ("a", "c", 1, "d"): "my.yaml:3:11",
    }


def test_a_place_is_that_of_the_key_or_of_the_nearest_thing_in_or_around_it() -> None:
    document = parse_document("a:\n  b:\n    c: 1\nd: 2\n", "my.yaml")
    assert document.place_of(("a", "b")) == "my.yaml:2:3"
    assert document.place_of(("a", "x")) == "my.yaml:1:1"
    assert document.place_of(("x",)) == "my.yaml:1:1"
    within = Document("--set", {}, {("a", "b", "c"): "--set"})
    assert within.place_of(("a",)) == "--set"
    assert Document("empty.yaml", {}).place_of(("a",)) == "empty.yaml"


@pytest.mark.parametrize("text", ["", "\n", "# nothing\n", "---\n", "null", "{}"])
def test_an_empty_document_is_no_settings_at_all(text: str) -> None:
    assert parse_document(text, "my.yaml").values == {}


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e-3", 0.001), ("1E3", 1000.0), ("-2e+5", -2e5), (".5e1", 5.0), ("1.0e-3", 0.001)],
)
def test_a_number_with_an_exponent_is_a_number(text: str, value: float) -> None:
    assert parse_document(f"a: {text}", "my.yaml").values == {"a": value}


@pytest.mark.parametrize(
    ("text", "value"), [("yes", True), ("off", False), ("0x10", 16), ("~", None), ("1:30", 90)]
)
def test_the_other_scalars_are_those_of_yaml_1_1(text: str, value: object) -> None:
    assert parse_document(f"a: {text}", "my.yaml").values == {"a": value}


def test_all_keys_are_text() -> None:
    assert parse_document("1: a\ntrue: b\n<<: {c: 1}", "my.yaml").values == {
        "1": "a",
        "true": "b",
        "<<": {"c": 1},
    }


def test_a_key_given_twice_is_refused_where_it_stands_the_second_time() -> None:
    assert refusal("a: 1\nb: {c: 1, c: 2}\na: 3\n") == (
        "my.yaml:2:11: c: appears twice; remove one"
    )


@pytest.mark.parametrize("text", ["3", "words", "[1, 2]", "- a\n- b"])
def test_a_document_that_is_no_mapping_is_refused(text: str) -> None:
    assert refusal(text).startswith("my.yaml:1:1: expected settings (key: value), got ")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: [1, 2", "my.yaml:1:9: is not YAML: "),
        ("a: 1\n b: 2", "my.yaml:2:3: is not YAML: mapping values are not allowed here"),
        ("\ta: 1", "my.yaml:1:1: is not YAML: found character '\\t' that cannot start any token"),
        ('a: "open', "my.yaml:1:9: is not YAML: "),
        ("--- 1\n--- 2", "my.yaml:2:1: is not YAML: but found another document"),
        ("a: \x00", "my.yaml: is not YAML: unacceptable character #x0000: "),
        ("%YAML 9.9\n---\na: 1", "my.yaml:1:1: is not YAML: found incompatible YAML document"),
        ("a: @b", "my.yaml:1:4: is not YAML: "),
    ],
)
def test_what_is_not_yaml_is_refused_where_it_goes_wrong(text: str, message: str) -> None:
    answer = refusal(text)
    assert answer.startswith(message)
    assert "\n" not in answer


@pytest.mark.parametrize("text", ["? [a, b]\n: 1", "? {a: b}\n: 1", "[a]: 1", "{a: 1}: 2"])
def test_a_key_that_is_a_collection_is_refused(text: str) -> None:
    assert "expected a key, got a " in refusal(text)


def test_a_byte_order_mark_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "my.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\n")
    assert read_document(path).values == {"a": 1}


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("tracker.history=12", {"tracker": {"history": 12}}),
        (" heat.blur = 3 # px", {"heat": {"blur": 3}}),
        ("detector.heat.frames=3", {"detector": {"heat": {"frames": 3}}}),
        ("train.svm.C=1e-3", {"train": {"svm": {"C": 0.001}}}),
        ("a=b=c", {"a": "b=c"}),
        ("heat={frames: 3, blur: 0}", {"heat": {"frames": 3, "blur": 0}}),
        ("features.halved=[0, 2]", {"features": {"halved": [0, 2]}}),
        ("heat=", {"heat": None}),
    ],
)
def test_an_assignment_is_a_document_of_one_key(text: str, values: object) -> None:
    assert parse_assignment(text).values == values


@pytest.mark.parametrize("text", ["", "=", "heat", "heat.frames", "=3", "heat..frames=3", ".a=1"])
def test_an_assignment_without_a_whole_key_or_value_says_what_is_expected(text: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_assignment(text)
    assert str(error.value) == f"--set {text}: expected KEY=VALUE, as in output.crf=18"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("heat=[", "--set:1:2: is not YAML"),
        ("heat=*x", "--set:1:1: is not YAML: aliases"),
        ("heat=!!int 3", "--set:1:1: is not YAML: tags"),
        ("heat={a: 1, a: 2}", "--set:1:8: a: appears twice"),
        ("heat=2001-99-99", "--set:1:1: cannot be understood"),
        ("heat=\ud800", "--set: is not YAML: unacceptable character"),
    ],
)
def test_the_value_of_an_assignment_is_yaml(text: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse_assignment(text)
    assert str(error.value).startswith(message)
