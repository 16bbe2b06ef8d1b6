"""Lines that are not where they should be."""

import pytest

from traffic.scenes import LINE, Path, counts, frames, through
from vdet.config.scene import LineSettings
from vdet.findings import Finding, with_counted

DOWN = through((1, 600, 300), (5, 600, 500))


def warnings(*paths: object, line: LineSettings = LINE) -> tuple[str, ...]:
    return counts(frames(*paths), line).warnings  # type: ignore[arg-type]


def test_a_line_across_the_way_is_fine() -> None:
    assert warnings(DOWN) == ()


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


@pytest.mark.parametrize(
    "path", [through((1, 600, 405), (5, 600, 700)), through((1, 600, 100), (5, 600, 380))]
)
def test_a_line_at_which_tracks_begin_or_end(path: object) -> None:
    (found,) = warnings(DOWN, path)
    assert found.startswith("line: tracks that begin or end at this line and are not counted: 1;")


@pytest.mark.parametrize(
    "path",
    [
        through((0, 600, 405), (5, 600, 700)),
        through((5, 600, 100), (10, 600, 380)),
        through((1, 1100, 405), (5, 1100, 700)),
        through((1, 600, 385), (5, 600, 700)),
    ],
    ids=["at the start of the video", "at its end", "beyond the line", "and is counted"],
)
def test_other_ends_of_tracks_are_fine(path: object) -> None:
    assert warnings(DOWN, path) == ()


def test_a_line_that_runs_along_the_way() -> None:
    along = through((1, 300, 330), (3, 500, 470), (5, 700, 330), (7, 900, 470))
    (found,) = warnings(DOWN, along)
    assert found.startswith("line: paths that cross this line more than once: 1;")


def test_a_few_among_many_are_no_fault_of_the_line() -> None:
    many = [through((1, 250 + 20 * n, 300), (5, 250 + 20 * n, 500)) for n in range(30)]
    assert warnings(*many, through((1, 600, 405), (5, 600, 700))) == ()


def test_a_line_that_is_shorter_than_a_vehicle() -> None:
    short = LineSettings(name="line", start=(580, 400), end=(620, 400))
    assert warnings(DOWN, line=short) == (
        "line: this line is shorter than a vehicle; make it longer [line]",
    )


@pytest.mark.parametrize(("rate", "is_low"), [(1, True), (2, True), (4, True), (5, False)])
@pytest.mark.parametrize("paths", [(), (DOWN,)])
def test_a_low_frame_rate(paths: tuple[Path, ...], rate: float, is_low: bool) -> None:
    expected = "fewer than 5 frames per second: vehicles are missed; record more [frame-rate]"
    found = counts(frames(*paths, rate=rate, seconds=60), LINE).warnings
    assert (expected in found) == is_low
