"""A camera as its calibration describes it."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vdet.errors import ConfigError

_ASPECT_TOLERANCE = 0.005  # 854×480 passes for 1280×720


@dataclass(frozen=True, slots=True)
class Camera:
    """A pinhole with lens distortion (Brown's model, as OpenCV has it), for one frame size.

    All lengths are pixels; whole numbers are at pixel centres, x to the right, y down.
    """

    width: int
    height: int
    focal: tuple[float, float]
    """Focal length along x and y."""
    center: tuple[float, float]
    """Principal point `(x, y)`."""
    distortion: tuple[float, float, float, float, float]
    """k1, k2, p1, p2, k3."""
    rms: float
    """Root mean square distance of the calibration's corners from where the camera sees them."""

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """The camera matrix, `(3, 3)`."""
        (fx, fy), (cx, cy) = self.focal, self.center
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])

    @property
    def flaw(self) -> str | None:
        """What cannot be true of a camera; None for one that may be."""
        shortest, longest = 0.1 * self.width, 100.0 * self.width
        if not all(shortest <= length <= longest for length in self.focal):
            return f"focal lengths should be {shortest:g} to {longest:g} px at this frame size"
        x, y = self.center
        if not (0 <= x < self.width and 0 <= y < self.height):
            return f"the principal point should lie in the frame (is {x:.6g}, {y:.6g})"
        return None

    def scaled_to(self, width: int, height: int) -> "Camera":
        """Return the same camera for frames of another size but the same shape.

        Raises
        ------
        ConfigError
            The ratio of width to height differs, so the frame is no enlargement or reduction.
        """
        across, down = width / self.width, height / self.height
        if abs(across / down - 1) > _ASPECT_TOLERANCE:
            raise ConfigError(
                f"the camera was calibrated for {self.width}×{self.height} and cannot be scaled "
                f"to {width}×{height}, another shape; calibrate with photographs of that shape"
            )
        (fx, fy), (cx, cy) = self.focal, self.center
        return replace(
            self,
            width=width,
            height=height,
            focal=(fx * across, fy * down),
            center=((cx + 0.5) * across - 0.5, (cy + 0.5) * down - 0.5),
            rms=self.rms * down,
        )
