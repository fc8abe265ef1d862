#!/usr/bin/env python3
"""Trains a network of the RangeNet family on SemanticKITTI folders.

  train.py training.yaml runs/mine --set data.train=[/data/kitti/dataset] --set network.kind=darknet53

Writes into the run's folder: config.yaml, last.pt (from which an interrupted run resumes), best.pt
(highest validation mIoU), curves.png and labels_*.png.
"""

import argparse
import copy
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml

from losses import class_weights, lovasz_softmax, weighted_cross_entropy
from networks import make_network
from samples import BatchesBySensor, TrainingSamples, open_scans, plain_sample
from scans import CLASS_NAMES
from validation import Confusion, save_curves, save_labelled_images


def read_config(file: str | Path, changes: list[str]) -> dict[str, Any]:
    """The configuration with changes of the form `a.b=value`; an unknown name is an error."""
    config = yaml.safe_load(Path(file).read_text())
    for change in changes:
        name, _, value = change.partition("=")
        *sections, field = name.split(".")
        place = config
        for section in sections:
            place = place.get(section, {})
        if field not in place and sections != ["network"]:
            raise SystemExit(f"--set {change}: {file} has no field '{name}'")
        place[field] = yaml.safe_load(value)
    return config


# What export.py needs of a run.
BEST_HOLDS = ("config", "trained_for", "lidar_height_m", "averaged", "epoch", "history")


class Rate:
    """Learning rate at each step, as a factor of the highest."""

    def __init__(self, settings: dict[str, Any], steps_per_epoch: int) -> None:
        self.settings = settings
        self.steps_per_epoch = steps_per_epoch
        self.warmup = max(1, round(settings["warmup_epochs"] * steps_per_epoch))
        self.total = settings["epochs"] * steps_per_epoch

    def __call__(self, step: int) -> float:
        if step < self.warmup:
            return (step + 1) / self.warmup
        if self.settings["schedule"] == "exponential":
            return self.settings["decay"] ** ((step - self.warmup) / self.steps_per_epoch)
        share = (step - self.warmup) / max(1, self.total - self.warmup)
        return 0.5 * (1 + math.cos(math.pi * min(1.0, share)))


def lidar_height_m(config: dict[str, Any]) -> float | None:
    """Height above the ground of most lidars of the scans: as configured, else that of the run or
    the model that this run starts from; None where nobody tells."""
    if config.get("lidar_height_m") is not None or not config["start_from"]:
        return config.get("lidar_height_m")
    file = Path(config["start_from"])
    if file.suffix == ".pt":
        return torch.load(file, map_location="cpu").get("lidar_height_m") if file.exists() else None
    file = (file.parent if file.suffix == ".onnx" else file) / "model.yaml"
    return yaml.safe_load(file.read_text()).get("lidar_height_m") if file.exists() else None


def precision(config: dict[str, Any], device: str) -> torch.autocast:
    """A context in which convolutions run in bfloat16, where the configuration says so."""
    reduced = config["optimiser"].get("bfloat16", False)
    return torch.autocast(torch.device(device).type, torch.bfloat16, enabled=reduced)


class Run:
    """A training run: network, optimiser, progress, and its files."""

    def __init__(self, config: dict[str, Any], folder: Path, device: str) -> None:
        self.config, self.folder, self.device = config, folder, device
        self.lidar_height_m = lidar_height_m(config)
        self.scans = open_scans(config, "train")
        self.validation = open_scans(config, "validation")
        try:
            self.scans.require_field_of_view()
            self.validation.require_field_of_view()
        except ValueError as error:
            raise SystemExit(str(error)) from None
        settings = config["optimiser"]
        draws = config["data"].get("train_draws")
        if draws and len(draws) != len(config["data"]["train"]):
            raise SystemExit(f"data.train_draws has {len(draws)} numbers, data.train other folders")
        self.sampler = BatchesBySensor(self.scans, settings["batch"], config["seed"], draws)
        self.samples = TrainingSamples(self.scans, config)
        torch.manual_seed(config["seed"])
        self.network = make_network(config["network"], len(CLASS_NAMES), len(config["mean"])).to(device)
        self.network = self.network.to(memory_format=torch.channels_last)
        self.averaged = copy.deepcopy(self.network).eval()
        self.optimiser = torch.optim.SGD(
            self.network.parameters(),
            settings["rate"],
            settings["momentum"],
            weight_decay=settings["weight_decay"],
        )
        rate = Rate(settings, len(self.sampler))
        self.schedule = torch.optim.lr_scheduler.LambdaLR(self.optimiser, rate)
        self.epoch, self.step, self.history = 0, 0, []
        self.shares = self.scans.class_shares()
        self.weights = class_weights(self.shares, config["loss"]["weights"]).to(device)

    def start_from(self, file: str | Path) -> None:
        """Loads the weights of another run's best.pt, or those of a model folder."""
        # Imported here, since a run from random weights needs no ONNX.
        from warm_start import check_description, load_weights

        chosen = list(self.scans.evenly_chosen(32))
        images = (self.samples[index, 0][0][None].to(self.device) for index in chosen)
        try:
            check_description(file, self.config)
            load_weights(self.network, file, images)
        except (ValueError, OSError) as error:
            raise SystemExit(f"start_from: {error}") from None
        self.averaged.load_state_dict(self.network.state_dict())

    def resume(self) -> None:
        file = self.folder / "last.pt"
        if not file.exists():
            if self.config["start_from"]:
                self.start_from(self.config["start_from"])
            return
        state = torch.load(file, map_location=self.device)
        self.network.load_state_dict(state["network"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimiser.load_state_dict(state["optimiser"])
        # The position in the schedule; rate and length come from this configuration.
        fresh = {"base_lrs": self.schedule.base_lrs, "lr_lambdas": [None]}
        self.schedule.load_state_dict({**state["schedule"], **fresh})
        self.epoch, self.step, self.history = state["epoch"], state["step"], state["history"]
        # What it started from may be gone.
        if self.lidar_height_m is None:
            self.lidar_height_m = state.get("lidar_height_m")
        print(f"{file}: goes on after epoch {self.epoch}")

    def save(self) -> None:
        state = {
            "config": self.config,
            "trained_for": self.scans.trained_for(),
            "lidar_height_m": self.lidar_height_m,
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "schedule": self.schedule.state_dict(),
            "epoch": self.epoch,
            "step": self.step,
            "history": self.history,
        }
        write_whole(state, self.folder / "last.pt")
        if self.history[-1]["miou"] >= max(entry["miou"] for entry in self.history):
            best = {key: state[key] for key in BEST_HOLDS}
            write_whole(best, self.folder / "best.pt")

    def average(self) -> None:
        """Updates the running mean of the network's weights, over fewer steps at the beginning."""
        wanted = self.config["optimiser"]["averaged_steps"]
        share = 1 / min(wanted, 1 + self.step / 3)
        with torch.no_grad():
            for mean, now in zip(
                self.averaged.state_dict().values(), self.network.state_dict().values()
            ):
                if mean.dtype.is_floating_point:
                    mean.lerp_(now, share)
                else:
                    mean.copy_(now)

    def scores(self, channels: torch.Tensor) -> torch.Tensor:
        with precision(self.config, self.device):
            return self.network(channels).float()

    def loss(self, scores: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        loss = weighted_cross_entropy(scores, target, self.weights)
        share = self.config["loss"]["lovasz"]
        return loss + share * lovasz_softmax(scores, target) if share else loss

    def train_epoch(self) -> float:
        self.network.train()
        self.sampler.epoch = self.epoch
        batches = torch.utils.data.DataLoader(
            self.samples, batch_sampler=self.sampler, num_workers=1
        )
        began, losses = time.time(), []
        for done, (channels, target) in enumerate(batches, 1):
            channels = channels.to(self.device, memory_format=torch.channels_last)
            loss = self.loss(self.scores(channels), target.to(self.device))
            if not torch.isfinite(loss):
                raise SystemExit("the loss is not finite; lower optimiser.rate")
            self.optimiser.zero_grad(set_to_none=True)
            loss.backward()
            self.optimiser.step()
            self.schedule.step()
            self.step += 1
            self.average()
            losses.append(loss.item())
            if done % 10 == 0 or done == len(self.sampler):
                show_progress(self.epoch, done, len(self.sampler), np.mean(losses[-50:]), began)
        return float(np.mean(losses))

    def predict(self, channels: np.ndarray) -> np.ndarray:
        """The most probable class of every pixel, by the averaged weights."""
        image = torch.from_numpy(channels)[None].to(self.device, memory_format=torch.channels_last)
        with torch.no_grad(), precision(self.config, self.device):
            return self.averaged(image).argmax(1)[0].cpu().numpy()

    def validate(self) -> Confusion:
        confusion = Confusion()
        wanted = min(self.config["data"]["validation_scans"], len(self.validation))
        chosen = np.unique(np.linspace(0, len(self.validation) - 1, wanted).astype(int))
        for index in chosen:
            channels, target = plain_sample(self.validation, index, self.config)
            confusion.add(target.ravel(), self.predict(channels).ravel())
        return confusion


def write_whole(state: dict[str, Any], file: Path) -> None:
    """Writes atomically: an interrupted run leaves the old file."""
    torch.save(state, file.with_suffix(".part"))
    file.with_suffix(".part").replace(file)


def show_progress(epoch: int, done: int, total: int, loss: float, began: float) -> None:
    left = (time.time() - began) / done * (total - done)
    line = f"epoch {epoch + 1}  {done}/{total}  loss {loss:.3f}  {left / 60:.1f} min left"
    print(line, end="\r" if done < total and sys.stdout.isatty() else "\n", flush=True)


def read_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("config", help="such as training.yaml beside this file")
    parser.add_argument("folder", type=Path, help="of the run; resumes a run that it holds")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    return parser.parse_args()


def train(run: Run) -> None:
    """Begins or resumes the run, and trains it to its end."""
    config, folder = run.config, run.folder
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "config.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    run.resume()
    parameters = sum(p.numel() for p in run.network.parameters())
    print(f"{parameters / 1e6:.2f} M parameters, {len(run.scans)} scans, {run.device}")
    while run.epoch < config["optimiser"]["epochs"]:
        loss = run.train_epoch()
        confusion = run.validate()
        run.epoch += 1
        miou = confusion.mean_iou()
        run.history.append({"epoch": run.epoch, "loss": loss, "miou": miou})
        print(f"epoch {run.epoch}: loss {loss:.4f}, validation mIoU {100 * miou:.1f}")
        print("  " + confusion.table(), flush=True)
        run.save()
        save_curves(run.history, folder / "curves.png")
        save_labelled_images(run)


def main() -> None:
    arguments = read_arguments()
    config = read_config(arguments.config, arguments.set)
    torch.set_num_threads(config["threads"])
    train(Run(config, arguments.folder, arguments.device))


if __name__ == "__main__":
    main()
