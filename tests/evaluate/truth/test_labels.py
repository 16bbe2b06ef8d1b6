import pytest

from vdet.evaluate.truth.labels import Role, role_of


@pytest.mark.parametrize("label", ["Car", "van", "TRUCK", "bus", "vehicle"])
def test_vehicles_are_to_be_found(label: str) -> None:
    assert role_of(label) is Role.VEHICLE


@pytest.mark.parametrize("label", ["DontCare", "dont_care", "ignore", "Ignore region", "Misc"])
def test_ignore_regions_are_told_however_they_are_spelt(label: str) -> None:
    assert role_of(label) is Role.IGNORED


@pytest.mark.parametrize("label", ["Pedestrian", "Person_sitting", "Cyclist"])
def test_people_are_passed_over(label: str) -> None:
    assert role_of(label) is Role.OTHER


def test_an_unknown_label_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"label 'cow' is unknown; use one of: car, van, .*rider"):
        role_of("cow")
