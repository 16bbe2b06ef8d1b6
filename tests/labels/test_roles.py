"""What labels mean."""

import pytest

from vdet.config.classes import STANDARD_CLASSES
from vdet.config.loading import load_settings
from vdet.labels.reading import DEFAULT_ROLES, Roles


@pytest.mark.parametrize(
    ("labels", "role"),
    [
        (("Car", "van", "TRUCK", "lorry", "bus", "vehicle", "Pick-up", "tuk-tuk"), "vehicle"),
        (("Motorbike", "Cyclist"), "vehicle"),
        (("DontCare", "dont_care", "Ignore region", "Misc", "trailer"), "ignored"),
        (("Pedestrian", "Person_sitting", "rider"), "ignored"),
        (("cow", "traffic sign", ""), None),
    ],
)
def test_labels_mean_the_same_in_any_spelling(labels: tuple[str, ...], role: str | None) -> None:
    assert {DEFAULT_ROLES.role_of(label) for label in labels} == {role}


def test_settings_give_words_another_role_and_add_new_ones() -> None:
    changes = ("pedestrian=vehicle", "tram=other", "cow=ignored")
    roles = Roles.from_settings(load_settings((), [f"labels.roles.{change}" for change in changes]))
    names = ("person", "Tram", "cow", "misc", "car", "dont care")
    assert list(map(roles.role_of, names)) == [
        *("vehicle", "other", "ignored"),
        *("ignored", "vehicle", "ignored"),
    ]


@pytest.mark.parametrize(
    ("classes", "vehicles"),
    [
        (STANDARD_CLASSES, STANDARD_CLASSES),
        (("car",), ("car",)),
        (("truck", "tractor"), ("truck",)),
    ],
)
def test_classes_that_the_detector_does_not_look_for_are_ignored(
    classes: tuple[str, ...], vehicles: tuple[str, ...]
) -> None:
    roles = Roles.of({}, classes)
    assert {name: roles.role_of(name) for name in STANDARD_CLASSES} == {
        name: "vehicle" if name in vehicles else "ignored" for name in STANDARD_CLASSES
    }
    assert all(roles.role_of(name) == "vehicle" for name in classes)


def test_a_class_that_the_detector_finds_is_never_left_out() -> None:
    changes = ['detector.classes=["car", "bicycle"]', "labels.roles.cyclist=other"]
    roles = Roles.from_settings(load_settings((), [*changes, "labels.roles.person=other"]))
    found = {word: roles.role_of(word) for word in ("car", "bicycle", "person")}
    assert found == {"car": "vehicle", "bicycle": "ignored", "person": "other"}


def test_a_detector_of_vehicles_looks_for_cars_trucks_and_buses() -> None:
    settings = load_settings((), ['detector.classes=["vehicle"]'])
    roles = Roles.from_settings(settings)
    wanted = [name for name in STANDARD_CLASSES if roles.role_of(name) == "vehicle"]
    assert wanted == ["car", "truck", "bus", "vehicle"]


@pytest.mark.parametrize(
    ("classes", "learnt"),
    [
        (["car", "tractor"], {"Car": "car", "tractor": "tractor", "rickshaw": "vehicle"}),
        (["person"], {"pedestrian": "person"}),
    ],
)
def test_a_network_learns_its_classes_and_vehicles_of_unknown_kind(
    classes: list[str], learnt: dict[str, str]
) -> None:
    roles = Roles.for_training(load_settings((), [f"train.net.classes={classes}"]))
    words = ("Car", "bus", "tractor", "rickshaw", "pedestrian", "rider", "cow")
    found = {word: roles.class_of(word) for word in words if roles.role_of(word) == "vehicle"}
    assert found == learnt
