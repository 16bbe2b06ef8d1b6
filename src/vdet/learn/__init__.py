"""Patches to learn from, training, mining of hard negatives, and tests of the classifier."""
