"""A second look at what an image was taken for, once there is a file: by how much of the image it shows."""

from __future__ import annotations

import math
from dataclasses import replace

from warpsplat.fit.export import finished
from warpsplat.fit.problem import Fit, Problem
from warpsplat.fit.settings import SUBJECTS, Subject, make_settings
from warpsplat.metrics import psnr_of_file
from warpsplat.portable.filters import resize_area, resize_linear
from warpsplat.run.explained import explained, psnr_of
from warpsplat.run.prepare import PreparedImage, choose_subject, without_background

NEXT: dict[Subject, Subject] = {"pixel": "drawing", "drawing": "photo"}
"""Subject that is tried next, by the one whose file shows too little."""


def other_subject(made: Fit, problem: Problem) -> Subject | None:
    """Return another subject for an image of which a file shows much less than one of that size could.

    A thumbnail stands for what shapes of any kind would show. None: the file shows enough.
    """
    settings, target = problem.settings, problem.target
    other = NEXT.get(settings.subject)
    asked = settings.counting or settings.is_limited or settings.paint or not settings.simplify
    if other is None or made.interrupted or asked or settings.detail < make_settings().detail:
        return None  # what was asked for may show little
    text = finished(made.scene, settings, made.per_pixel)
    height, width = target.shape[:2]
    bytes_per_pixel = 4  # bytes of a fit that shows as much as a pixel of a thumbnail, or more
    scale = math.sqrt(len(text.encode()) / (bytes_per_pixel * height * width))
    if scale >= 1:
        return None
    # How much farther from the image than that a file must be, for its subject to be the wrong one [dB].
    much = 3.0
    thumbnail = resize_area(target, (max(1, int(scale * width)), max(1, int(scale * height))))
    enough = psnr_of(resize_linear(thumbnail, (width, height)), target) - much
    if psnr_of_file(text, target) >= enough:
        return None
    # A drawing is sharp where the image may not be.
    return other if explained(made, problem).psnr < enough else None


def retaken(image: PreparedImage, subject: Subject) -> PreparedImage:
    """Return an image that is taken for something else than before."""
    problem, was = image.problem, image.problem.settings.subject
    settings, _, notes = choose_subject(problem.target, replace(problem.settings, subject=subject))
    why = f"as a {SUBJECTS[was]} it would show too little of the image"
    target, notes = problem.target, (*image.notes, *notes)
    if subject == "photo" and problem.removes_background:
        target, notes = without_background(target, settings, notes)
        image = replace(image, reduction=image.reduction and replace(image.reduction, whole=None))
    return replace(image, problem=replace(problem, settings=settings, target=target), why=why, notes=notes)
