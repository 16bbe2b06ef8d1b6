"""Lines that are not where they should be."""

from collections.abc import Sequence

import pytest

from traffic.scenes import LINE, Path, counts, frames, through
from vdet.config.scene import LineSettings
from vdet.findings import Finding, with_counted

DOWN = through((1, 600, 300), (5, 600, 500))


BESIDE = "tracks that begin or end at this line and are not counted: 1;"
SCENES: dict[str, tuple[Sequence[Path], str]] = {
    "a vehicle crosses": ([], ""),
    "a track begins at the line": ([through((1, 600, 405), (5, 600, 700))], BESIDE),
    "a track ends at the line": ([through((1, 600, 100), (5, 600, 380))], BESIDE),
    "at the start of the video": ([through((0, 600, 405), (5, 600, 700))], ""),
    "at the end of the video": ([through((5, 600, 100), (10, 600, 380))], ""),
    "beyond the end of the line": ([through((1, 1100, 405), (5, 1100, 700))], ""),
    "beside the line, but it is counted": ([through((1, 600, 385), (5, 600, 700))], ""),
    "one of many": (
        [
            *(through((1, 250 + 20 * n, 300), (5, 250 + 20 * n, 500)) for n in range(30)),
            through((1, 600, 405), (5, 600, 700)),
        ],
        "",
    ),
    "the line runs along the way": (
        [through((1, 300, 330), (3, 500, 470), (5, 700, 330), (7, 900, 470))],
        "paths that cross this line more than once: 1;",
    ),
}
"""What moves beside a vehicle that crosses, and the warning."""


@pytest.mark.parametrize("scene", SCENES)
def test_a_line_in_the_wrong_place_has_a_warning(scene: str) -> None:
    paths, warning = SCENES[scene]
    found = counts(frames(DOWN, *paths), LINE).warnings
    assert [text.startswith(f"line: {warning}") for text in found] == [True] * bool(warning)


def test_a_line_that_no_vehicle_crosses_is_noted() -> None:
    found = counts(frames(through((1, 600, 300), (5, 600, 340))), LINE).findings
    assert found == (Finding("line", "line: no vehicle crossed this line", severity="note"),)


@pytest.mark.parametrize("paths", [(), (lambda _: (600, 300),)], ids=["no track", "a parked car"])
def test_that_nothing_was_found_is_noted_once(paths: tuple[Path, ...]) -> None:
    found = counts(frames(*paths), LINE).findings
    assert [(item.code, item.severity) for item in found] == [("nothing-found", "note")]
    of_tracks = (Finding("nothing-found", "3 things moved"),)
    assert with_counted(of_tracks, found) == of_tracks
    assert with_counted((), found) == found


def test_a_line_that_is_shorter_than_a_vehicle() -> None:
    short = LineSettings(name="line", start=(580, 400), end=(620, 400))
    assert counts(frames(DOWN), short).warnings == (
        "line: this line is shorter than a vehicle; make it longer [line]",
    )


@pytest.mark.parametrize(("rate", "is_low"), [(1, True), (2, True), (4, True), (5, False)])
@pytest.mark.parametrize("paths", [(), (DOWN,)])
def test_a_low_frame_rate(paths: tuple[Path, ...], rate: float, is_low: bool) -> None:
    expected = "fewer than 5 frames per second: vehicles are missed; record more [frame-rate]"
    found = counts(frames(*paths, rate=rate, seconds=60), LINE).warnings
    assert (expected in found) == is_low
