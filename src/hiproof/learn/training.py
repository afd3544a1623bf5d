"""Training by PointNeXt's recipe: AdamW, a cosine schedule, label smoothing, checkpoints.

Every random draw is named by the seed and a sample's or an epoch's number, so that a run that was
killed and resumed gives the weights of one that was not.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import torch
from torch import nn

from ..errors import InputError, OutputError, SettingsError
from ..progress import Update, count_progress, ignore_progress
from ..segment.arrange import Layout, arrange
from ..segment.scores import Scores
from .data import open_source
from .export import export, read_weights, write_card, write_curve
from .network import NetworkSettings, RoofNetwork, network_inputs
from .sample import TRAINING, VALIDATION, AugmentSettings, Sample, Source, symmetric, vary_cloud


@dataclass(frozen=True)
class TrainSettings:
    """The settings of training.

    `samples` clouds are shown in all, each made one `views` times, `epoch` between validations. A
    validation takes `validation` clouds. `rate` and `decay` are AdamW's, the rate rises over the
    share `warm_up` and falls as a cosine; `average` is the running average's memory a step. `start`
    names an ONNX file of this kind whose weights to begin with, such as the shipped one, instead of
    random ones.
    """

    types: tuple[str, ...] = ()
    samples: int = 150_000
    epoch: int = 6_000
    views: int = 2
    validation: int = 1_000
    batch: int = 32
    rate: float = 2e-3
    decay: float = 0.02
    warm_up: float = 0.01
    smoothing: float = 0.05
    average: float = 0.998
    seed: int = 1
    threads: int = 1
    device: str = "auto"
    start: str = ""
    layout: Layout = field(default_factory=Layout)
    augment: AugmentSettings = field(default_factory=AugmentSettings)


def train(
    data: str | list[str],
    out: str | Path,
    settings: TrainSettings | None = None,
    report: Callable[[str], object] = print,
    update: Update = ignore_progress,
) -> Path:
    """Train the network on `data`; write weights, curve, model card and checkpoints to `out`.

    `data`: "simulated", "denhaag:FILE", "roofn3d:DIR", or a list of these (the first makes up 70
    %). A checkpoint in `out` is resumed. `report` takes a line after every epoch, `update` how many
    clouds of a stage are done. Returns the ONNX file of the best epoch. Raises InputError for data
    that cannot be used, OutputError for a folder that cannot be written, SettingsError for a device
    that is not there or an epoch too short.
    """
    settings = settings or TrainSettings()
    if settings.epoch < 2 * settings.views or settings.batch < 2:
        raise SettingsError(
            f"expected an epoch of at least {2 * settings.views} clouds in batches of 2 or more, "
            f"got {settings.epoch} in batches of {settings.batch}"
        )
    source = open_source(data, settings.types, settings.seed)
    folder = writable_folder(out)
    torch.set_num_threads(settings.threads)
    trainer = Trainer(source, settings, folder, update)
    trainer.resume()
    while trainer.epoch < trainer.epochs:
        trainer.run_epoch()
        trainer.validate()
        trainer.save()
        write_curve(trainer.history, folder / "curve.png")
        report(trainer.line())
    return trainer.finish()


class Trainer:
    """A training run: network, running average, optimiser, history, and its files' place."""

    def __init__(
        self,
        source: Source,
        settings: TrainSettings,
        folder: Path,
        update: Update = ignore_progress,
    ):
        torch.manual_seed(settings.seed)
        self.source, self.settings, self.folder, self.update = source, settings, folder, update
        self.device = chosen_device(settings.device)
        network = NetworkSettings(types=source.types, layout=settings.layout)
        self.network = RoofNetwork(network).to(self.device)
        if settings.start:
            read_weights(self.network, settings.start)
        self.averaged = RoofNetwork(network).to(self.device).eval()
        self.averaged.load_state_dict(self.network.state_dict())
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), settings.rate, weight_decay=settings.decay
        )
        self.epoch, self.seconds = 0, 0.0
        self.history: list[dict[str, Any]] = []
        self.best: dict[str, Any] = {"score": -math.inf}
        count = settings.validation
        self.validation = [
            arrange_sample(source.sample(VALIDATION, index), settings.layout)
            for index in count_progress(range(count), "arrange", update, count)
        ]

    @property
    def epochs(self) -> int:
        """Return the number of epochs that show as many clouds as the settings ask for."""
        return math.ceil(self.settings.samples / self.settings.epoch)

    def run_epoch(self):
        """Show `settings.epoch` fresh clouds."""
        settings, start = self.settings, perf_counter()
        torch.manual_seed(settings.seed * 1_000_003 + self.epoch)
        self.network.train()
        losses = []
        shown, total = self.epoch * settings.epoch, self.epochs * settings.epoch
        self.update("train", shown, total)
        for number, batch in enumerate(self.batches()):
            self.set_rate(
                (self.epoch * settings.epoch + number * settings.batch) / settings.samples
            )
            losses.append(self.step(batch))
            shown += len(batch)
            self.update("train", shown, total)
            self.update_average(self.epoch * settings.epoch // settings.batch + number)
        self.epoch += 1
        self.seconds += perf_counter() - start
        self.history.append({"epoch": self.epoch, "loss": float(np.mean(losses))})

    def batches(self):
        """Yield the epoch's batches.

        Fresh clouds come first, then the same again in another order and other symmetries. A last
        batch of a single cloud is left out: it has no statistics to normalise by.
        """
        settings = self.settings
        new_items = settings.epoch // settings.views
        clouds = []
        for index in range(0, new_items - 1, settings.batch):
            batch = [
                self.training_cloud(self.epoch * new_items + i)
                for i in range(index, min(index + settings.batch, new_items))
            ]
            clouds += batch
            yield batch
        rng = np.random.default_rng([settings.seed, 19, self.epoch])
        for _ in range(settings.views - 1):
            order = rng.permutation(new_items)
            for index in range(0, new_items - 1, settings.batch):
                yield [turn_cloud(clouds[i], rng) for i in order[index : index + settings.batch]]

    def training_cloud(self, index: int):
        """Return the arranged cloud of that number, varied at random by it, labels and type."""
        rng = np.random.default_rng([self.settings.seed, 7, index])
        sample = self.source.sample(TRAINING, index)
        xyz, labels = vary_cloud(sample.xyz, sample.labels, rng, self.settings.augment)
        arrangement = arrange(xyz, self.settings.layout)
        return turn_cloud((arrangement, labels[arrangement.select], sample.type), rng)

    def step(self, clouds) -> float:
        """Take one step of the optimiser on a batch of (arrangement, labels, type)."""
        inputs, labels, types = self.tensors(clouds)
        point_logits, type_logits = self.network(*inputs)
        smoothing = self.settings.smoothing
        loss = nn.functional.cross_entropy(point_logits, labels, label_smoothing=smoothing)
        loss = loss + nn.functional.cross_entropy(type_logits, types, label_smoothing=smoothing)
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self.optimiser.step()
        return float(loss.detach())

    def tensors(self, clouds):
        """Return network inputs, labels (not-roof the last) and types of a batch, on the device."""
        inputs = network_inputs([cloud[0] for cloud in clouds], self.settings.layout)
        all_labels = np.concatenate([cloud[1] for cloud in clouds])
        labels = torch.from_numpy(
            np.where(all_labels < 0, len(self.source.types), all_labels).astype(np.int64)
        )
        types = torch.tensor([cloud[2] for cloud in clouds])
        return (
            tuple(array.to(self.device) for array in inputs),
            labels.to(self.device),
            types.to(self.device),
        )

    def set_rate(self, progress: float):
        """Set the rate: linear warm-up, then a cosine to zero."""
        warm = self.settings.warm_up
        share = (
            progress / warm
            if progress < warm
            else 0.5 * (1 + math.cos(math.pi * (progress - warm) / (1 - warm)))
        )
        for group in self.optimiser.param_groups:
            group["lr"] = self.settings.rate * max(share, 1e-3)

    @torch.no_grad()
    def update_average(self, steps: int):
        """Update the running average of weights and statistics, short in the first `steps`."""
        keep = min(self.settings.average, (1 + steps) / (10 + steps))
        state = self.network.state_dict()
        for name, value in self.averaged.state_dict().items():
            if value.dtype.is_floating_point:
                value.lerp_(state[name], 1.0 - keep)
            else:
                value.copy_(state[name])

    @torch.no_grad()
    def validate(self):
        """Score the averaged weights and keep them if they are the best so far."""
        told_points, true_points, predicted, true = [], [], [], []
        for start in range(0, len(self.validation), self.settings.batch):
            inputs, labels, types = self.tensors(
                self.validation[start : start + self.settings.batch]
            )
            point_logits, type_logits = self.averaged(*inputs)
            told_points.append(point_logits.argmax(1).cpu())
            predicted.append(type_logits.argmax(1).cpu())
            true_points.append(labels.cpu())
            true.append(types.cpu())
        names = self.source.types
        types = Scores.of(torch.cat(true).numpy(), torch.cat(predicted).numpy(), names)
        points = Scores.of(
            torch.cat(true_points).numpy(), torch.cat(told_points).numpy(), (*names, "not roof")
        )
        record = self.history[-1]
        record |= {
            "balanced_accuracy": types.balanced_accuracy,
            "mean_iou": points.mean_iou,
            "recalls": types.recalls,
        }
        score = types.balanced_accuracy + points.mean_iou
        if score > self.best["score"]:
            weights = {name: value.clone() for name, value in self.averaged.state_dict().items()}
            self.best = {"score": score, "epoch": self.epoch, "weights": weights}

    def save(self):
        """Write the checkpoint, whole or not at all."""
        state = {
            "network": self.network.state_dict(), "averaged": self.averaged.state_dict(),
            "optimiser": self.optimiser.state_dict(), "epoch": self.epoch, "history": self.history,
            "best": self.best, "seconds": self.seconds, "types": self.source.types,
        }  # fmt: skip
        partial = self.folder / "checkpoint.partial"
        torch.save(state, partial)
        os.replace(partial, self.folder / "checkpoint.pt")

    def resume(self):
        """Resume from the folder's checkpoint, if any; InputError for one of another network."""
        path = self.folder / "checkpoint.pt"
        if not path.exists():
            return
        try:
            state = torch.load(path, map_location=self.device, weights_only=True)
            if tuple(state["types"]) != self.source.types:
                raise ValueError(f"it knows the types {', '.join(state['types'])}")
            self.network.load_state_dict(state["network"])
            self.averaged.load_state_dict(state["averaged"])
            self.optimiser.load_state_dict(state["optimiser"])
        except Exception as error:
            raise InputError(
                f"expected {path} to be a checkpoint of this training, got: "
                f"{str(error).splitlines()[0]}; train into another folder or remove it"
            ) from error
        self.epoch, self.seconds = state["epoch"], state["seconds"]
        self.history, self.best = state["history"], state["best"]

    def finish(self) -> Path:
        """Export the best epoch and write the model card."""
        self.averaged.load_state_dict(self.best["weights"])
        path = export(self.averaged.cpu(), self.folder / "roof_types.onnx")
        made_by = {
            "device": torch.cuda.get_device_name(self.device)
            if self.device.type == "cuda"
            else "CPU",
            "hours": round(self.seconds / 3600, 2),
        }
        write_card(
            self.folder,
            self.source.description,
            asdict(self.settings) | {"types": self.source.types},
            self.history,
            self.best["epoch"],
            made_by,
        )
        return path

    def line(self) -> str:
        """Return progress in one line."""
        last = self.history[-1]
        return (
            f"epoch {self.epoch}/{self.epochs}  loss {last['loss']:.3f}  balanced accuracy "
            f"{last['balanced_accuracy']:.3f}  point mIoU {last['mean_iou']:.3f}  lowest recall "
            f"{min(last['recalls'].values()):.3f}  {self.seconds / 60:.1f} min"
        )


def turn_cloud(cloud, rng: np.random.Generator):
    """Return an arranged, labelled cloud in another of the roof's symmetries."""
    arrangement, labels, type = cloud
    return replace(arrangement, features=symmetric(arrangement.features, rng)), labels, type


def arrange_sample(sample: Sample, layout: Layout):
    """Return a validation cloud (arrangement, labels of its chosen points, type), unchanged."""
    arrangement = arrange(sample.xyz, layout)
    return arrangement, sample.labels[arrangement.select], sample.type


def chosen_device(name: str) -> torch.device:
    """Return the device, "auto" a GPU if there is one; SettingsError when it is absent."""
    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise SettingsError(
            "expected a CUDA GPU for --device cuda, but PyTorch finds none; use --device cpu or "
            "auto"
        )
    if name not in ("auto", "cpu", "cuda"):
        raise SettingsError(f"expected the device to be one of auto, cpu, cuda, got {name!r}")
    return torch.device("cuda" if name == "cuda" or (name == "auto" and available) else "cpu")


def writable_folder(out: str | Path) -> Path:
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "checkpoint.partial").touch()
    except OSError as error:
        raise OutputError(
            f"expected a folder that can be written at {folder}, got: {error}; choose another --out"
        ) from error
    return folder
