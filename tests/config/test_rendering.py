from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from seed import SEED
from vdet.config.detector import HeatSettings, SearchSettings, WindowSettings
from vdet.config.document import parse_document
from vdet.config.loading import load_settings
from vdet.config.rendering import explanations, render
from vdet.config.schema import (
    DrawSettings,
    MotionTrackerSettings,
    Section,
    Settings,
    SvmSettings,
)
from vdet.config.tracker import RulesTrackerSettings

CONFIGS = Path(__file__).parents[2] / "configs"
SVM = Settings(detector=SvmSettings())
KINDS = {
    "default": Settings(),
    "svm": SVM,
    "rules": Settings(tracker=RulesTrackerSettings()),
    "seed": SEED,
}
"""Settings in which every kind of detector and every kind of tracker occurs."""


def sections_in(annotation: Any) -> Iterator[type[Section]]:
    """Yield the sections that a type of a field names."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    for part in get_args(annotation):
        yield from sections_in(part)


def sections_of(settings: Settings) -> Iterator[tuple[str, type[Section]]]:
    """Yield all sections with keys, those of the items of lists too, and their names."""
    waiting: list[tuple[str, type[Section]]] = [("", Settings)]
    kinds = {"detector": type(settings.detector), "tracker": type(settings.tracker)}
    while waiting:
        name, section = waiting.pop()
        yield name, section
        for key, field in section.model_fields.items():
            inside = [kinds[key]] if not name and key in kinds else sections_in(field.annotation)
            waiting += [(f"{name}{key}.", item) for item in inside]


def windows(size: int, top: int, more: int) -> WindowSettings:
    return WindowSettings(size=size, overlap=0.1, top=top, bottom=top + size + more)


numbers = st.integers(10, 500)
some_settings = st.builds(
    Settings,
    detector=st.builds(
        SvmSettings,
        search=st.builds(
            SearchSettings,
            probability=st.floats(0, 1),
            windows=st.lists(st.builds(windows, numbers, numbers, numbers), max_size=3).map(tuple),
        ),
        heat=st.builds(HeatSettings, votes=st.none() | st.floats(0, allow_infinity=False)),
    ),
    tracker=st.builds(RulesTrackerSettings, good_fraction=st.floats(0, 1))
    | st.builds(MotionTrackerSettings, decay=st.floats(0, 1)),
    draw=st.builds(DrawSettings, label=st.sampled_from([None, (), ("id", "class")])),
)


@given(settings=some_settings)
@hypothesis_settings(max_examples=25)
def test_printed_settings_are_read_back_the_same(
    tmp_path_factory: pytest.TempPathFactory, settings: Settings
) -> None:
    path = tmp_path_factory.mktemp("printed") / "printed.yaml"
    path.write_text(render(settings), encoding="utf-8")
    assert load_settings([path]) == settings


def test_the_shipped_configs_are_printed_settings() -> None:
    names = sorted(path.name for path in CONFIGS.iterdir())
    assert names == ["default.yaml", "project-camera.yaml", "seed.yaml", "svm.yaml"]
    assert (CONFIGS / "default.yaml").read_text(encoding="utf-8") == render(Settings())
    tracker = SVM.tracker.model_copy(update={"look_ahead": 0.8})
    assert load_settings([CONFIGS / "svm.yaml"]) == SVM.model_copy(update={"tracker": tracker})
    for name in ("seed", "svm"):
        path = CONFIGS / f"{name}.yaml"
        _, *blocks = path.read_text(encoding="utf-8").rstrip().split("\n\n")
        printed = iter(render(load_settings([path])).splitlines())
        assert all(line in printed for line in "\n".join(blocks).splitlines())


@pytest.mark.parametrize("settings", KINDS.values(), ids=KINDS)
def test_every_setting_is_printed_with_its_explanation_in_plain_yaml(settings: Settings) -> None:
    printed = render(settings)
    given = settings.model_dump(mode="json")
    assert parse_document(printed, "printed").values == yaml.safe_load(printed) == given
    lines = [line.strip() for line in printed.splitlines()]
    text = " ".join(" ".join(line.lstrip("# ") for line in lines if "# " in line).split())
    for _, section in sections_of(settings):
        found = explanations(section)
        for key, field in section.model_fields.items():
            words = " ".join(found.get(key, "").split())
            if not isinstance(field.default, Section):
                assert words.endswith("."), key
                assert words in text, key
    blocks = printed.split("\n\n")
    assert len(blocks) == 1 + len(Settings.model_fields)
    assert all(block.startswith("# ") for block in blocks)
    assert max(map(len, printed.splitlines())) <= 100


def test_there_are_at_most_100_settings() -> None:
    """Each key of a section of every kind counts once, also those of the items of lists."""
    keys = {
        f"{name}{key}"
        for settings in KINDS.values()
        for name, section in sections_of(settings)
        for key, field in section.model_fields.items()
        if not list(sections_in(field.annotation))
    }
    assert 80 < len(keys) <= 100
