"""Labelled video → patches for the training: vehicles, their surroundings, and false alarms.

`choosing` compares the windows of a frame with its vehicles and takes some of each kind. `mining`
goes through the video and writes them as `vdet.learn.dataset` reads them.

Source of mining false alarms: Sung & Poggio, "Example-based Learning for View-based Human Face
Detection", 1998; for HOG and linear SVM, Dalal & Triggs, 2005, section 4.
"""

from vdet.learn.mining.mining import MiningJob, MiningResult, mine

__all__ = ["MiningJob", "MiningResult", "mine"]
