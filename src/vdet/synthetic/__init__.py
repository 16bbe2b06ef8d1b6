"""Drawn road scenes with their truth, for the demo and the tests.

`scene` describes a scene, `random_scenes` makes scenes from a seed, `render` draws them, `truth`
gives the boxes of the vehicles.
"""

from vdet.synthetic.random_scenes import busy_road, demo_scene, empty_road, traffic_scene
from vdet.synthetic.render import Renderer, frames, render, write_clip
from vdet.synthetic.truth import TrueBox, must_be_found, true_boxes, write_truth

__all__ = [
    "Renderer",
    "TrueBox",
    "busy_road",
    "demo_scene",
    "empty_road",
    "frames",
    "must_be_found",
    "render",
    "traffic_scene",
    "true_boxes",
    "write_clip",
    "write_truth",
]
