"""The setting `classes`: only vehicles of some classes are shown and counted."""

from pathlib import Path

from boxing import moved_to
from red_cars import CAR, NullDetector, car_at
from run.red_runs import outputs
from running import names, rows_of
from vdet.boxes import Boxes
from vdet.config.scene import LineSettings, TrafficSettings
from vdet.config.schema import Settings
from vdet.media import Picture
from vdet.run.loop import Parts
from vdet.run.video import Run, run_video
from vdet.track.track import Track

GATE = LineSettings(name="gate", start=(0.3, 0), end=(0.3, 1))
SETTINGS = Settings(traffic=TrafficSettings(lines=(GATE,)))
TRUCKS = SETTINGS.model_copy(update={"classes": ("truck",)})


class TwoVehicles:
    """Follows one that becomes a truck in the last of 50 frames, and a car beside it."""

    def update(self, _: Boxes, time: float, __: Picture | None = None) -> list[Track]:
        box, kind = car_at(round(25 * time)), "truck" if time > 1.7 else "car"
        below = moved_to(CAR, box.x1, box.y1 + 60)
        return [Track(1, box, 0.9, "detected", kind), Track(2, below, 0.9, "detected", "car")]


def test_a_vehicle_is_boxed_and_listed_by_the_class_that_it_gets_within_two_seconds(
    red_clip: Path, tmp_path: Path
) -> None:
    files = {name: tmp_path / f"{name}.csv" for name in ("vehicles", "counts", "tracks")}
    wanted = outputs(**files, crops=tmp_path / "crops")
    run_video(Run(red_clip, wanted, TRUCKS), Parts(NullDetector(), TwoVehicles()))
    rows = rows_of(files["tracks"])
    assert {row["class"] for row in rows} == {"truck"}
    assert min(float(row["time"]) for row in rows) == 0.0
    (vehicle,) = rows_of(files["vehicles"])
    assert (vehicle["id"], vehicle["class"], vehicle["first"]) == ("1", "truck", "0.0")
    (event,) = rows_of(files["counts"])
    assert (event["id"], event["class"], float(event["time"]) < 1.7) == ("1", "truck", True)
    (crop,) = names(tmp_path / "crops")
    assert crop.startswith("vehicle-0001-truck-at-")
