from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vdet.config.loading import find_config, load_settings
from vdet.config.schema import Settings, SvmSettings, TrainSettings
from vdet.config.svm import HeatSettings, SearchSettings, WindowSettings
from vdet.config.train import SvmTrainingSettings
from vdet.errors import ConfigError

WINDOWS = """\
detector:
  search:
    windows:
    - {size: 64, overlap: 0.5, top: 0, bottom: 100}
    - {size: 96, overlap: 0.5, top: 0, bottom: 200}
"""
FIRST = WindowSettings(size=64, overlap=0.5, top=0, bottom=100)
SECOND = WindowSettings(size=96, overlap=0.5, top=0, bottom=200)
SVM = Settings(detector=SvmSettings())


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "my.yaml"


def load(path: Path, text: str, *assignments: str) -> Settings:
    path.write_text(text, encoding="utf-8")
    return load_settings([path], assignments, detector="svm")


def refusal(path: Path, text: str, *assignments: str) -> list[str]:
    """Return the lines of the error, without the file's folder."""
    with pytest.raises(ConfigError) as error:
        load(path, text, *assignments)
    return str(error.value).replace(f"{path.parent}/", "").split("\n")


def test_without_file_and_assignments_the_settings_are_the_defaults() -> None:
    assert load_settings() == Settings()


def test_a_file_changes_what_it_names_and_nothing_else(path: Path) -> None:
    loaded = load(path, "detector:\n  heat:\n    frames: 5\ntrain: {svm: {C: 1e-3}}\n")
    heat = HeatSettings(frames=5)
    expected = Settings(
        detector=SvmSettings(heat=heat), train=TrainSettings(svm=SvmTrainingSettings(C=0.001))
    )
    assert loaded == expected
    assert loaded.svm.heat.threshold == SVM.svm.heat.threshold


def test_assignments_lie_over_the_file_and_later_ones_over_earlier_ones(path: Path) -> None:
    heat = load(
        path,
        "detector: {heat: {frames: 5, blur: 7, threshold: 2}}",
        *("detector.heat.frames=6", "detector.heat.blur=8", "detector.heat.frames=7"),
    ).svm.heat
    assert (heat.frames, heat.blur, heat.threshold) == (7, 8, 2.0)


def test_a_list_in_a_file_replaces_the_whole_default_list(path: Path) -> None:
    search = load(path, "detector: {search: {perspective: {sizes: [0.5]}}}").svm.search
    assert len(SearchSettings().perspective.sizes) > 1
    assert search.perspective.sizes == (0.5,)


def test_all_errors_are_given_at_once(path: Path) -> None:
    text = "detector: {heat: {frames: 0, blur: -1}}\ntrain:\n  svm: {C: -1}\ntrakcer: {}\n"
    assert sorted(refusal(path, text, "output.crf=99")) == [
        "--set: output.crf: must be less than or equal to 51 (got 99)",
        "my.yaml:1:19: detector.heat.frames: must be greater than or equal to 1 (got 0)",
        "my.yaml:1:30: detector.heat.blur: must be greater than or equal to 1 (got -1)",
        "my.yaml:3:9: train.svm.C: must be greater than 0 (got -1)",
        "my.yaml:4:1: trakcer: unknown setting; did you mean tracker?",
    ]


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ("heat: {x: 3}", 19, "heat.x: unknown setting; known settings: frames, blur, threshold, "),
        ("features: {hog: {cel: 3}}", 29, "features.hog.cel: unknown setting; did you mean cell?"),
        ("heat: 3", 12, "heat: must be a section, key: value (got 3)"),
        ("heat: {frames: 2001-01-01}", 19, "heat.frames: must be a valid integer (got datetime"),
        ("heat: {threshold: 1e999}", 19, "heat.threshold: must be a finite number (got inf)"),
        ("features: {patch: 62}", 12, "features: patch must be a multiple of hog.cell (4)"),
        ("search: {windows: [5]}", 31, "search.windows[0]: must be a section, key: value"),
        (
            "search: {windows: [{size: 64, overlap: 0.8, top: 0, bottom: 63}]}",
            31,
            "search.windows[0]: bottom must be at least top + size",
        ),
        ("heat: {regions: some}", 19, "heat.regions: must be 'outline' or 'votes' (got 'some')"),
    ],
)
def test_a_mistake_in_the_detector_is_explained_in_one_line(
    path: Path, text: str, column: int, message: str
) -> None:
    (line,) = refusal(path, f"detector: {{{text}}}")
    assert line.startswith(f"my.yaml:1:{column}: detector.{message}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "tracker: {confirm_second: 3}",
            "1:11: tracker.confirm_second: unknown setting; did you mean confirm_seconds?",
        ),
        (
            "tracker: {kind: rules, histroy: 3}",
            "1:24: tracker.histroy: unknown setting; did you mean history?",
        ),
        (
            "heat: {frames: 3}",
            "1:1: heat: unknown setting; known settings: detector, tracker, camera, ",
        ),
        ("'': 1", "1:1: : unknown setting; known settings: detector, tracker, "),
        ("draw: {label: score}", "1:8: draw.label: must be a list (got"),
        ("draw: {label: [speed]}", "1:16: draw.label[0]: must be 'id', 'class', 'score' or "),
        ("draw: {trails: 0}", "1:8: draw.trails: must be greater than 0 (got 0)"),
    ],
)
def test_a_mistake_is_explained_in_one_line(path: Path, text: str, message: str) -> None:
    (line,) = refusal(path, text)
    assert line.startswith(f"my.yaml:{message}")


def test_each_missing_key_of_an_item_is_named(path: Path) -> None:
    assert refusal(path, "detector: {search: {windows: [{size: 64, overlap: 0.5}]}}") == [
        "my.yaml:1:31: detector.search.windows[0].top: is required",
        "my.yaml:1:31: detector.search.windows[0].bottom: is required",
    ]


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("heat.frames=x", "heat.frames: must be a valid integer"),
        ("heat.frames.0=5", "heat.frames: must be a valid integer"),
        ("heat.frames" + ".a" * 5000 + "=3", "heat.frames: must be a valid integer"),
        ("search.windows.0.size=64", "search.windows: must be a list (got"),
    ],
)
def test_a_mistake_in_an_assignment_to_the_detector_is_explained_in_one_line(
    assignment: str, message: str
) -> None:
    with pytest.raises(ConfigError) as error:
        load_settings((), [f"detector.{assignment}"], detector="svm")
    (line,) = str(error.value).split("\n")
    assert line.startswith(f"--set: detector.{message}")


@pytest.mark.parametrize(
    ("assignment", "message"),
    [
        ("tracker.0=3", "tracker.0: unknown setting; known settings: kind, look_ahead, "),
        ("0=3", "0: unknown setting; known settings: detector, tracker, "),
        ("9" * 5000 + "=3", "9999"),
    ],
)
def test_a_mistake_in_an_assignment_is_explained_in_one_line(assignment: str, message: str) -> None:
    with pytest.raises(ConfigError) as error:
        load_settings((), [assignment], detector="svm")
    (line,) = str(error.value).split("\n")
    assert line.startswith(f"--set: {message}")


_NAMES = st.sampled_from(
    [
        *("detector", "kind", "features", "hog", "channels", "search", "windows", "size", "heat"),
        *("frames", "tracker", "kind", "x"),
    ]
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
        loaded = load_settings([path])
    except ConfigError as error:
        assert str(error).startswith(str(path))  # noqa: PT017
    else:
        assert isinstance(loaded, Settings)


@given(st.one_of(st.text(), st.tuples(st.lists(_NAMES).map(".".join), _YAML).map("=".join)))
@settings(max_examples=200)
def test_any_assignment_gives_settings_or_a_config_error(text: str) -> None:
    try:
        loaded = load_settings((), [text])
    except ConfigError as error:
        assert str(error).startswith("--set")  # noqa: PT017
    else:
        assert isinstance(loaded, Settings)


def test_a_section_of_which_nothing_is_given_stays_as_it_was(tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    file.write_text("detector:\n  # kind: svm\n  heat:\n    # threshold: 2\ntracker:\n")
    assert load_settings([file], detector="svm") == SVM


@pytest.fixture
def _in_an_empty_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("_in_an_empty_folder")
class TestFindConfig:
    def test_shipped_configs_are_found_by_their_names(self) -> None:
        assert load_settings([find_config("default")]) == Settings()
        assert load_settings([find_config("seed")]).svm.features.patch == 64

    def test_a_path_is_taken_as_it_is(self, tmp_path: Path) -> None:
        (tmp_path / "my.yaml").touch()
        assert find_config("my.yaml") == Path("my.yaml")
        assert find_config(str(tmp_path / "my.yaml")) == tmp_path / "my.yaml"

    def test_a_file_of_the_name_does_not_replace_the_shipped_config(self, tmp_path: Path) -> None:
        (tmp_path / "seed").touch()
        assert find_config("seed").name == "seed.yaml"
        assert find_config("./seed") == Path("seed")

    @pytest.mark.parametrize("name", ["no", "seed.yaml", "../configs/seed"])
    def test_an_unknown_name_names_the_shipped_configs(self, name: str) -> None:
        with pytest.raises(ConfigError) as error:
            find_config(name)
        shipped = "default, project-camera, seed, svm"
        assert str(error.value) == f"{name}: not found; shipped settings files are: {shipped}"
