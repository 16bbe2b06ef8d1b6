"""A camera on a pole over a flat road, without lens distortion."""

import numpy as np

from vdet.boxes import Float64Array

WIDTH, HEIGHT = 1280, 720
FOCAL, ABOVE = 1000.0, 8.0
CORNERS = np.array([(-6.0, 14.0), (6.0, 14.0), (6.0, 50.0), (-6.0, 50.0)])
"""Points of the road, metres to the right and ahead."""


def seen(places: Float64Array, tilt: float = 0.25) -> Float64Array:
    """Return the pixels `(n, 2)` of places on the road, metres to the right and ahead."""
    x, z = places.T
    sine, cosine = np.sin(tilt), np.cos(tilt)
    down, depth = cosine * ABOVE - sine * z, sine * ABOVE + cosine * z
    return np.column_stack([x / depth, down / depth]) * FOCAL + (WIDTH / 2, HEIGHT / 2)


def ground_text(pixels: Float64Array, metres: Float64Array) -> str:
    """Return a file of settings with these points of the ground."""
    points = [
        f"  - {{pixel: [{x:.3f}, {y:.3f}], metres: [{right}, {ahead}]}}"
        for (x, y), (right, ahead) in zip(pixels, metres, strict=True)
    ]
    return "\n".join(["camera:", f"  size: [{WIDTH}, {HEIGHT}]", "  ground:", *points])
