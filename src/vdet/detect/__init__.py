"""Vehicles in one frame: the detectors, each behind one protocol."""
