"""Labelled video → patches to train with: vehicles, their surroundings, and false alarms.

`placing` says how windows lie to a vehicle, `choosing` takes some of each kind from a frame,
`archive` writes them as `vdet.learn.dataset` reads them, `mining` goes through the video.

Source of mining false alarms: Sung & Poggio, "Example-based Learning for View-based Human Face
Detection", 1998; for HOG and linear SVM, Dalal & Triggs, 2005, section 4.
"""

from vdet.learn.mining.mining import Mined, MiningJob, mine

__all__ = ["Mined", "MiningJob", "mine"]
