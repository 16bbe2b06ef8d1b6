"""The words of label files."""

import pytest

from vdet.detect.classes import OUR_NAMES, our_name
from vdet.labels.roles import Role, class_of, role_of


@pytest.mark.parametrize("label", ["Car", "van", "TRUCK", "bus", "vehicle"])
def test_labels_of_vehicles(label: str) -> None:
    assert role_of(label) is Role.VEHICLE


@pytest.mark.parametrize("label", ["DontCare", "dont_care", "ignore", "Ignore region", "Misc"])
def test_labels_of_ignore_regions_in_any_spelling(label: str) -> None:
    assert role_of(label) is Role.IGNORED


@pytest.mark.parametrize("label", ["Pedestrian", "Person_sitting", "Cyclist"])
def test_labels_of_people(label: str) -> None:
    assert role_of(label) is Role.OTHER


def test_an_unknown_label_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"label 'cow' is unknown; use one of: car, van, .*rider"):
        role_of("cow")


@pytest.mark.parametrize(
    ("label", "meaning"),
    [
        ("Car", ("car", False)),
        ("Van", ("car", False)),
        ("lorry", ("truck", False)),
        ("Pick-up", ("truck", False)),
        ("motorbike", ("motorcycle", False)),
        ("Tram", ("vehicle", True)),
        ("trailer", ("vehicle", True)),
        ("dont_care", ("vehicle", True)),
        ("person", None),
        ("traffic sign", None),
        ("", None),
    ],
)
def test_what_a_label_of_a_picture_means(label: str, meaning: tuple[str, bool] | None) -> None:
    assert class_of(label) == meaning


def test_our_names_mean_themselves() -> None:
    assert [our_name(name) for name in OUR_NAMES] == list(OUR_NAMES)


def test_video_and_pictures_take_the_same_labels_for_vehicles() -> None:
    """Motorcycles are the exception: a detector of pictures may look for them."""
    for word in ("car", "van", "truck", "lorry", "bus", "vehicle", "taxi", "suv", "pickup"):
        assert role_of(word) is Role.VEHICLE
        assert class_of(word) in [(name, False) for name in OUR_NAMES]
