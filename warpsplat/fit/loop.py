"""The training loop: steps, and the events between them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from warpsplat.fit.budget import affordable
from warpsplat.fit.densification import densify, recover
from warpsplat.fit.problem import USUAL_ROUNDING, Fit, Problem, Rounding, Run, Start
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.rounding import evaluate_file, freeze_opacities, opacities_at, round_stage, stage_at
from warpsplat.fit.saved import fit_content, fit_from, step_content
from warpsplat.fit.schedule import CHECK_INTERVAL, EVALUATE_FROM, EVALUATE_INTERVAL, phase_at
from warpsplat.fit.training import Training


class Event(NamedTuple):
    """Something that happens between two steps of a fit."""

    name: str
    """As in the table of ARCHITECTURE.md."""
    due: Callable[[Training], bool]
    """Returns whether it happens now."""
    act: Callable[[Training], object]
    """Does it."""


def fit(
    problem: Problem, run: Run, start: Start | None = None, rounding: Rounding | None = USUAL_ROUNDING
) -> Fit:
    """Optimise shapes against an image, or continue from the run's checkpoint.

    ``start``: shapes to start from; ``rounding``: how coordinates are rounded, None if there is no file.
    """
    training = Training(problem, run, start or Start(), rounding)
    checkpoint = run.checkpoint
    if checkpoint:
        checkpoint.begin()
        if checkpoint.result:
            return fit_from(checkpoint.result, training.scene)
    made = run.attempt(lambda: train(training)) or training.kept()
    if made is None:
        raise run.failures.pop()
    return made


def train(training: Training) -> Fit:
    """Make the steps of a fit, and return its result. All but checkpoints and its end are events."""
    run, checkpoint = training.run, training.run.checkpoint
    training.begin()
    while True:
        if training.done > training.start.begin:
            happen(BEFORE_A_STEP, training)
        training.step.advance()
        happen(AFTER_A_STEP, training)
        interrupted = run.stopped()
        if checkpoint and not training.is_over:
            checkpoint.keep(lambda: step_content(training.step), now=interrupted)
        if interrupted or training.is_over:
            break
    made = training.result(interrupted=interrupted)
    if checkpoint and training.is_over:
        checkpoint.finish(fit_content(made))
    return made


def happen(events: tuple[Event, ...], training: Training) -> None:
    """Let the events happen that are due, in their order."""
    for event in events:
        if event.due(training):
            event.act(training)


def stage_is_due(fit: Training) -> bool:
    """Return whether a third of the points is to be rounded."""
    return fit.rounds and stage_at(fit.settings, fit.done) is not None


def opacities_are_due(fit: Training) -> bool:
    """Return whether opacities are to be rounded."""
    late = fit.done >= opacities_at(fit.settings) and not fit.step.state.opacities_frozen
    return fit.rounds and late and renderer_of(fit.settings.renderer).exact


def file_is_due(fit: Training) -> bool:
    """Return whether the file is to be evaluated.

    A viewer may show kept elements differently from the start: they blend with what lies below.
    """
    blends = bool(fit.start.scene and fit.start.scene.pictures)
    wanted = fit.settings.viewer and fit.rounds and fit.step.state.grid is None
    late = blends or fit.done >= EVALUATE_FROM * fit.settings.iterations
    return wanted and fit.is_fine and late and fit.done % EVALUATE_INTERVAL == 0


def interval_is_due(fit: Training) -> bool:
    """Return whether shapes may change now."""
    interval = fit.settings.density.interval
    return interval > 0 and fit.done % interval == 0


def time_is_due(fit: Training) -> bool:
    """Return whether the number of steps is adapted: at the fine size the schedule stays as it is."""
    adapts = bool(fit.budget.costs) and fit.step.target.phase is fit.plan[0]
    return adapts and interval_is_due(fit) and fit.densifies


def bytes_are_due(fit: Training) -> bool:
    """Return whether the number of shapes is adapted."""
    limited = fit.grows and fit.settings.max_bytes is not None
    return limited and interval_is_due(fit) and fit.densifies


def densification_is_due(fit: Training) -> bool:
    """Return whether shapes come and go: until late, or while their number is wrong."""
    return interval_is_due(fit) and (fit.missing != 0 or fit.densifies) and not fit.is_over


def reading_is_due(fit: Training) -> bool:
    """Return whether the shapes are to be read back, unless another event just did."""
    known = fit.step.state.known
    return fit.done % EVALUATE_INTERVAL == 0 and not (known and known[0] == fit.done)


def target_is_due(fit: Training) -> bool:
    """Return whether the next step is at another size, or by another loss."""
    phase, loss = phase_at(fit.settings, fit.plan, fit.done), fit.loss_at(fit.settings, fit.done)
    return phase is not fit.step.target.phase or loss is not fit.step.target.loss


def colors_are_due(fit: Training) -> bool:
    """Return whether shapes choose colours of the palette; while points are rounded, they keep theirs."""
    return fit.palette is not None and fit.step.state.grid is None and fit.palette.is_due(fit.step.state)


def check_is_due(fit: Training) -> bool:
    """Return whether counters and the loss are read: every few steps, and after the last one."""
    return fit.done % CHECK_INTERVAL == 0 or fit.done == fit.settings.iterations


def recovery_is_due(fit: Training) -> bool:
    """Return whether numbers are checked: every few steps, and before other events use them."""
    return interval_is_due(fit) or fit.done % CHECK_INTERVAL == 0 or stage_is_due(fit)


BEFORE_A_STEP = (
    Event("plan the last steps", lambda fit: fit.budget.over(), lambda fit: fit.plan_last_steps()),
    Event("round points", stage_is_due, lambda fit: round_stage(fit.step, fit.rounding)),
    Event("freeze opacities", opacities_are_due, lambda fit: freeze_opacities(fit.step)),
    Event("evaluate the file", file_is_due, lambda fit: evaluate_file(fit.step)),
    Event("adapt the number of steps", time_is_due, lambda fit: fit.budget.fit(fit.step)),
    Event("adapt the number of shapes", bytes_are_due, lambda fit: fit.step.configure(affordable(fit.step))),
    Event("densify", densification_is_due, lambda fit: densify(fit.step, grows=fit.grows)),
    Event("read the shapes back", reading_is_due, lambda fit: fit.step.state.scene()),
    Event("change the target", target_is_due, lambda fit: fit.step.aim(fit.target(fit.settings, fit.done))),
    Event("choose colours", colors_are_due, lambda fit: fit.choose_colors()),
)
"""In their order: an event sees what those before it did."""

AFTER_A_STEP = (
    Event(
        "reset broken shapes",
        recovery_is_due,
        lambda fit: recover(fit.step, replaces=fit.grows and fit.densifies),
    ),
    Event("enlarge arrays", check_is_due, lambda fit: fit.step.ensure_capacity()),
    Event(
        "report progress",
        lambda fit: check_is_due(fit) and fit.run.on_progress is not None,
        lambda fit: fit.run.report(fit.progress()),
    ),
)
