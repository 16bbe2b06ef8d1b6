"""The section `train`: how models are trained."""

from vdet.config.mining import MiningSettings
from vdet.config.network import NetworkTrainingSettings
from vdet.config.section import Section
from vdet.config.training import SvmTrainingSettings


class TrainSettings(Section):
    """Training of models: `vdet train`, `vdet mine` and `vdet train-net`."""

    svm: SvmTrainingSettings = SvmTrainingSettings()
    mine: MiningSettings = MiningSettings()
    net: NetworkTrainingSettings = NetworkTrainingSettings()
