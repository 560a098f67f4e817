"""The training loop: one plain function of a `TrainConfig`, on one process or under torchrun."""

from __future__ import annotations

import logging
import signal
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
import torch.distributed as dist
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from tqdm import tqdm

from endosdk.errors import InvalidArgument
from endosdk.io.interrupts import interrupts_deferred, kill_answered
from endosdk.io.progress import progress
from endosdk.training import checkpoint, past_runs
from endosdk.training.beyond_range import count_beyond_range
from endosdk.training.config import RESUMED, TrainConfig
from endosdk.training.data import Crops, has_truth
from endosdk.training.devices import channels_last, device_of, precision_on
from endosdk.training.fit_confidence import fit_confidence
from endosdk.training.loss import build_loss, volume_cross_entropy
from endosdk.training.memory import keep_freed_memory
from endosdk.training.networks.base import Prediction, StereoNetwork, Window
from endosdk.training.networks.blocks import freeze_norm
from endosdk.training.optimisers import build_optimiser
from endosdk.training.rounding import round_to_bytes
from endosdk.training.run_log import RunLog
from endosdk.training.run_process import process_group
from endosdk.training.sets import JoinedReader, open_sets, split_pairs
from endosdk.training.survey import MOST_CROPS, teach_surveyor
from endosdk.training.upsampling import on_input_grid
from endosdk.training.validation import mean_errors

LOG = logging.getLogger("endosdk")
CROPS_WITHOUT_STEPS = 8  # from each pair, where a run of no steps fits the confidence alone
SCHEDULE = ("steps", "rate", "final_rate")  # what a resumed run may change of what it learns
# What is measured beside the training, every `validate_every` steps; it is told whether the refinement is computed yet.
Watch = Callable[[StereoNetwork, bool], dict[str, float]]


def train(config: TrainConfig, out: Path, *, resume: bool = False, watch: Watch | None = None) -> Path:
    """Train as configured and return the checkpoint, ``out/last.safetensors``; the log lies beside it.

    With ``resume`` the run in ``out`` goes on where its checkpoint ends. Only the settings `RESUMED` may differ from
    the checkpoint's, such as more steps or another rate; InvalidArgument names any other, and other data. Of a
    run that is finished nothing is written. Under torchrun every process calls this with the same arguments. What
    ``watch`` measures of the network joins the history of validations. KeyboardInterrupt, of Ctrl-C or SIGTERM, leaves
    a checkpoint to resume.
    """
    with process_group(device_of(config.device)) as (rank, world), kill_answered(signal.default_int_handler):
        run = Run(config, out, rank, world, resume=resume)
        run.watch = watch
        if run.nothing_left:
            LOG.warning("%s is finished, with all %d steps; nothing is written", out, run.step)
            return out / checkpoint.LAST
        try:
            run.work()
        finally:
            if run.log is not None:
                run.log.close()
    return out / checkpoint.LAST


class Run:
    """The state of one training run in one process."""

    crops_kind = Crops  # what draws the samples

    def __init__(self, config: TrainConfig, out: Path, rank: int = 0, world: int = 1, *, resume: bool = False) -> None:
        self.out, self.rank, self.world = out, rank, world
        self.device = device_of(config.device)
        if config.threads is not None:
            torch.set_num_threads(config.threads)
        self.precision = precision_on(self.device, config.precision)
        if self.device.type == "cpu":
            keep_freed_memory()
        self.config = config
        # Before the network, which settings of another run may not fit.
        saved = self._saved() if resume else None
        # Before the data, which takes its time to open: a wrong name or range is refused at once.
        torch.manual_seed(config.seed)
        self.network = checkpoint.configured_network(config)
        self.crop = config.crop or self.network.default_crop
        # The checkpoint says what was done, whatever may be usual one day.
        self.config = replace(config, crop=self.crop)
        self.loss = build_loss(config.loss, config.balance)
        self.reader = open_sets(config.data, "train", config.layout)
        if saved is not None:
            self._check_same_data(saved, {"sha256": self.reader.sha256})
        self.train_pairs, self.held_out = split_pairs(self.reader, config)
        self.crops = self._crops_of(self.train_pairs)
        counted = self.crops, self.train_pairs, config.max_disparity, self.reader.name
        self.beyond_range = count_beyond_range(*counted) if rank == 0 else 0.0
        self.step, self.seconds, self.finished = 0, 0.0, False
        self.history: list[dict[str, float]] = []
        self.watch: Watch | None = None
        self.origin: dict[str, Any] | None = None  # what the weights were before this run
        self.changes: list[dict[str, Any]] = []  # of steps and rates, by the step from which they hold
        moments = self._restore(saved)
        channels_last(self.network.to(self.device))
        if config.quantised:
            round_to_bytes(self.network)
        self.optimiser = build_optimiser(self.network, config)
        if moments is not None:
            checkpoint.restore_optimiser(self.optimiser, moments)
        self.log = RunLog(out, self.step if resume else None) if rank == 0 and not self.nothing_left else None

    @property
    def nothing_left(self) -> bool:
        """Tell whether every step is taken and the confidence is fitted."""
        return self.finished and self.step == self.config.steps

    def _crops_of(self, pairs: list[int]) -> Crops:
        config = self.config
        return self.crops_kind(
            self.reader,
            pairs,
            self.crop,
            seed=config.seed,
            augment=config.augment,
            looks=config.looks,
            cache_gib=config.cache_gib,
            inference_width=self.network.inference_width,
        )

    def _restore(self, saved: checkpoint.Checkpoint | None) -> dict[str, Tensor] | None:
        """Take over what the run goes on from; return the state of the optimiser where it is a run's own."""
        if saved is not None:
            return self._resume(saved)
        self._check_start()
        if self.config.init_from is not None:
            # Only a start may be a shipped name: a run's own folder may be called the same.
            self._start_from(checkpoint.load(checkpoint.starting_point(self.config.init_from)))
        return None

    def _saved(self) -> checkpoint.Checkpoint:
        """Return the checkpoint that the run goes on from. Raises InvalidArgument where it is one of other settings."""
        saved = checkpoint.load(self.out)
        if saved.step > self.config.steps:
            raise InvalidArgument("steps", f"must be at least the {saved.step} that are done", self.config.steps)
        # Rates that no step is left to use would be a false record.
        free = set(RESUMED) - ({"rate", "final_rate"} if saved.step == self.config.steps else set())
        free |= {"crop"} if self.config.crop is None else set()  # only the network says which is meant
        for name in [name for name in self.config.as_dict() if name not in free]:
            self._check_same(saved, name)
        return saved

    def _check_same_data(self, saved: checkpoint.Checkpoint, now: dict[str, Any]) -> None:
        before = saved.state["dataset"]
        for name in now:
            if before.get(name, now[name]) != now[name]:  # older checkpoints do not say all
                rule = f"must be what the run began with, {name} {before[name]}; for other data --init-from {self.out}"
                raise InvalidArgument("data", rule, now[name])

    def _resume(self, saved: checkpoint.Checkpoint) -> dict[str, Tensor]:
        self._check_same(saved, "crop")
        now = self._dataset_note()
        self._check_same_data(saved, {name: now[name] for name in ("pairs", "held_out")})
        saved.load_into(self.network)
        self.changes = saved.state.get("changes", [])
        pairs = {name: (getattr(saved.config, name), getattr(self.config, name)) for name in SCHEDULE}
        changed = {name: list(pair) for name, pair in pairs.items() if pair[0] != pair[1]}
        if changed:
            self.changes = [*self.changes, {"step": saved.step, **changed}]
        self.step, self.seconds = saved.step, float(saved.state["seconds"])
        self.history, self.origin = saved.state["history"], saved.state["init"]
        self.finished = saved.state.get("finished", False)
        self._warn_of_changes(saved.state)
        return saved.optimiser

    def _check_start(self) -> None:
        """Refuse to begin over another run, or without the weights that the settings need."""
        if (self.out / checkpoint.LAST).exists():
            raise InvalidArgument("out", "must not hold another run unless it is resumed", self.out)
        if self.config.init_from is None and self.config.refine_only:
            raise InvalidArgument("init_from", "must name a trained coarse stage with refine_only", None)
        if self.config.init_from is None and self.config.frozen_norm:
            raise InvalidArgument("init_from", "must name trained weights with frozen_norm", None)

    def _start_from(self, saved: checkpoint.Checkpoint) -> None:
        # No weight depends on how many planes are searched, or on what is done beside the layers: a run may start from
        # one of another range, and from another network of the same weights.
        if saved.differing(self.network):
            self._check_same(saved, "network")
        saved.load_into(self.network)
        kept = ("max_disparity", "loss", "optimiser", "rate", "final_rate", "decay")
        past = {key: saved.config.as_dict()[key] for key in kept}
        notes = {"data": saved.state["dataset"], "steps": saved.step, **past, "init": saved.state["init"]}
        if saved.state.get("changes"):
            notes["changes"] = saved.state["changes"]
        self.origin = past_runs.with_oldest_joined(notes)
        past_runs.check_held_out(self.origin, self._dataset_note(), self.config.held_out)

    def _check_same(self, saved: checkpoint.Checkpoint, name: str) -> None:
        """Refuse a setting that is not the checkpoint's."""
        before, now = getattr(saved.config, name), getattr(self.config, name)
        if before != now:
            raise InvalidArgument(name, f"must be the checkpoint's {before}", now)

    def _warn_of_changes(self, state: dict[str, Any]) -> None:
        precision, world = state.get("precision", self.precision), state.get("processes", self.world)
        if precision != self.precision:
            message = "this run has computed in %s and goes on in %s here; precision %s keeps what it had"
            LOG.warning(message, precision, self.precision, precision)
        if world != self.world:
            message = "this run has drawn its crops for %d processes and goes on with %d: crops are drawn anew"
            LOG.warning(message, world, self.world)

    def work(self) -> None:
        """Take the steps and fit the confidence; a run that is interrupted keeps its steps."""
        try:
            self.fit()
        except KeyboardInterrupt:
            self.save()
            raise
        self.finish()

    def fit(self) -> None:
        """Take every step that is left: first those of the coarse stage alone, then those of both."""
        self.finished = False
        turn = min(max(self.config.refine_from_step, 0), self.config.steps)
        with progress(total=self.config.steps, done=self.step, unit="step", shown=self.rank == 0) as bar:
            if self._is_measured(self.step) and all(entry["step"] != self.step for entry in self.history):
                self._validate(self.step > turn, bar)  # the run was stopped meanwhile
            for first, last, refined in ((0, turn, False), (turn, self.config.steps, True)):
                if max(first, self.step) < last:
                    self._fit_stage(last, refined, bar)

    def _fit_stage(self, last: int, refined: bool, bar: tqdm[Any]) -> None:
        for name, parameter in self.network.named_parameters():
            in_refinement = name.startswith("refinement.")
            learns = in_refinement if self.config.refine_only else refined or not in_refinement
            # The confidence is fitted at the end.
            parameter.requires_grad_(learns and not name.startswith(("confidence.", *self.network.given_parts)))
        model: nn.Module = self.network
        if self.world > 1:
            model = DistributedDataParallel(self.network)
        batches = self.crops.batches(
            self.config.batch, first=self.step, last=last, rank=self.rank, world=self.world, workers=self.config.workers
        )
        began = saved_at = time.monotonic()
        spent = self.seconds
        since_row: list[dict[str, Tensor]] = []  # what the steps since the last row of the log reported
        for batch in batches:
            # A checkpoint must be of whole steps: one that is cut short has moved the norms' statistics already.
            with interrupts_deferred():
                report = self._train_step(model, batch, refined)
                self.step += 1
                self.seconds = spent + time.monotonic() - began
                bar.update()
                done = self.step == last
                since_row.append({name: value.detach() for name, value in report.items()})
                if self.step % self.config.log_every == 0 or done:
                    self._log(since_row, bar)
                    since_row.clear()
            if self._is_measured(self.step):
                self._validate(refined, bar)
            if time.monotonic() - saved_at > 60.0 * self.config.checkpoint_minutes or done:
                self.save()
                saved_at = time.monotonic()

    def _is_measured(self, step: int) -> bool:
        ends = self.config.refine_from_step, self.config.steps  # of the stages
        return step > 0 and (step % self.config.validate_every == 0 or step in ends)

    def _train_step(self, model: nn.Module, batch: list[Tensor], refined: bool) -> dict[str, Tensor]:
        # Bytes travel to the device; they become floats there.
        left, right, truth = (part.to(self.device).to(torch.float32) for part in batch)
        left, right = (view.contiguous(memory_format=torch.channels_last) for view in (left, right))
        window = self._window() if refined else None
        rate = self.config.rate_at(self.step)
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        model.train(not self.config.refine_only)
        if self.config.frozen_norm:
            freeze_norm(model)
        self.optimiser.zero_grad(set_to_none=True)
        with self._autocast():
            prediction: Prediction = model(left, right, refined=refined, window=window)
        maps = on_input_grid(self.network, prediction, left if window is None else window.of(left), refined=refined)
        report = self._losses(maps, truth, window, refined)
        if self.config.volume_weight:
            self._add_volume_loss(report, prediction, truth)
        report["loss"].backward()  # type: ignore[no-untyped-call]
        if self.config.clip > 0:
            nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip)
        self.optimiser.step()
        report["rate"] = torch.tensor(rate)
        return report

    def _losses(self, maps: list[Tensor], truth: Tensor, window: Window | None, refined: bool) -> dict[str, Tensor]:
        """Return the weighted loss and the error of each map, on the grid of the views, of this batch."""
        truths = [truth] if window is None else [truth, window.of(truth)]
        # Networks with stages of their own say how much each counts; those that are not computed yet have no map.
        ours = (self.config.coarse_weight, 1.0) if refined else (1.0,)
        weights = (self.network.stage_weights or ours)[: len(maps)]
        total = torch.zeros((), device=self.device)
        report: dict[str, Tensor] = {}
        for index, (found, weight) in enumerate(zip(maps, weights, strict=True)):
            wanted = truths[-1] if index else truths[0]
            mask = has_truth(wanted, self.config.max_disparity)
            total = total + weight * self.loss(found, wanted, mask)
            if index in (0, len(weights) - 1):
                name = "epe_refined" if index else "epe_coarse"
                error = torch.where(mask, found.detach() - wanted, 0.0)
                report[name] = error.abs().sum() / mask.sum()
        return {"loss": total, **report}

    def _add_volume_loss(self, report: dict[str, Tensor], prediction: Prediction, truth: Tensor) -> None:
        if prediction.cost is None:
            raise InvalidArgument("volume_weight", "is for the network fast", self.config.network)
        candidates = torch.tensor(self.network.candidates, dtype=torch.float32, device=self.device)
        mask = has_truth(truth, self.config.max_disparity)
        loss = volume_cross_entropy(prediction.cost, truth, mask, candidates)
        report["loss"] = report["loss"] + self.config.volume_weight * loss
        report["volume"] = loss.detach()

    def _window(self) -> Window | None:
        if self.config.refine_crop is None:
            return None
        rng = np.random.default_rng([self.config.seed, 2, self.step])
        multiple = self.network.input_multiple
        (height, width), (tall, wide) = self.crop, self.config.refine_crop
        top, left = (int(rng.integers(0, room // multiple + 1)) * multiple for room in (height - tall, width - wide))
        return Window(top, left, tall, wide)

    def _autocast(self) -> Any:
        if self.precision == "bf16":
            return torch.autocast(self.device.type, dtype=torch.bfloat16)
        return nullcontext()

    def _validate(self, refined: bool, bar: tqdm[Any]) -> None:
        """Measure the error on whole held-out pairs; the first process does it while the others wait."""
        if self.log is not None and (self.held_out or self.watch):
            entry = {"step": float(self.step), "seconds": round(self.seconds, 1)}
            if self.held_out:
                entry.update(mean_errors(self.network, self.reader, self.held_out, refined=refined))
            if self.watch:
                entry.update(self.watch(self.network, refined))
            self.history.append(entry)
            bar.write("  ".join(f"{name} {value:.4g}" for name, value in entry.items()), file=sys.stderr)
            self.log.write_summary(self.config.as_dict(), self._dataset_note(), self.history)
        if self.world > 1:
            dist.barrier()

    def save(self) -> None:
        """Write the checkpoint."""
        if self.rank == 0:
            state = {
                "seconds": self.seconds,
                "history": self.history,
                "dataset": self._dataset_note(),
                "precision": self.precision,
                "processes": self.world,
                "refine_margin": self.network.refine_margin,
                "init": self.origin,
                "changes": self.changes,
                "finished": self.finished,
            }
            path = self.out / checkpoint.LAST
            checkpoint.save(path, self.config, self.step, state, self.network, self.optimiser)

    def finish(self) -> None:
        """Fit the confidence on the held-out pairs and save the result."""
        if self.rank == 0 and self.held_out:
            seed = self.config.seed
            if self.network.confidence.surveyor is not None:
                # It learns from as many crops as the run has drawn. A run of no steps is there for this alone: it takes
                # several crops of each pair.
                drawn = self.config.steps * self.config.batch or CROPS_WITHOUT_STEPS * len(self.train_pairs)
                teach_surveyor(self.network, self.crops, min(drawn, MOST_CROPS), seed)
            spoilt = self._crops_of(self.held_out) if self.config.looks else None
            fit_confidence(self.network, self.reader, self.held_out, seed, spoilt=spoilt)
        self.finished = True
        self.save()

    def _log(self, reports: list[dict[str, Tensor]], bar: tqdm[Any]) -> None:
        """Add a row: the means over these steps."""
        if self.log is None:
            return
        values = {}
        for name in reports[0]:
            of_steps = torch.stack([report[name] for report in reports])
            # A window without truth has no error: its step does not count.
            values[name] = (of_steps.nanmean() if name.startswith("epe") else of_steps.mean()).item()
        bar.set_postfix({name: f"{value:.3g}" for name, value in values.items() if name != "rate"})
        self.log.add_step(self.step, self.seconds, values)

    def _dataset_note(self) -> dict[str, Any]:
        """Say which data the run sees.

        ``pairs`` counts those that it learns from, ``held_out`` those it does not; ``beyond_range`` is the share of the
        truth that it leaves out, as counted at the start; ``splits`` are the hashes of the split of each set.
        """
        counts = {"pairs": len(self.train_pairs), "held_out": len(self.held_out), "beyond_range": self.beyond_range}
        parts = self.reader.parts if isinstance(self.reader, JoinedReader) else [self.reader]
        splits = [part.split_sha256 for part in parts]
        return {"name": self.reader.name, "sha256": self.reader.sha256, "splits": splits, **counts}
