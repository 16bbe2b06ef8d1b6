from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from pydantic.fields import FieldInfo

from seed import SEED
from vdet.config.document import parse_document
from vdet.config.loading import load_settings
from vdet.config.rendering import explanations, render
from vdet.config.schema import MotionTrackerSettings, Section, Settings, SvmSettings, TrainSettings
from vdet.config.svm import (
    FeatureSettings,
    HeatSettings,
    HistogramSettings,
    HogSettings,
    SearchSettings,
    WindowSettings,
)
from vdet.config.tracker import RulesTrackerSettings
from vdet.config.train import SvmTrainingSettings

CONFIGS = Path(__file__).parents[2] / "configs"


def read_back(text: str, folder: Path) -> Settings:
    path = folder / "printed.yaml"
    path.write_text(text, encoding="utf-8")
    return load_settings([path])


def fields_of(section: Section, prefix: str = "") -> Iterator[tuple[str, FieldInfo]]:
    """Give the settings in a section and in the sections in it."""
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, Section):
            yield from fields_of(value, f"{prefix}{name}.")
        else:
            yield prefix + name, field


def sections_of(section: Section) -> Iterator[type[Section]]:
    """Give the sections with keys: those in a section, and the items of its lists."""
    for _, value in section:
        if isinstance(value, Section):
            yield type(value)
            yield from sections_of(value)
    for _, field in fields_of(section):
        for kind in get_args(field.annotation):
            if isinstance(kind, type) and issubclass(kind, Section):
                yield kind


RULES = Settings(tracker=RulesTrackerSettings())
SVM = Settings(detector=SvmSettings())
KINDS = {"default": Settings(), "svm": SVM, "rules": RULES}
"""Settings in which every kind of detector and every kind of tracker occurs."""
finite = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def windows(draw: st.DrawFn) -> WindowSettings:
    size, top = draw(st.integers(10, 500)), draw(st.integers(0, 1000))
    bottom = top + size + draw(st.integers(0, 1000))
    return WindowSettings(size=size, overlap=draw(st.floats(0, 0.85)), top=top, bottom=bottom)


detectors = st.builds(
    SvmSettings,
    features=st.builds(
        FeatureSettings,
        hog=st.builds(HogSettings, orientations=st.integers(2, 32)),
        histogram=st.builds(HistogramSettings, bins=st.sampled_from([8, 256])),
    ),
    search=st.builds(
        SearchSettings,
        probability=st.floats(0, 1),
        windows=st.lists(windows(), min_size=1, max_size=3).map(tuple),
    ),
    heat=st.builds(
        HeatSettings,
        regions=st.sampled_from(["outline", "votes"]),
        threshold=finite.map(abs),
    ),
)
some_settings = st.builds(
    Settings,
    detector=detectors,
    tracker=st.builds(RulesTrackerSettings, good_fraction=st.floats(0, 1))
    | st.builds(MotionTrackerSettings, decay=st.floats(0, 1)),
    train=st.builds(
        TrainSettings,
        svm=st.builds(
            SvmTrainingSettings,
            C=st.floats(0, 1e6, exclude_min=True),
            augmentation=st.booleans(),
        ),
    ),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("printed")


@given(settings=some_settings)
@hypothesis_settings(max_examples=40)
def test_printed_settings_are_read_back_the_same(folder: Path, settings: Settings) -> None:
    assert read_back(render(settings), folder) == settings


def test_the_default_config_is_the_defaults_printed() -> None:
    path = CONFIGS / "default.yaml"
    text = path.read_text(encoding="utf-8")
    assert load_settings([path]) == Settings()
    assert text == render(Settings())


@pytest.mark.parametrize("name", ["seed", "svm"])
def test_a_config_of_the_linear_model_is_a_part_of_its_settings_printed(name: str) -> None:
    path = CONFIGS / f"{name}.yaml"
    _, *blocks = path.read_text(encoding="utf-8").rstrip().split("\n\n")
    printed = iter(render(load_settings([path])).splitlines())
    assert all(line in printed for line in "\n".join(blocks).splitlines())


def test_the_config_svm_is_the_linear_model_with_a_longer_look_ahead() -> None:
    tracker = SVM.tracker.model_copy(update={"look_ahead": 0.8})
    assert load_settings([CONFIGS / "svm.yaml"]) == SVM.model_copy(update={"tracker": tracker})


def test_no_other_config_ships() -> None:
    names = sorted(path.name for path in CONFIGS.iterdir())
    assert names == ["default.yaml", "project-camera.yaml", "seed.yaml", "svm.yaml"]


@pytest.mark.parametrize("settings", [Settings(), SEED, RULES], ids=["default", "seed", "rules"])
def test_every_setting_is_printed(settings: Settings) -> None:
    printed = parse_document(render(settings), "printed").values
    given = settings.model_dump(mode="json")
    if isinstance(settings.detector, SvmSettings):  # windows are printed without what they lack
        windows = settings.detector.search.windows
        dumped = [window.model_dump(mode="json", exclude_none=True) for window in windows]
        given["detector"]["search"]["windows"] = dumped
    assert printed == given


@pytest.mark.parametrize("settings", KINDS.values(), ids=KINDS)
def test_the_explanation_of_every_key_is_printed_as_a_comment(settings: Settings) -> None:
    lines = [line.strip() for line in render(settings).splitlines()]
    text = " ".join(" ".join(line.lstrip("# ") for line in lines if "# " in line).split())
    for section in sections_of(settings):
        found = explanations(section)
        for key, field in section.model_fields.items():
            words = " ".join(found.get(key, "").split())
            if not isinstance(field.default, Section):
                assert words.endswith("."), key
                assert words in text, key


def test_there_are_few_settings() -> None:
    """Each key of a section of every kind counts once; a list or a mapping counts as one."""
    keys = {key for settings in KINDS.values() for key, _ in fields_of(settings)}
    assert 80 < len(keys) <= 116


@pytest.mark.parametrize("settings", KINDS.values(), ids=KINDS)
def test_one_empty_line_stands_before_each_section(settings: Settings) -> None:
    blocks = render(settings).split("\n\n")
    assert len(blocks) == 1 + len(Settings.model_fields)
    assert all(block.startswith("# ") for block in blocks)


@pytest.mark.parametrize("settings", KINDS.values(), ids=KINDS)
def test_no_line_is_longer_than_100_characters(settings: Settings) -> None:
    assert max(map(len, render(settings).splitlines())) <= 100


def test_what_is_printed_is_plain_yaml(folder: Path) -> None:
    loaded: Any = yaml.safe_load(render(Settings()))
    assert read_back(yaml.safe_dump(loaded), folder) == Settings()
