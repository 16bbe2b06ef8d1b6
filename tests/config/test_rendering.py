from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
import yaml

from seed import SEED
from vdet.config.kinds import RulesTrackerSettings
from vdet.config.loading import explanations, load_settings, parse_document, render_settings
from vdet.config.scene import Shape
from vdet.config.schema import Section, Settings, SvmSettings

CONFIGS = Path(__file__).parents[2] / "configs"
SVM = Settings(detector=SvmSettings())
KINDS = {
    "default": Settings(),
    "svm": SVM,
    "rules": Settings(tracker=RulesTrackerSettings()),
    "seed": SEED,
    "changed": load_settings((), ["draw.label=[]", "detector={kind: svm, heat: {votes: null}}"]),
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


def is_size_of_points(section: type[Section], key: str) -> bool:
    """Return whether this is the key that `camera.size` explains, for all shapes."""
    return issubclass(section, Shape) and key == "size"


def test_the_shipped_configs_are_printed_settings() -> None:
    names = sorted(path.stem for path in CONFIGS.glob("*.yaml"))
    assert names == ["ahead", "default", "project-camera", "seed", "svm"]
    assert (CONFIGS / "default.yaml").read_text(encoding="utf-8") == render_settings(Settings())
    tracker = SVM.tracker.model_copy(update={"look_ahead": 0.8})
    assert load_settings([CONFIGS / "svm.yaml"]) == SVM.model_copy(update={"tracker": tracker})
    for name in ("seed", "svm"):
        path = CONFIGS / f"{name}.yaml"
        _, *blocks = path.read_text(encoding="utf-8").rstrip().split("\n\n")
        printed = iter(render_settings(load_settings([path])).splitlines())
        assert all(line in printed for line in "\n".join(blocks).splitlines())


@pytest.mark.parametrize("settings", KINDS.values(), ids=KINDS)
def test_every_setting_is_printed_with_its_explanation_and_read_back_the_same(
    settings: Settings, tmp_path: Path
) -> None:
    printed = render_settings(settings)
    (tmp_path / "printed.yaml").write_text(printed, encoding="utf-8")
    assert load_settings([tmp_path / "printed.yaml"]) == settings
    given = settings.model_dump(mode="json")
    del given["lanes"]["size"]  # is printed where it differs from that of the file
    assert parse_document(printed, "printed").values == yaml.safe_load(printed) == given
    lines = [line.strip() for line in printed.splitlines()]
    text = " ".join(" ".join(line.lstrip("# ") for line in lines if "# " in line).split())
    for _, section in sections_of(settings):
        found = explanations(section)
        for key, field in section.model_fields.items():
            words = " ".join(found.get(key, "").split())
            if not (isinstance(field.default, Section) or is_size_of_points(section, key)):
                assert words.endswith("."), key
                assert words in text, key
    blocks = printed.split("\n\n")
    assert len(blocks) == 1 + len(Settings.model_fields)
    assert all(block.startswith("# ") for block in blocks)
    assert max(map(len, printed.splitlines())) <= 100


def test_there_are_few_settings() -> None:
    """Each key of a section of every kind counts once, also those of the items of lists."""
    keys = {
        f"{name}{key}"
        for settings in KINDS.values()
        for name, section in sections_of(settings)
        for key, field in section.model_fields.items()
        if not (list(sections_in(field.annotation)) or is_size_of_points(section, key))
    }
    assert 80 < len(keys) <= 116
