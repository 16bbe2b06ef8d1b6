"""Detectors: which vehicles are in a frame. All of them have the same protocol."""
