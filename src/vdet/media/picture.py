"""A picture in the form in which it came: planes or BGR."""

from functools import cached_property

from vdet.media.images import Image
from vdet.media.planes import Planes


class Picture:
    """An upright picture. What it was made from is shared, so nobody may change it.

    Parameters
    ----------
    pixels
        An image, BGR uint8 `(H, W, 3)`, or planes.
    """

    def __init__(self, pixels: Image | Planes) -> None:
        self.pixels = pixels

    @property
    def height(self) -> int:
        """Pixels."""
        return int(self.pixels.shape[0])

    @property
    def width(self) -> int:
        """Pixels."""
        return int(self.pixels.shape[1])

    @property
    def planes(self) -> Planes | None:
        """The planes, if it came so."""
        return self.pixels if isinstance(self.pixels, Planes) else None

    @cached_property
    def image(self) -> Image:
        """BGR uint8 `(H, W, 3)`; of planes, it is made when it is first asked for."""
        return self.pixels.to_image() if isinstance(self.pixels, Planes) else self.pixels
