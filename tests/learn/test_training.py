"""Training: it learns, a killed run goes on to the same weights, and bad input is refused."""

import json

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra `train` (torch)")
pytest.importorskip("onnx", reason="needs the extra `train` (onnx)")
pytest.importorskip("matplotlib", reason="needs the extra `train` (matplotlib)")

from benchmarks.samples import draw_sample  # noqa: E402

from hiproof.errors import InputError, OutputError, SettingsError  # noqa: E402
from hiproof.learn import TrainSettings, train  # noqa: E402
from hiproof.learn.training import Trainer, open_source  # noqa: E402
from hiproof.segment import segment  # noqa: E402
from hiproof.segment.arrange import Layout  # noqa: E402
from hiproof.settings import Settings  # noqa: E402

pytestmark = pytest.mark.train

TINY = TrainSettings(
    types=("flat", "gable"), samples=48, epoch=24, validation=16, batch=8,
    layout=Layout(points=64, levels=(32, 16, 8), neighbours=6),
)  # fmt: skip


def read_weights(folder):
    return torch.load(folder / "checkpoint.pt", weights_only=True)["network"]


def test_a_killed_run_goes_on_to_the_same_weights(tmp_path):
    lines, news = [], []
    path = train("simulated", tmp_path / "whole", TINY, lines.append, lambda *new: news.append(new))
    assert len(lines) == 2 and "balanced accuracy" in lines[0]
    assert [new for new in news if new[0] == "arrange"][-1] == ("arrange", 16, 16)
    shown = [new[1:] for new in news if new[0] == "train"]
    assert shown == [(done, 48) for done in (0, 8, 12, 20, 24, 24, 32, 36, 44, 48)]

    def kill(line):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train("simulated", tmp_path / "killed", TINY, report=kill)
    train("simulated", tmp_path / "killed", TINY, report=lines.append)
    assert len(lines) == 3
    whole, resumed = read_weights(tmp_path / "whole"), read_weights(tmp_path / "killed")
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)

    card = json.loads((tmp_path / "whole" / "model_card.json").read_text())
    assert card["trained_on"]["device"]
    assert "simulated" in card["data"]
    assert card["settings"]["seed"] == 1
    assert (tmp_path / "whole" / "curve.png").stat().st_size > 1000
    assert "balanced accuracy" in (tmp_path / "whole" / "model_card.md").read_text()

    points = draw_sample(np.random.default_rng(0), types=("gable",)).xyz
    settings = Settings().replace({"segment": {"weights": str(path)}})
    assert set(segment(points, settings).types) == {"flat", "gable"}


def test_curved_types_are_classes_where_they_are_named(tmp_path):
    settings = TrainSettings(**{**vars(TINY), "types": ("flat", "dome"), "samples": 24})
    path = train("simulated", tmp_path, settings)
    points = draw_sample(np.random.default_rng(0), types=("dome",)).xyz
    result = segment(points, Settings().replace({"segment": {"weights": str(path)}}))
    assert set(result.types) == {"flat", "dome"}


def test_the_loss_of_a_repeated_batch_falls(tmp_path):
    trainer = Trainer(open_source("simulated", TINY.types), TINY, tmp_path)
    batch = [trainer.training_cloud(i) for i in range(8)]
    losses = [trainer.step(batch) for _ in range(30)]
    assert losses[-1] < 0.6 * losses[0]


def test_a_checkpoint_of_other_types_or_broken_is_refused(tmp_path):
    train("simulated", tmp_path, TINY, report=lambda line: None)
    other = TrainSettings(**{**vars(TINY), "types": ("hip", "gable")})
    with pytest.raises(InputError, match="another folder"):
        train("simulated", tmp_path, other)
    (tmp_path / "checkpoint.pt").write_bytes(b"no checkpoint")
    with pytest.raises(InputError, match="checkpoint"):
        train("simulated", tmp_path, TINY)


def test_what_cannot_be_trained_on_is_refused(tmp_path):
    with pytest.raises(InputError, match="denhaag:FILE"):
        train("den haag", tmp_path, TINY)
    with pytest.raises(OutputError, match="folder"):
        (tmp_path / "file").touch()
        train("simulated", tmp_path / "file", TINY)
    if not torch.cuda.is_available():
        with pytest.raises(SettingsError, match="CUDA"):
            train("simulated", tmp_path, TrainSettings(**{**vars(TINY), "device": "cuda"}))
    with pytest.raises(SettingsError, match="epoch of at least"):
        train("simulated", tmp_path, TrainSettings(**{**vars(TINY), "epoch": 1}))
    with pytest.raises(SettingsError, match="auto, cpu, cuda"):
        train("simulated", tmp_path, TrainSettings(**{**vars(TINY), "device": "tpu"}))
