"""The optimisation: a loop of steps, with surgery on the set of curves between them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import warp as wp

from warpsplat.config import Settings
from warpsplat.density import curves_at, densify, least_seen, prune_mask
from warpsplat.initialize import grid_scene
from warpsplat.kernels import adam, loss
from warpsplat.kernels.tile import column
from warpsplat.launch import Program, capture
from warpsplat.metrics import psnr
from warpsplat.parameters import Parameters
from warpsplat.render import TileRenderer, make_renderer
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg import export, resized
from warpsplat.tiles import to_tiles
from warpsplat.viewer import on_white, render_own

SIZE_CHOICES = 12
"""How many lengths of the shorter side are tried for a reduced image."""

CHECK_INTERVAL = 10
"""Steps between two looks at the loss and the counters of the device."""

LOOK_INTERVAL = 25
"""Steps between two looks at the file as a viewer shows it."""

TIMED_STEPS = 4
"""Steps timed at each size to fit a run into a time."""

BUDGET_MARGIN = 1.25
"""What a step costs with its update and its share of surgery, over what was timed."""

MAX_ITERATIONS = 20_000
"""Most steps that a time budget can buy: beyond, nothing is gained."""

TARGET_MARGIN = 0.1
"""How much more than the target the training render must have [dB], for the file to have it."""

OPACITY_RANGE = (0.02, 0.9985)
"""Bounds of an opacity. The upper one rounds to opaque in the file and keeps 1 - alpha away from 0."""


@dataclass(frozen=True)
class Progress:
    """State of a run between two steps."""

    step: int
    """Steps done."""
    steps: int
    """Steps in all."""
    psnr: float
    """Of the internal render at the current training size [dB]."""
    seconds: float
    """Since the start of the training."""
    work: float
    """Share of the run's work that is done, 0 to 1: a step counts by what its size makes it cost."""
    fine: bool
    """Whether the size is the finest: on a reduced image the same curves have more decibels."""


@dataclass(frozen=True)
class Phase:
    """A stretch of steps at one image size."""

    width: int
    height: int


def phases(settings: Settings, width: int, height: int) -> list[Phase]:
    """Coarse, then fine, from ``settings.coarse`` of the iterations on; one where both are the same size."""

    def fit(pixels: int) -> tuple[int, int]:
        if pixels >= width * height:
            return width, height
        # One scale serves both sides, so that of the sizes a little smaller the one is taken where the longer
        # side is the nearest to a whole number: the largest of those that are equally near.
        short, long = min(width, height), max(width, height)
        most = max(1, round(short * math.sqrt(pixels / (width * height))))
        choices = range(most, max(0, most - SIZE_CHOICES), -1)
        best = min(choices, key=lambda n: round(abs(long * n / short - round(long * n / short)), 2))
        other = round(long * best / short)
        return (best, other) if width <= height else (other, best)

    coarse, fine = Phase(*fit(settings.coarse_pixels)), Phase(*fit(settings.fine_pixels))
    return [fine] if coarse == fine else [coarse, fine]


class Trainer:
    """Owns the parameters, the renderer and the recorded step; ``run`` is the loop."""

    def __init__(
        self,
        target: FloatArray,
        settings: Settings,
        device: wp.Device,
        *,
        threads: int | None = None,
        scene: Scene | None = None,
    ) -> None:
        """``target``: sRGB in [0, 1], shape (height, width, 3); ``scene``: where to start, if not anew."""
        self.target, self.settings, self.device, self.threads = target, settings, device, threads
        self.height, self.width = target.shape[:2]
        self.rng = np.random.default_rng(settings.seed)
        self.given = scene is not None
        if scene is None:
            scene = grid_scene(settings, target, curves_at(settings, 0), self.rng)
        self.parameters = Parameters(scene, device)
        self.clock = wp.zeros(1, dtype=wp.int32, device=device)
        self.loss: wp.array | None = None
        self.renderer: TileRenderer | None = None
        self.measure: Program | None = None
        self.update: Program | None = None
        self.graph: wp.Graph | None = None
        self.step = 0
        self.interrupted = False
        self._deadline = math.inf
        self._costs: list[float] = []

    def scene(self) -> Scene:
        """The current scene, on the host."""
        return self.parameters.scene()

    def enter(self, phase: Phase) -> None:
        """Go on at the size of ``phase``."""
        small = self.target
        if (phase.width, phase.height) != (self.width, self.height):
            size = (phase.width, phase.height)
            small = np.asarray(cv2.resize(self.target, size, interpolation=cv2.INTER_AREA), np.float32)
        self.small = np.ascontiguousarray(small, np.float32)
        self.scale = phase.width / self.width
        self.device_target: wp.array = wp.array(to_tiles(self.small), dtype=column, device=self.device)
        self._record(phase.width, phase.height, None)

    def _record(self, width: int, height: int, previous: TileRenderer | None) -> None:
        """Record the launches of a step anew: the arrays they use have changed."""
        s = self.settings
        self.renderer = make_renderer(
            s.renderer,
            self.parameters,
            width,
            height,
            self.scale,
            threads=self.threads,
            through_scales=s.through_scales,
            fold=s.fold_start * (s.fold_end / s.fold_start) ** (self.step / s.iterations),
            capacity=previous.capacity if previous else None,
        )
        if previous is None:
            self.renderer.forward_complete()
        self.update = self._record_update()
        self._assemble()

    def _assemble(self) -> None:
        """Join renderer, loss and update into a step: one graph where the device has graphs."""
        assert self.renderer and self.update
        self.measure = self._record_loss()
        self.graph = capture(self.device, self.programs())

    def programs(self) -> list[Program]:
        """The recorded launches of a step, in order."""
        r = self.renderer
        assert r and r.forward_program and r.backward_program and self.measure and self.update
        return [r.forward_program, self.measure, r.backward_program, self.update]

    def advance(self) -> None:
        """One step: render, loss, adjoint, update. Nothing is allocated or read back."""
        if self.graph:
            wp.capture_launch(self.graph)
        else:
            for program in self.programs():
                program.run()

    def _record_update(self) -> Program:
        p, s = self.parameters, self.settings
        program = Program(self.device, self.threads)
        program.stage = "update"
        curve_loss = wp.zeros(p.curve_count, dtype=wp.float32, device=self.device)
        if s.xing > 0:
            program.add(
                loss.xing_backward,
                p.curve_count,
                [p.points, int(p.kind == "closed"), s.xing],
                [p.points_grad, curve_loss],
            )
        if s.bending > 0:
            program.add(
                loss.bending_backward,
                p.curve_count,
                [p.points, int(p.kind == "closed"), s.bending / (3 * self.width * self.height)],
                [p.points_grad, curve_loss],
            )
        program.add(adam.advance, p.curve_count, [], [p.ages, self.clock])
        # A step is counted in pixels of the finest training size, whatever the size of the image.
        unit = self.width / phases(s, self.width, self.height)[-1].width
        margin = float(max(self.width, self.height))
        bounds = {
            "points": (s.rates.points * unit, -margin, 2.0 * margin),
            "colors": (s.rates.colors, 0.0, 1.0),
            "opacities": (s.rates.opacities, *OPACITY_RANGE),
            "widths": (s.rates.widths * unit, unit, margin),
        }
        for name, (rate, low, high) in bounds.items():
            if name == "widths" and p.kind == "closed":
                continue
            group = p.groups[name]
            program.add(
                adam.adam_update,
                group.value.shape,
                [group.grad, p.ages, self.clock, s.iterations, rate, s.rates.final, low, high],
                [group.value, group.moment1, group.moment2],
                split=True,
            )
        return program

    def _record_loss(self) -> Program:
        assert self.renderer
        r = self.renderer
        program = Program(self.device, self.threads)
        program.stage = "loss"
        shape = (r.tiles_x * r.tiles_y, r.lanes)
        if self.loss is None or self.loss.shape != shape:
            self.loss = r.floats(*shape)
        program.add(
            loss.l2_loss,
            shape,
            [r.lane_size, r.image, self.device_target, r.inside, 3 * r.width * r.height],
            [r.image_grad, self.loss],
            split=True,
        )
        if self.settings.ssim > 0:
            program.add(
                loss.ssim_backward,
                (shape[0], 3),
                [r.image, self.device_target, r.inside, self.clock, self.settings.ssim]
                + [3 * r.width * r.height],
                [r.image_grad, r.floats(shape[0], 3)],
                split=True,
            )
        return program

    def _surgery(self, progress: float) -> None:
        """Replace curves that show little by new ones where the error is."""
        assert self.renderer
        s = self.settings
        self.renderer.forward_complete()
        scene = self.scene()
        doomed = prune_mask(scene, s.density, progress)
        seen = self.renderer.removal_costs(self.device_target)
        gone = least_seen(doomed, round(s.density.replace * len(scene)), seen)
        keep = np.setdiff1d(np.arange(len(scene)), gone)
        count = max(len(scene), 0 if self.given else curves_at(s, self.step)) - len(keep)
        if count:
            added = densify(s, scene, self.small, self.renderer.read_image(), count, self.rng)
            self.parameters.rearrange(keep, added)
        if s.order == "area":
            scene = self.scene()
            self.parameters.rearrange(np.argsort(-scene.areas(), kind="stable"), scene.take(np.arange(0)))
        self._record(self.renderer.width, self.renderer.height, self.renderer)

    def _look(self) -> None:
        """Take what the file shows for the render in the steps to come.

        A viewer rounds coordinates, colours and, at each translucent layer, pixels. The difference changes
        little from step to step, so it is measured now and then and taken off the target: the loss is that of
        the file, its gradient that of the render (a straight-through estimator, Bengio et al. 2013).
        """
        assert self.renderer
        if self.renderer.forward_complete():
            self._assemble()
        size = (self.renderer.width, self.renderer.height)
        text = resized(export(self.scene(), self.settings), *size, self.scale)
        shown = on_white(render_own(text)) / 255
        aim = self.small - (shown - self.renderer.read_image())
        self.device_target.assign(to_tiles(np.asarray(aim, np.float32)))

    def psnr(self) -> float:
        """What the loss of the last step stands for, at its size [dB]: the render's PSNR, and from the first
        look at the file on, an estimate of the file's. Reads a number a tile back from the device.
        """
        assert self.renderer and self.loss
        squares = float(self.loss.numpy().sum(dtype=np.float64))
        return -10 * math.log10(max(squares / (3 * self.renderer.width * self.renderer.height), 1e-12))

    def render_psnr(self) -> float:
        """Of the last render against the image, at its size [dB]. Reads the render back from the device."""
        assert self.renderer
        return psnr(255 * self.renderer.read_image(), 255 * self.small)

    def size_to(self, seconds: float) -> None:
        """Choose the number of iterations so that ``run`` ends about ``seconds`` from now.

        Times a few steps without update at each size; ``run`` corrects the number as it learns what steps
        cost with updates and surgery on a machine that may have other work.
        """
        self._deadline = time.monotonic() + seconds
        plan = phases(self.settings, self.width, self.height)
        for phase in plan:
            self.enter(phase)
            assert self.renderer and self.measure
            begin = time.monotonic()
            for _ in range(TIMED_STEPS):
                self.renderer.forward()
                self.measure.run()
                self.renderer.backward()
            wp.synchronize_device(self.device)
            self._costs.append(BUDGET_MARGIN * (time.monotonic() - begin) / TIMED_STEPS)
        self._resize(1.0)

    def _resize(self, slowness: float) -> None:
        """Fit the iterations to the deadline; ``slowness``: true cost of a step over ``_costs``."""
        s = self.settings
        coarse = s.coarse if len(self._costs) == 2 else 0.0
        mean = coarse * self._costs[0] + (1 - coarse) * self._costs[-1]
        done = self.step * (self._costs[0] if self.step < coarse * s.iterations else mean)
        left = (self._deadline - time.monotonic()) / slowness
        # done + left is the whole run's price; the steps done were the cheap, coarse ones.
        iterations = int((done + max(left, 0.0)) / mean)
        iterations = min(max(iterations, self.step, CHECK_INTERVAL), MAX_ITERATIONS)
        self.settings = replace(s, iterations=iterations)

    def _work(self, plan: list[Phase]) -> float:
        """Share of the work that is done: a step costs what its pixels cost."""
        s = self.settings
        coarse = s.coarse * s.iterations if len(plan) > 1 else 0.0
        first, last = (phase.width * phase.height for phase in (plan[0], plan[-1]))
        done = min(self.step, coarse) * first + max(self.step - coarse, 0.0) * last
        return done / (coarse * first + (s.iterations - coarse) * last)

    def run(
        self, report: Callable[[Progress], None] | None = None, stop: Callable[[], bool] | None = None
    ) -> Scene:
        """All phases. ``report`` is called every few steps; ``stop`` is asked after every step and ends the
        run early. So does reaching ``target_psnr`` at the finest size.
        """
        started = time.monotonic()
        plan = phases(self.settings, self.width, self.height)
        current: Phase | None = None
        while self.step < self.settings.iterations:
            s = self.settings
            phase = plan[0] if self.step < s.coarse * s.iterations else plan[-1]
            if phase is not current:
                current = phase
                self.enter(phase)
            assert self.renderer
            self.advance()
            self.step += 1
            if self.step % CHECK_INTERVAL == 0 or self.step == s.iterations:
                if self.renderer.grow():
                    self._assemble()
                if report:
                    spent = time.monotonic() - started
                    done, fine = self._work(plan), phase is plan[-1]
                    report(Progress(self.step, s.iterations, self.psnr(), spent, done, fine))
                if s.target_psnr and phase is plan[-1] and self.psnr() >= s.target_psnr + TARGET_MARGIN:
                    break
            if stop and stop():
                self.interrupted = True
                break
            if self.step >= s.iterations or (s.time_budget and time.monotonic() > self._deadline):
                break
            last = phase is plan[-1] and self.step >= s.density.stop * s.iterations
            if s.viewer and last and self.step % LOOK_INTERVAL == 0:
                self._look()
            due = s.density.interval > 0 and self.step % s.density.interval == 0
            if due and s.time_budget and phase is plan[0]:
                self._resize((time.monotonic() - started) / (self.step * self._costs[0]))
                s = self.settings
                self.update = self._record_update()
                self._assemble()
            growing = not self.given and self.parameters.curve_count < s.curves
            if due and self.step < s.iterations and (growing or self.step < s.density.stop * s.iterations):
                self._surgery(self.step / s.iterations)
        return self.scene()
