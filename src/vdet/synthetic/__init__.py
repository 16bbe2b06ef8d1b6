"""Drawn road scenes with their truth, for the demo and the tests.

`scene` describes scenes and makes random ones from a seed, `render` draws them and gives the boxes
of their vehicles.
"""
