from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vdet.config.loading import LoadedSettings, format_key, load_settings
from vdet.config.schema import FeatureSettings, Settings, WindowSettings
from vdet.errors import ConfigError

WINDOWS = """\
search:
  windows:
  - {size: 64, step: 1, top: 0, bottom: 100}
  - {size: 96, step: 1, top: 0, bottom: 200}
"""
FIRST = WindowSettings(size=64, step=1, top=0, bottom=100)
SECOND = WindowSettings(size=96, step=1, top=0, bottom=200)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "my.yaml"


def load(path: Path, text: str, *assignments: str) -> LoadedSettings:
    path.write_text(text, encoding="utf-8")
    return load_settings(path, assignments)


def refusal(path: Path, text: str, *assignments: str) -> list[str]:
    """Give the lines of the error, the file's folder left out."""
    with pytest.raises(ConfigError) as error:
        load(path, text, *assignments)
    return str(error.value).replace(f"{path.parent}/", "").split("\n")


def test_without_file_and_assignments_the_settings_are_the_defaults() -> None:
    assert load_settings() == LoadedSettings(Settings(), None)


def test_an_empty_file_changes_nothing(path: Path) -> None:
    assert load(path, "") == LoadedSettings(Settings(), None)


def test_a_file_changes_what_it_names_and_nothing_else(path: Path) -> None:
    loaded = load(path, "heat:\n  frames: 5\ntraining: {C: 1e-3}\n").settings
    expected = Settings.model_validate({"heat": {"frames": 5}, "training": {"C": 0.001}})
    assert loaded == expected
    assert loaded.heat.threshold == Settings().heat.threshold


def test_assignments_lie_over_the_file_and_later_ones_over_earlier_ones(path: Path) -> None:
    heat = load(
        path, "detector.heat: {frames: 5, blur: 7, threshold: 2}", "detector.heat.frames=6", "detector.heat.blur=8",
        "detector.heat.frames=7",
    ).settings.heat  # fmt: skip
    assert (heat.frames, heat.blur, heat.threshold) == (7, 8, 2.0)


def test_a_list_in_a_file_replaces_the_whole_default_list(path: Path) -> None:
    search = load(path, "detector.search: {perspective: {sizes: [0.5]}}").settings.search
    assert len(Settings().search.perspective.sizes) > 1
    assert search.perspective.sizes == (0.5,)


def test_a_list_in_an_assignment_replaces_the_whole_list_in_the_file(path: Path) -> None:
    window = "{size: 32, step: 2, top: 0, bottom: 50}"
    windows = load(path, WINDOWS, f"search.windows=[{window}]").settings.search.windows
    assert windows == (WindowSettings(size=32, step=2, top=0, bottom=50),)


def test_an_assignment_may_name_one_item_of_a_list() -> None:
    sizes = load_settings(None, ["detector.search.perspective.sizes.1=0.07"])
    first, _, *others = Settings().search.perspective.sizes
    assert sizes.search.perspective.sizes == (first, 0.07, *others)


def test_an_assignment_may_name_one_setting_of_an_item(path: Path) -> None:
    windows = load(path, WINDOWS, "detector.search.windows.1.step=2").settings.search.windows
    assert windows == (FIRST, SECOND.model_copy(update={"step": 2}))


def test_an_assignment_may_give_overlap_in_place_of_step(path: Path) -> None:
    assignments = ["detector.search.windows.0.overlap=0.5", "detector.search.windows.0.step=null"]
    window = load(path, WINDOWS, *assignments).settings.search.windows[0]
    assert (window.overlap, window.step) == (0.5, None)


def test_an_assignment_may_replace_a_whole_item(path: Path) -> None:
    item = "{size: 64, step: 3, top: 0, bottom: 70}"
    windows = load(path, WINDOWS, f"search.windows.0={item}").settings.search.windows
    assert windows == (WindowSettings(size=64, step=3, top=0, bottom=70), SECOND)


@pytest.mark.parametrize(
    ("text", "assignments"),
    [("detector.features: {color_space: HSV}", []), ("", ["detector.features.color_space=HSV"])],
)
def test_features_are_told_apart_where_they_are_asked_for(
    path: Path, text: str, assignments: list[str]
) -> None:
    assert load(path, text, *assignments).features == FeatureSettings(color_space="HSV")


def test_features_asked_for_as_they_are_by_default_are_asked_for(path: Path) -> None:
    assert load(path, "detector.features: {patch: 32}").features == FeatureSettings()


def test_features_are_not_asked_for_by_other_settings(path: Path) -> None:
    assert load(path, "detector.heat: {frames: 3}", "tracker.history=3").features is None


def test_an_error_names_file_line_column_key_and_what_was_expected(path: Path) -> None:
    text = "search:\n  windows:\n    - {size: 64, overlap: 1.2, top: 0, bottom: 100}\n"
    assert refusal(path, text) == [
        "my.yaml:3:18: search.windows[0].overlap: should be less than 1 (got 1.2)"
    ]


def test_all_errors_are_given_at_once(path: Path) -> None:
    text = "detector.heat: {frames: 0, blur: -1}\ntraining:\n  C: -1\ntrakcer: {}\n"
    assert sorted(refusal(path, text, "output.crf=99", "nonsense")) == [
        "--set nonsense: expected KEY=VALUE, as in tracker.history=12",
        "--set: output.crf: should be less than or equal to 51 (got 99)",
        "my.yaml:1:19: heat.blur: should be greater than or equal to 0 (got -1)",
        "my.yaml:1:8: heat.frames: should be greater than or equal to 1 (got 0)",
        "my.yaml:3:3: training.C: should be greater than 0 (got -1)",
        "my.yaml:4:1: trakcer: is no setting; did you mean tracker?",
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("tracker: {histroy: 3}", "1:11: tracker.histroy: is no setting; did you mean history?"),
        (
            "detector.heat: {x: 3}",
            "1:8: heat.x: is no setting; known here: frames, weight, shrink, ",
        ),
        (
            "detector.features: {hog: {cel: 3}}",
            "1:18: features.hog.cel: is no setting; did you mean cell?",
        ),
        ("detector.heat: 3", "1:1: heat: should be a section, key: value (got 3)"),
        (
            "detector.heat: {frames: 2001-01-01}",
            "1:8: heat.frames: should be a valid integer (got datetime",
        ),
        (
            "detector.heat: {threshold: .nan}",
            "1:8: heat.threshold: should be a finite number (got nan)",
        ),
        (
            "detector.heat: {threshold: 1e999}",
            "1:8: heat.threshold: should be a finite number (got inf)",
        ),
        (
            "detector.heat: {threshold: -.inf}",
            "1:8: heat.threshold: should be a finite number (got -inf)",
        ),
        (
            "detector.heat: {frames: 2.5}",
            "1:8: heat.frames: should be a valid integer, got a number with a",
        ),
        (
            "detector.features: {color_space: BGR}",
            "1:12: features.color_space: should be 'YCrCb', 'HSV', ",
        ),
        (
            "detector.features: {patch: 62}",
            "1:1: features: patch must be a multiple of hog.cell (4)",
        ),
        (
            "detector.features: {hog: {block: 8, cell: 16}}",
            "1:1: features: hog.block × hog.cell must not",
        ),
        (
            "detector.features: {hog: {channels: [0, 0]}}",
            "1:12: features.hog: channels must differ",
        ),
        (
            "detector.features: {hog: {channels: []}, histogram: {bins: 0}}",
            "1:1: features: at least one of hog, histogram and spatial must be on",
        ),
        (
            "detector.search: {windows: [], perspective: {sizes: []}}",
            "1:1: search: windows or perspective.sizes must be given",
        ),
        (
            "detector.search: {windows: [5]}",
            "1:20: search.windows[0]: should be a section, key: value",
        ),
        ("detector.search: {windows: 5}", "1:10: search.windows: should be a list"),
        (
            "detector.search: {windows: [{size: 64, overlap: 0.8, top: 0, bottom: 63}]}",
            "1:20: search.windows[0]: bottom must be at least top + size",
        ),
        (
            "detector.search: {windows: [{size: 64, overlap: 0.99, top: 0, bottom: 64}]}",
            "1:20: search.windows[0]: overlap leaves a step of less than a pixel",
        ),
        (
            "detector.search: {windows: [{size: 64, top: 0, bottom: 64}]}",
            "1:20: search.windows[0]: one of overlap and step must be given, the other left out",
        ),
        (
            "detector.search: {windows: [{size: 64, overlap: 0.5, step: 1, top: 0, bottom: 64}]}",
            "1:20: search.windows[0]: one of overlap and step must be given, the other left out",
        ),
        (
            "detector.search: {windows: [{size: 64, step: 0, top: 0, bottom: 64}]}",
            "1:31: search.windows[0].step: should be greater than or equal to 1 (got 0)",
        ),
        ("detector.heat: {shrink: 3}", "1:8: heat.shrink: should be 1, 2, 4 or 8 (got 3)"),
        (
            "detector.heat: {weight: some}",
            "1:8: heat.weight: should be 'none' or 'coverage' (got 'some')",
        ),
        (
            "detector.search: {engine: fast}",
            "1:10: search.engine: should be 'auto', 'dense' or 'patch' (go",
        ),
        ("'': 1", "1:1: : is no setting; known here: reference_height, features, "),
    ],
)
def test_a_mistake_is_explained_in_one_line(path: Path, text: str, message: str) -> None:
    (line,) = refusal(path, text)
    assert line.startswith(f"my.yaml:{message}")


def test_each_missing_key_of_an_item_is_named(path: Path) -> None:
    assert refusal(path, "detector.search: {windows: [{size: 64, step: 1}]}") == [
        "my.yaml:1:20: search.windows[0].top: is missing",
        "my.yaml:1:20: search.windows[0].bottom: is missing",
    ]


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("detector.heat.frames=x", "detector.heat.frames: should be a valid integer"),
        ("detector.heat.frames.0=5", "detector.heat.frames: should be a valid integer"),
        (
            "detector.search.perspective.sizes.7=0.3",
            "detector.search.perspective.sizes: should be a list, or in",
        ),
        (
            "search.perspective.sizes.-1=0.3",
            "detector.search.perspective.sizes: should be a list, or in",
        ),
        (
            "detector.search.perspective.sizes.x=0.3",
            "detector.search.perspective.sizes: should be a list, or in",
        ),
        (
            "detector.search.perspective.sizes.0=3",
            "search.perspective.sizes[0]: should be less than or equ",
        ),
        (
            "detector.search.windows.0.size=64",
            "detector.search.windows: should be a list, or in --set the number of",
        ),
        ("tracker.0=3", "tracker[0]: is no setting; known here: method, history, "),
        ("0=3", "[0]: is no setting; known here: reference_height, "),
        ("9" * 5000 + "=3", "9999"),
        ("heat.frames" + ".a" * 5000 + "=3", "detector.heat.frames: should be a valid integer"),
    ],
)
def test_a_mistake_in_an_assignment_is_explained_in_one_line(assignment: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_settings(None, [assignment])
    (line,) = str(error.value).split("\n")
    assert line.startswith(f"--set: {message}")


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        (
            "detector.search.windows.1.sise=3",
            "search.windows[1].sise: is no setting; did you mean size?",
        ),
        (
            "detector.search.windows.0.0=3",
            "search.windows[0][0]: is no setting; known here: size, ",
        ),
    ],
)
def test_so_is_one_in_an_assignment_to_an_item_of_the_file(
    path: Path, assignment: str, message: str
) -> None:
    (line,) = refusal(path, WINDOWS, assignment)
    assert line.startswith(f"--set: {message}")


def test_a_value_that_an_assignment_mends_is_no_error(path: Path) -> None:
    assert (
        load(path, "detector.heat: {frames: 0}", "detector.heat.frames=3").settings.heat.frames == 3
    )


@pytest.mark.parametrize("value", ["[" * 200 + "]" * 200, "9" * 300, "x" * 5000])
def test_a_long_value_is_shortened_in_the_message(path: Path, value: str) -> None:
    (line,) = refusal(path, f"heat: {{frames: {value}}}")
    assert len(line) < 200


def test_keys_are_written_as_a_user_would() -> None:
    assert format_key(("search", "windows", 0, "size")) == "search.windows[0].size"


_NAMES = st.sampled_from(
    ["features", "hog", "channels", "search", "windows", "size", "heat", "frames", "tracker", "x"]
)
_SCALARS = st.one_of(
    st.sampled_from(
        [
            "1", "0x1f", "0b1", "017", "1_000", "1e9999", "-.inf", ".nan", "1:30:30.5", "~", "yes",
            "2001-01-01", "2001-12-14t21:59:43.10-05:00", "<<", "=", "*a", "&a 1", "!!int x",
            "!!timestamp x", "!!python/object:x {}", "? a", "- a", "|\n x", ">-\n x", "%", "@", "`",
            "'", '"\\x', '"\\ud800"', "\t", "\x07", "#", "9" * 5000, "[", "{", "]", "}", ",",
        ]
    ),
    st.text(max_size=6),
)  # fmt: skip
_YAML = st.recursive(
    _SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]"),
        st.lists(st.tuples(_NAMES, inner), max_size=3).map(
            lambda pairs: "{" + ", ".join(f"{key}: {value}" for key, value in pairs) + "}"
        ),
    ),
    max_leaves=8,
)


@given(st.one_of(_YAML, st.text(), st.lists(_SCALARS).map("\n".join)))
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_text_gives_settings_or_a_config_error(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    try:
        loaded = load_settings(path)
    except ConfigError as error:
        assert str(error).startswith(str(path))  # noqa: PT017
    else:
        assert isinstance(loaded.settings, Settings)


@given(st.one_of(st.text(), st.tuples(st.lists(_NAMES).map(".".join), _YAML).map("=".join)))
@settings(max_examples=200)
def test_any_assignment_gives_settings_or_a_config_error(text: str) -> None:
    try:
        loaded = load_settings(None, [text])
    except ConfigError as error:
        assert str(error).startswith("--set")  # noqa: PT017
    else:
        assert isinstance(loaded.settings, Settings)


def test_a_section_of_which_nothing_is_given_stays_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    file.write_text("heat:\n  # threshold: 2\n")
    assert load_settings(file).settings == load_settings()
