"""Detectors: they find the vehicles in a frame, behind one protocol."""
