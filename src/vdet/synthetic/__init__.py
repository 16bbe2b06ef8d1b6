"""Drawn road scenes with their truth, for the demo and the tests.

`scene` describes a scene, `random_scenes` makes scenes from a seed, `render` draws them, `truth`
gives the boxes of the vehicles.
"""
