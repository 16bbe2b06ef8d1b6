"""Colours, noise, the sky, and the tone curve of the camera.

Colours are linear RGB, float32 `(…, 3)`, without an upper limit; the tone curve makes them
displayable. Directions are unit vectors `(…, 3)`: x to the right, y up, z ahead.
"""

import numpy as np
from scipy.ndimage import map_coordinates

from vdet.boxes import Float32Array
from vdet.media.images import Image

EXPOSURE = 0.52


def rgb(red: int, green: int, blue: int) -> Float32Array:
    """Return a colour given as sRGB values, 0 to 255."""
    return ((np.array([red, green, blue], np.float32) / 255) ** 2.2).astype(np.float32)


def unit(vectors: Float32Array) -> Float32Array:
    """Return vectors `(…, 3)` with length 1."""
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True), np.float32)


SUN = unit(np.array([-0.60, 0.50, -0.62], np.float32))
"""Direction to the sun: low, to the left, behind the camera."""
SUNLIGHT = np.array([3.2, 2.65, 2.0], np.float32)
SKYLIGHT = rgb(158, 186, 228)

_HAZE = rgb(214, 214, 212)
_ZENITH, _MIDDLE, _HORIZON = (
    1.3 * rgb(44, 98, 178),
    1.3 * rgb(122, 170, 222),
    1.3 * rgb(232, 222, 205),
)
_CLOUD, _CLOUD_SHADOW = 1.5 * rgb(255, 250, 243), 1.3 * rgb(196, 204, 218)
_TREES, _GROUND = rgb(58, 70, 44), rgb(104, 104, 104)


def mix(color: Float32Array, other: Float32Array, share: Float32Array) -> Float32Array:
    """Return colours with a `share`, 0 to 1, of another colour."""
    return np.asarray(color + (other - color) * share[..., None], np.float32)


def ramp(start: float, end: float, values: Float32Array) -> Float32Array:
    """Return 0 up to `start` and 1 from `end`, with a smooth transition."""
    share = np.clip((values - start) / (end - start), 0, 1)
    return np.asarray(share * share * (3 - 2 * share), np.float32)


class Noise:
    """Periodic noise over a plane, with mean 0 and deviation 1.

    `falloff` is the exponent by which the amplitude falls with the frequency: 0 is white noise.
    """

    _SIZE = 512

    def __init__(self, seed: int, falloff: float) -> None:
        white = np.random.default_rng(seed).standard_normal((self._SIZE, self._SIZE))
        frequency = np.fft.fftfreq(self._SIZE) * self._SIZE
        radius = np.hypot(*np.meshgrid(frequency, frequency))
        radius[0, 0] = np.inf
        values = np.fft.ifft2(np.fft.fft2(white) * radius**-falloff).real
        self._values = (values / values.std()).astype(np.float32)

    def __call__(self, x: Float32Array, y: Float32Array | float, period: float) -> Float32Array:
        """Return the noise at places, given in a unit of which `period` is the repetition."""
        places = np.broadcast_arrays(y, x)
        scaled = [np.asarray(place, np.float64) * (self._SIZE / period) for place in places]
        values = map_coordinates(self._values, scaled, order=1, mode="grid-wrap")
        return np.asarray(values, np.float32)


GRAIN, ROUGH, SMOOTH = Noise(1, 0.0), Noise(2, 1.0), Noise(3, 1.7)


def sky(directions: Float32Array) -> Float32Array:
    """Return the colours of the sky with its clouds; below the horizon, those at the horizon."""
    up = np.clip(directions[..., 1], 0, 1)
    color = mix(_HORIZON, _MIDDLE, ramp(0, 0.16, up))
    color = mix(color, _ZENITH, ramp(0.08, 0.62, up))
    height = np.maximum(up, 0.012)  # the clouds lie in a plane
    x, z = directions[..., 0] / height, directions[..., 2] / height
    density = SMOOTH(1.1 * x + 3.4, 0.5 * z + 2.2, 15) + 0.3 * SMOOTH(1.6 * x, 0.9 * z, 5)
    density += 0.1 * ROUGH(x, 0.7 * z, 4)
    cloud = mix(_CLOUD, _CLOUD_SHADOW, 0.6 * ramp(0.9, 2.8, density))
    return mix(color, cloud, 0.75 * ramp(-0.4, 1.9, density) * ramp(0.015, 0.14, up))


def surroundings(directions: Float32Array) -> Float32Array:
    """Return the colours that a vehicle reflects: sky, a line of trees, and the road."""
    up = directions[..., 1]
    color = mix(sky(directions), _TREES, ramp(-0.10, -0.04, -up))
    return mix(color, _GROUND, ramp(0.02, 0.10, -up))


def haze(color: Float32Array, distance: Float32Array) -> Float32Array:
    """Return colours as seen through `distance` metres of air."""
    return mix(color, _HAZE, 1 - np.exp(-distance / 900))


def develop(color: Float32Array) -> Image:
    """Return the BGR uint8 image of colours, by a filmic tone curve (Narkowicz 2015)."""
    light = np.maximum(color[..., ::-1], 0) * EXPOSURE
    curve = light * (2.51 * light + 0.03) / (light * (2.43 * light + 0.59) + 0.14)
    return np.asarray(np.clip(curve, 0, 1) ** (1 / 2.2) * 255 + 0.5, np.uint8)
