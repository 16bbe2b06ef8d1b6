"""From the strength of a detection to its score: the share of such detections that are vehicles.

The score is a logistic function of the strength's logarithm. Its two numbers are in the settings,
because the strength is another quantity with votes than with outlines. They were fitted by maximum
likelihood to detections in frames 1 to 880 of the project video, by models that had not seen the
frame; a detection is right where its intersection over union with a vehicle is at least 0.5, and
does not count in an ignore region.

==============  ======  =====  ==========  ==========================  =================
settings        middle  slope  detections  model                       calibration error
==============  ======  =====  ==========  ==========================  =================
default, votes  0.272   3.50   1,085       five-fold (`make folds`)    0.027
seed, outlines  7.05    1.14   949         the seed model              0.114
==============  ======  =====  ==========  ==========================  =================

The error is the mean difference of score and share, over bins of the score. That of the seed is
large because its outlines of strong heat are often wider than the vehicle.

Source: Platt, "Probabilistic Outputs for Support Vector Machines", 1999.
"""

import numpy as np
import numpy.typing as npt

from vdet.boxes import Float32Array
from vdet.config.schema import ScoreSettings


def detection_scores(strengths: npt.ArrayLike, settings: ScoreSettings) -> Float32Array:
    """Return the score, 0 to 1, of each detection.

    Parameters
    ----------
    strengths
        Shape `(n,)`, not negative: weight of the votes, or peak of the heat.

    Returns
    -------
    float32 `(n,)`.
    """
    evidence = np.asarray(strengths, np.float64).tolist()
    return np.array([settings.of(each) for each in evidence], np.float32)
