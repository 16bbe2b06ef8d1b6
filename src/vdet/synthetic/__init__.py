"""Road scenes and patches drawn in code, with their truth: the demo and the tests live on them.

`scene` says what a scene is, `worlds` makes some from a seed, `render` draws them, `truth` tells
where the vehicles are, `patches` and `clip` write them to files.
"""

from vdet.synthetic.clip import counts, frames, write_clip, write_truth
from vdet.synthetic.patches import background_patches, vehicle_patches, write_patches
from vdet.synthetic.render import Renderer, render
from vdet.synthetic.truth import TrueBox, truth
from vdet.synthetic.worlds import default_clip, empty_road, traffic

__all__ = [
    "Renderer",
    "TrueBox",
    "background_patches",
    "counts",
    "default_clip",
    "empty_road",
    "frames",
    "render",
    "traffic",
    "truth",
    "vehicle_patches",
    "write_clip",
    "write_patches",
    "write_truth",
]
