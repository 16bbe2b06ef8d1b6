"""What labels mean."""

import pytest

from vdet.config.loading import load_settings
from vdet.detect.classes import OUR_NAMES
from vdet.labels.roles import DEFAULT_ROLES, Roles


@pytest.mark.parametrize(
    ("labels", "role"),
    [
        (("Car", "van", "TRUCK", "lorry", "bus", "vehicle", "Pick-up"), "vehicle"),
        (("DontCare", "dont_care", "Ignore region", "Misc", "trailer", "Motorbike"), "ignored"),
        (("Pedestrian", "Person_sitting", "Cyclist"), "other"),
        (("cow", "traffic sign", ""), None),
    ],
)
def test_labels_mean_the_same_in_any_spelling(labels: tuple[str, ...], role: str | None) -> None:
    assert {DEFAULT_ROLES.role_of(label) for label in labels} == {role}


def test_settings_give_words_another_role_and_add_new_ones() -> None:
    changes = ("motorbike=vehicle", "tram=other", "cow=ignored")
    roles = Roles.from_settings(load_settings(None, [f"labels.roles.{each}" for each in changes]))
    names = ("motorcycle", "Tram", "cow", "misc", "car", "dont care")
    assert list(map(roles.role_of, names)) == [
        *("vehicle", "other", "ignored"),
        *("ignored", "vehicle", "ignored"),
    ]


@pytest.mark.parametrize(
    ("classes", "vehicles"),
    [
        (("car", "truck", "bus", "vehicle", "motorcycle"), OUR_NAMES),
        (("vehicle",), ("car", "truck", "bus", "vehicle")),
        (("car",), ("car",)),
        (("truck", "tractor"), ("truck",)),
    ],
)
def test_classes_that_the_detector_does_not_look_for_are_ignored(
    classes: tuple[str, ...], vehicles: tuple[str, ...]
) -> None:
    roles = Roles.of({}, classes)
    assert {name: roles.role_of(name) for name in OUR_NAMES} == {
        name: "vehicle" if name in vehicles else "ignored" for name in OUR_NAMES
    }
    assert all(roles.role_of(name) == "vehicle" for name in classes)
