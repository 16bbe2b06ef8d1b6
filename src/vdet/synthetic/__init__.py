"""Drawn road scenes and patches with their truth, for the demo and the tests.

`scene` describes a scene, `random_scenes` makes scenes from a seed, `render` draws them, `truth`
gives the boxes of the vehicles, `patches` and `clip` write files.
"""

from vdet.synthetic.clip import frames, write_clip, write_truth
from vdet.synthetic.patches import background_patches, vehicle_patches, write_patches
from vdet.synthetic.random_scenes import demo_scene, empty_road, traffic_scene
from vdet.synthetic.render import Renderer, render
from vdet.synthetic.truth import TrueBox, must_be_found, true_boxes

__all__ = [
    "Renderer",
    "TrueBox",
    "background_patches",
    "demo_scene",
    "empty_road",
    "frames",
    "must_be_found",
    "render",
    "traffic_scene",
    "true_boxes",
    "vehicle_patches",
    "write_clip",
    "write_patches",
    "write_truth",
]
