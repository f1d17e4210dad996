"""The optimisation: a loop of steps, with surgery on the set of curves between them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import warp as wp

from warpsplat.config import Settings
from warpsplat.density import densify, least_seen, prune_mask
from warpsplat.initialize import grid_scene
from warpsplat.kernels import adam, loss
from warpsplat.launch import Program
from warpsplat.parameters import Parameters
from warpsplat.render import TileRenderer, make_renderer
from warpsplat.scene import FloatArray, Scene

CHECK_INTERVAL = 10
"""Steps between two looks at the loss and the counters of the device."""

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


@dataclass(frozen=True)
class Phase:
    """Steps at one image size."""

    steps: int
    width: int
    height: int


def phases(settings: Settings, width: int, height: int) -> list[Phase]:
    """Coarse, then fine; one phase where the image is small enough for both to be the same."""

    def fit(pixels: int) -> tuple[int, int]:
        scale = min(1.0, math.sqrt(pixels / (width * height)))
        return max(1, round(width * scale)), max(1, round(height * scale))

    coarse_steps = round(settings.iterations * settings.coarse)
    coarse = Phase(coarse_steps, *fit(settings.coarse_pixels))
    fine = Phase(settings.iterations - coarse_steps, *fit(settings.fine_pixels))
    if (coarse.width, coarse.height) == (fine.width, fine.height):
        return [Phase(settings.iterations, fine.width, fine.height)]
    return [phase for phase in (coarse, fine) if phase.steps > 0]


class Trainer:
    """Owns the parameters, the renderer and the recorded step; ``run`` is the loop."""

    def __init__(
        self, target: FloatArray, settings: Settings, device: wp.Device, *, threads: int | None = None
    ) -> None:
        """``target``: sRGB in [0, 1], shape (height, width, 3)."""
        self.target, self.settings, self.device, self.threads = target, settings, device, threads
        self.height, self.width = target.shape[:2]
        self.rng = np.random.default_rng(settings.seed)
        self.parameters = Parameters(grid_scene(settings, target, self.rng), device)
        self.clock = wp.zeros(1, dtype=wp.int32, device=device)
        self.loss = wp.zeros(1, dtype=wp.float32, device=device)
        self.renderer: TileRenderer | None = None
        self.measure: Program | None = None
        self.update: Program | None = None
        self.overflows = 0
        self.step = 0

    def scene(self) -> Scene:
        """The current scene, on the host."""
        return self.parameters.scene()

    def _enter(self, phase: Phase) -> None:
        small = self.target
        if (phase.width, phase.height) != (self.width, self.height):
            size = (phase.width, phase.height)
            small = np.asarray(cv2.resize(self.target, size, interpolation=cv2.INTER_AREA), np.float32)
        self.small = np.ascontiguousarray(small, np.float32)
        self.scale = phase.width / self.width
        self.device_target: wp.array = wp.array(self.small, dtype=wp.vec3, device=self.device)
        self.row_loss = wp.zeros(phase.height, dtype=wp.float32, device=self.device)
        self._record(phase.width, phase.height, None)

    def _record(self, width: int, height: int, previous: TileRenderer | None) -> None:
        """Record the launches of a step anew: the arrays they use have changed."""
        s = self.settings
        if self.renderer:
            self.renderer.close()
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
        self.measure = self._record_loss()
        self.update = self._record_update()

    def _record_update(self) -> Program:
        p, s = self.parameters, self.settings
        program = Program(self.device, 1)
        curve_loss = wp.zeros(p.curve_count, dtype=wp.float32, device=self.device)
        program.add(
            loss.xing_backward,
            p.curve_count,
            [p.points, int(p.kind == "closed"), s.xing],
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
            )
        return program

    def _record_loss(self) -> Program:
        assert self.renderer
        r = self.renderer
        program = Program(self.device, 1)
        program.add(loss.l2_loss, r.height, [r.image, self.device_target], [r.image_grad, self.row_loss])
        program.add(loss.sum_rows, 1, [self.row_loss, r.width], [self.loss])
        return program

    def _surgery(self, progress: float) -> None:
        """Replace curves that show little by new ones where the error is."""
        assert self.renderer
        s = self.settings
        self.renderer.forward_complete()
        scene = self.scene()
        doomed = prune_mask(scene, s.density, progress)
        seen = scene.areas() * scene.opacities.max(axis=1)
        gone = least_seen(scene, doomed, round(s.density.replace * len(scene)), seen)
        keep = np.setdiff1d(np.arange(len(scene)), gone)
        if len(gone):
            added = densify(s, scene, self.small, self.renderer.image.numpy(), len(gone), self.rng)
            self.parameters.rearrange(keep, added)
        if s.order == "area":
            scene = self.scene()
            self.parameters.rearrange(np.argsort(-scene.areas(), kind="stable"), scene.take(np.arange(0)))
        self._record(self.renderer.width, self.renderer.height, self.renderer)

    def psnr(self) -> float:
        """Of the render in the last step, at its size [dB]. Reads one number back from the device."""
        return -10 * math.log10(max(float(self.loss.numpy()[0]), 1e-12))

    def close(self) -> None:
        """End the threads of the recorded launches."""
        if self.renderer:
            self.renderer.close()

    def run(
        self, report: Callable[[Progress], None] | None = None, stop: Callable[[], bool] | None = None
    ) -> Scene:
        """All phases. ``report`` is called every few steps; ``stop`` is asked after every step and ends the
        run early.
        """
        started = time.monotonic()
        s = self.settings
        for phase in phases(s, self.width, self.height):
            self._enter(phase)
            for _ in range(phase.steps):
                assert self.renderer and self.measure and self.update
                self.renderer.forward()
                self.measure.run()
                self.renderer.backward()
                self.update.run()
                self.step += 1
                if self.step % CHECK_INTERVAL == 0 or self.step == s.iterations:
                    if self.renderer.grow():
                        self.overflows += 1
                        self.measure = self._record_loss()
                    if report:
                        seconds = time.monotonic() - started
                        report(Progress(self.step, s.iterations, self.psnr(), seconds))
                if stop and stop():
                    return self.scene()
                due = s.density.interval > 0 and self.step % s.density.interval == 0
                if due and self.step < s.density.stop * s.iterations:
                    self._surgery(self.step / s.iterations)
        return self.scene()
