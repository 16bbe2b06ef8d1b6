"""A frame at full, half, quarter … size, so that each strip starts from what is near its scale."""

from vdet.features import halve, resize
from vdet.images import Image


class FramePyramid:
    """The searched rows of one frame, halved as often as strips ask for.

    Parameters
    ----------
    image
        BGR uint8 `(H, W, 3)`.
    top, bottom
        The rows that will be asked for.
    """

    def __init__(self, image: Image, top: int = 0, bottom: int | None = None) -> None:
        self.image = image
        self._top = top
        self._levels = [image[top:bottom]]

    def cut(self, rows: slice, columns: slice, width: int, height: int) -> Image:
        """Return a part of the frame (full-frame pixels), resized to `width` × `height`.

        The pixels are those of `resize(image[rows, columns], width, height)`.
        """
        top, bottom = rows.start - self._top, rows.stop - self._top
        level = 0
        sides = (top, bottom, columns.start, columns.stop)
        while _halves_exactly(sides) and _is_twice(sides, width, height):
            sides = (sides[0] // 2, sides[1] // 2, sides[2] // 2, sides[3] // 2)
            level += 1
        part = self._level(level)[sides[0] : sides[1], sides[2] : sides[3]]
        return resize(part, width, height)

    def _level(self, number: int) -> Image:
        while len(self._levels) <= number:
            last = self._levels[-1]
            height, width = last.shape[:2]
            self._levels.append(halve(last[: height // 2 * 2, : width // 2 * 2]))
        return self._levels[number]


def _halves_exactly(sides: tuple[int, int, int, int]) -> bool:
    return all(side % 2 == 0 for side in sides)


def _is_twice(sides: tuple[int, int, int, int], width: int, height: int) -> bool:
    return sides[1] - sides[0] >= 2 * height and sides[3] - sides[2] >= 2 * width
