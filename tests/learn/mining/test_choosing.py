import numpy as np
import numpy.typing as npt

from vdet.config.schema import MiningSettings
from vdet.detect.svm.windows import Windows
from vdet.evaluate.labelled_video import LabelledVideo, Row
from vdet.geometry import Box
from vdet.learn.mining.choosing import Choice, Kind, choose

WIDTH = 1000
CAR = Box(400, 300, 100, 70)
OTHER = Box(700, 300, 100, 70)
GENEROUS = MiningSettings(probability=0.2, per_vehicle=1000, false_alarms=1000, parts=1000)


def truth(*vehicles: Box, ignored: tuple[Box, ...] = ()) -> LabelledVideo:
    rows = [(i, box, False) for i, box in enumerate(vehicles)]
    rows += [(-1, box, True) for box in ignored]
    return LabelledVideo.from_rows(
        Row(0, 1, number, box.x, box.y, box.width, box.height, ignored=flag)
        for number, box, flag in rows
    )


def about(x: float, side: int = 100, y: float = 335) -> Box:
    return Box(round(x - side / 2), round(y - side / 2), side, side)


def windows(*boxes: Box, probability: float = 1.0) -> Windows:
    table: npt.NDArray[np.int32] = np.array(
        [(box.x, box.y, box.width, box.height) for box in boxes], np.int32
    )
    ones = np.ones(len(boxes), np.float32)
    return Windows(
        table, np.full(len(boxes), probability, np.float32), ones, table.astype(np.float32)
    )


def chosen(
    found: Windows, labels: LabelledVideo, settings: MiningSettings = GENEROUS, seed: int = 0
) -> list[Choice]:
    return list(choose(found, labels, WIDTH, settings, np.random.default_rng(seed)))


def kinds(choices: list[Choice]) -> dict[Box, str]:
    return {choice.box: choice.kind for choice in choices}


def test_windows_become_patches_of_their_kind() -> None:
    fits, shows, part, false = about(450), about(470), about(450, 36), about(100)
    choices = chosen(windows(fits, shows, part, false), truth(CAR))
    assert kinds(choices) == {
        fits: "vehicle",
        shows: "box",
        part: "part",
        false: "false alarm",
    }
    assert {choice.box: choice.sides for choice in choices if choice.sides} == {
        fits: (-0.5, -0.35, 0.5, 0.35),
        shows: (-0.7, -0.35, 0.3, 0.35),
    }


def test_a_false_alarm_needs_the_probability_of_the_settings() -> None:
    fits, shows, part, false, sure = about(450), about(470), about(450, 36), about(100), about(200)
    found = windows(fits, shows, part, false, sure)
    found.probabilities[:] = [0, 0, 0.19, 0.19, 0.21]
    choices = chosen(found, truth(CAR))
    assert kinds(choices) == {fits: "vehicle", shows: "box", sure: "false alarm"}


def test_nothing_is_taken_from_ignore_regions() -> None:
    region = Box(40, 280, 120, 120)
    inside, touching = about(100), about(185)
    for each, expected in ((inside, {}), (touching, {touching: "false alarm"})):
        assert kinds(chosen(windows(each), truth(ignored=(region,)))) == expected


def test_a_window_far_too_large_for_its_vehicle_is_a_false_alarm() -> None:
    large, too_large = about(450, 190), about(450, 260)
    assert kinds(chosen(windows(large), truth(CAR))) == {large: "box"}
    assert kinds(chosen(windows(too_large), truth(CAR))) == {too_large: "false alarm"}


def test_a_window_on_two_vehicles_belongs_to_the_nearer_one() -> None:
    beside = Box(480, 300, 100, 70)
    between = about(530)
    assert kinds(chosen(windows(between), truth(CAR, beside))) == {between: "vehicle"}


def test_no_part_is_taken_from_an_ignore_region() -> None:
    part = about(465, 36)
    assert kinds(chosen(windows(part), truth(CAR))) == {part: "part"}
    assert chosen(windows(part), truth(CAR, ignored=(Box(455, 280, 90, 90),))) == []


def many() -> Windows:
    return windows(*(about(x, side) for x in range(60, 940, 5) for side in (36, 80, 100, 120)))


def test_the_settings_limit_the_patches_of_each_vehicle_and_frame() -> None:
    settings = MiningSettings(probability=0, per_vehicle=4, false_alarms=7, parts=3)
    choices = chosen(many(), truth(CAR, OTHER), settings)
    counted = [choice.kind for choice in choices]
    kinds_in_order: tuple[Kind, ...] = ("vehicle", "box", "false alarm", "part")
    assert [counted.count(kind) for kind in kinds_in_order] == [8, 8, 7, 3]
    fitting = [choice.box for choice in choices if choice.kind == "vehicle"]
    assert sum(box.x < 600 for box in fitting) == 4


def test_the_same_seed_takes_the_same_windows_and_another_seed_takes_others() -> None:
    settings = MiningSettings(per_vehicle=4, false_alarms=7)
    one, same, other = (chosen(many(), truth(CAR), settings, seed) for seed in (0, 0, 1))
    assert one == same
    assert set(one) != set(other)


def test_a_window_that_two_sets_share_is_one_patch() -> None:
    assert len(chosen(windows(about(450), about(450)), truth(CAR))) == 1


def test_a_frame_without_vehicles_gives_false_alarms_only() -> None:
    assert {choice.kind for choice in chosen(many(), truth())} == {"false alarm"}
    assert len(chosen(many(), truth())) == len(many())
