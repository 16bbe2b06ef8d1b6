"""Labelled videos and pictures → patches for the training: vehicles, and false alarms.

`sources` gives the frames, `searching` their windows. `choosing` compares the windows of a frame
with its vehicles and takes some of each kind. `mining` writes them in the form that
`vdet.learn.svm.dataset` reads.

Source of mining false alarms: Sung & Poggio, "Example-based Learning for View-based Human Face
Detection", 1998; for HOG and linear SVM, Dalal & Triggs, 2005, section 4.
"""

from vdet.learn.svm.mining.mining import MiningJob, MiningResult, mine
from vdet.learn.svm.mining.sources import PictureSource, VideoSource

__all__ = ["MiningJob", "MiningResult", "PictureSource", "VideoSource", "mine"]
