"""The network: which cells find which vehicle, the loss, a training of seconds, the ONNX file."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip(
    "torch", reason="torch is not installed; `make nettest` installs it and runs these tests"
)

from torch import Tensor  # noqa: E402

from learn.net.blocks import block_picture, block_source  # noqa: E402
from vdet.config.schema import NetworkSettings, NetworkTrainingSettings  # noqa: E402
from vdet.detect.onnx.detector import NetworkModel  # noqa: E402
from vdet.detect.onnx.network import Header, cell_centers  # noqa: E402
from vdet.errors import DataError  # noqa: E402
from vdet.learn.net.network import (  # noqa: E402
    Network,
    Vehicles,
    assign,
    class_weights,
    decode,
    export_network,
    flatten,
    giou,
    paired_iou,
    start_from,
    uncounted,
)
from vdet.learn.net.sources import UNLABELLED, NetSample, NetSource  # noqa: E402
from vdet.learn.net.training import train_network  # noqa: E402
from vdet.media import Picture  # noqa: E402
from vdet.testing import check_detector  # noqa: E402

CLASSES = ("car", "truck", "bus")
QUICK = NetworkTrainingSettings(
    steps=200, batch=4, size=(256, 128), learning_rate=3e-3, classes=CLASSES
)


def box(*sides: float) -> Tensor:
    return torch.tensor([sides], dtype=torch.float32)


def test_overlaps_of_boxes_that_share_a_third_and_of_boxes_apart() -> None:
    assert paired_iou(box(0, 0, 2, 2), box(1, 0, 3, 2)).item() == pytest.approx(1 / 3)
    assert giou(box(0, 0, 2, 2), box(1, 0, 3, 2)).item() == pytest.approx(1 / 3)
    # Union 2, smallest box around both 3: 0 - 1/3.
    assert giou(box(0, 0, 1, 1), box(2, 0, 3, 1)).item() == pytest.approx(-1 / 3)


class TestAssignment:
    CENTERS, STRIDES = map(torch.from_numpy, cell_centers(256, 128))

    def assigned(self, *boxes: tuple[float, float, float, float]) -> tuple[Tensor, Tensor]:
        """Return the rows of the vehicles and the cells that are to find them."""
        vehicles = Vehicles(
            torch.zeros(len(boxes), dtype=torch.long),
            torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4),
            torch.zeros(len(boxes), dtype=torch.long),
        )
        cells = len(self.CENTERS)
        guesses = decode(torch.zeros(1, cells, 4), self.CENTERS, self.STRIDES)
        row, cell, _ = assign(torch.zeros(1, cells), guesses, vehicles, self.CENTERS, self.STRIDES)
        return row, cell

    def test_a_vehicle_gets_cells_inside_it(self) -> None:
        _, cells = self.assigned((40, 40, 100, 90))
        assert len(cells)
        middles = self.CENTERS[cells]
        assert (middles > torch.tensor([40, 40])).all()
        assert (middles < torch.tensor([100, 90])).all()

    @pytest.mark.parametrize("x", range(20, 36, 3))
    def test_a_small_vehicle_gets_a_cell_wherever_it_is(self, x: int) -> None:
        assert len(self.assigned((x, 33, x + 10, 39))[1])

    def test_a_cell_finds_one_vehicle_only(self) -> None:
        rows, cells = self.assigned((40, 40, 100, 90), (50, 44, 108, 92))
        assert len(set(cells.tolist())) == len(cells)
        assert set(rows.tolist()) == {0, 1}

    def test_a_picture_without_vehicles_gets_none(self) -> None:
        assert len(self.assigned()[1]) == 0


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Network, list[float]]:
    losses: list[float] = []
    checkpoint = tmp_path_factory.mktemp("trained") / "net.ckpt"
    network = train_network(
        [block_source()], QUICK, checkpoint, progress=lambda _, loss: losses.append(loss)
    )
    return network, losses


def test_the_loss_falls(trained: tuple[Network, list[float]]) -> None:
    losses = trained[1]
    assert len(losses) == QUICK.steps
    assert sum(losses[-10:]) < 0.7 * sum(losses[:10])


def test_the_exported_network_gives_what_the_trained_one_gives(
    trained: tuple[Network, list[float]], tmp_path: Path
) -> None:
    import onnxruntime

    network, _ = trained
    path = tmp_path / "net.onnx"
    export_network(network, Header(classes=CLASSES), path)
    image = block_picture(1).image
    [cells] = onnxruntime.InferenceSession(path).run(None, {"image": image[np.newaxis]})
    with torch.no_grad():
        expected = flatten(network(torch.from_numpy(image[np.newaxis]).permute(0, 3, 1, 2).float()))
    assert cells == pytest.approx(expected.numpy(), abs=1e-3)


def test_a_training_goes_on_from_the_weights_of_an_exported_network(
    trained: tuple[Network, list[float]], tmp_path: Path
) -> None:
    path = tmp_path / "base.onnx"
    export_network(trained[0], Header(classes=CLASSES), path)
    settings = QUICK.model_copy(update={"steps": 3, "learning_rate": 1e-6})
    losses: list[float] = []
    train_network(
        [block_source()], settings, tmp_path / "a.ckpt", base=path,
        progress=lambda _, loss: losses.append(loss),
    )  # fmt: skip
    assert losses[0] < 0.6 * trained[1][0]


def test_a_wider_network_gives_at_first_what_its_narrower_base_gives(tmp_path: Path) -> None:
    path, pictures = tmp_path / "base.onnx", torch.rand(4, 3, 64, 96) * 255
    base = Network(len(CLASSES), channels=0.5).eval()
    export_network(base, Header(classes=CLASSES), path)
    wider = Network(len(CLASSES), channels=0.75).train()
    assert [stage[0].pointwise.out_channels for stage in wider.stages] == [32, 48, 176, 288]
    start_from(wider, path, pictures, CLASSES)
    assert torch.allclose(flatten(wider(pictures)), flatten(base(pictures)), atol=1e-3)


def test_the_classes_of_a_base_are_found_by_their_names(tmp_path: Path) -> None:
    path, pictures = tmp_path / "base.onnx", torch.rand(4, 3, 64, 96) * 255
    base = Network(3).eval()
    export_network(base, Header(classes=CLASSES), path)
    other = Network(4).train()
    start_from(other, path, pictures, ("person", "bus", "car", "bicycle"))
    expected, found = flatten(base(pictures)), flatten(other(pictures))
    for mine, theirs in enumerate([0, 1, 2, 3, 4, None, 7, 5, None]):
        if theirs is not None:
            assert torch.allclose(found[..., mine], expected[..., theirs], atol=1e-3)


def test_what_looks_like_a_class_without_labels_is_no_background() -> None:
    centers = torch.from_numpy(cell_centers(64, 32)[0])
    everywhere, left = [0.0, 0, 64, 32], [0.0, 0, 32, 32]
    regions = Vehicles(
        torch.tensor([0, 1]), torch.tensor([everywhere, left]), torch.tensor([2, UNLABELLED])
    )
    seen = torch.zeros(2, len(centers), dtype=torch.long)
    seen[0, 3] = 2
    picture, cell = uncounted(regions, centers, seen)
    assert cell[picture == 0].tolist() == [3]
    assert (centers[cell[picture == 1]][:, 0] < 32).all()
    assert (picture == 1).sum() == (centers[:, 0] < 32).sum()


def test_rare_classes_weigh_more_and_unknown_kinds_as_much_as_the_most_frequent() -> None:
    classes = np.array([0] * 16 + [1] * 4 + [UNLABELLED] * 2)
    boxes = np.array([[0, 0, 9, 9]] * len(classes), np.float32)
    sample = NetSample(np.zeros((9, 9, 3), np.uint8), boxes, classes, np.zeros(22, np.bool_))
    weights = class_weights([NetSource("all", [sample])], 3)
    assert weights.tolist() == [1, 2, 4, 1]


def test_a_base_of_another_form_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "junk.onnx"
    path.write_bytes(b"junk")
    with pytest.raises(DataError, match="is not a network of vdet train-net"):
        train_network([block_source(4)], QUICK, tmp_path / "a.ckpt", base=path)


def test_what_was_learnt_is_found_again(
    trained: tuple[Network, list[float]], tmp_path: Path
) -> None:
    network, _ = trained
    path = tmp_path / "net.onnx"
    export_network(network, Header(classes=CLASSES, pixels=256 * 128), path)
    model = NetworkModel(NetworkSettings(min_score=0.2), path)
    found = wanted = right_class = 0
    for seed in range(100, 120):
        sample = block_picture(seed)
        detector = model.for_video(256, 128, [sample.image])
        detections = detector.detect(detector.search(Picture(sample.image), 0))
        assert detections.classes is not None
        names = [detections.names[class_] for class_ in detections.classes.tolist()]
        boxes = torch.tensor(detections.sides)
        wanted += len(sample.boxes)
        for truth, kind in zip(sample.boxes, sample.classes, strict=True):
            overlaps = paired_iou(boxes, torch.tensor(truth).expand(len(boxes), 4))
            if len(boxes) and overlaps.max() > 0.5:
                found += 1
                right_class += names[int(overlaps.argmax())] == CLASSES[kind]
    assert found >= 0.7 * wanted
    assert right_class >= 0.8 * found
    check_detector(model, [block_picture(7).image, block_picture(8).image])


def test_a_stopped_training_resumes_from_the_weights_of_its_checkpoint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vdet.learn.net.training.CHECKPOINT", 4)
    settings = QUICK.model_copy(update={"steps": 12})
    source, path = [block_source(8)], tmp_path / "net.ckpt"

    class Stopped(Exception):  # noqa: N818
        pass

    def stop(step: int, _: float) -> None:
        if step == 6:
            raise Stopped

    with pytest.raises(Stopped):
        train_network(source, settings, path, progress=stop)
    steps: list[int] = []

    def resume() -> Network:
        return train_network(source, settings, path, progress=lambda step, _: steps.append(step))

    whole, again = resume(), resume()
    assert steps == list(range(5, 13))
    parameters = sum(values.numel() for values in whole.parameters())
    assert path.stat().st_size < 2.2 * parameters  # half precision
    for trained, restored in zip(whole.parameters(), again.parameters(), strict=True):
        assert torch.allclose(trained, restored, rtol=1e-3, atol=1e-7)


def test_a_checkpoint_of_another_training_is_refused(tmp_path: Path) -> None:
    settings = QUICK.model_copy(update={"steps": 2})
    source, path = [block_source(4)], tmp_path / "net.ckpt"
    train_network(source, settings, path)
    other = settings.model_copy(update={"learning_rate": 1e-4})
    belongs = r"net\.ckpt: belongs to a training run with"
    with pytest.raises(DataError, match=f"{belongs} other settings"):
        train_network(source, other, path)
    with pytest.raises(DataError, match=f"{belongs} .* base"):
        train_network(source, settings, path, base=tmp_path / "base.onnx")
    with pytest.raises(DataError, match=f"{belongs} .* images"):
        train_network([block_source(5)], settings, path)
    path.write_bytes(b"junk")
    with pytest.raises(DataError, match=r"net\.ckpt: is not a checkpoint of this training run"):
        train_network(source, settings, path)


def test_a_weight_for_a_source_that_is_not_there_is_refused(tmp_path: Path) -> None:
    settings = QUICK.model_copy(update={"weights": {"block": 2.0}})
    message = r"train\.net\.weights: unknown set block; there are blocks"
    with pytest.raises(DataError, match=message):
        train_network([block_source(2)], settings, tmp_path / "net.ckpt")
