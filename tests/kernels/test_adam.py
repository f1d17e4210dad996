from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import run
from warpsplat.kernels import adam
from warpsplat.scene import Kind

BETAS = {"beta1": 0.8, "beta2": 0.8}
BOTH = (1 << Kind.FILL) | (1 << Kind.STROKE)


def state(start: np.ndarray, owner: list[int], kind: list[int], device: str) -> dict[str, Any]:
    value = wp.array(start, dtype=float, device=device)
    return {
        "value": value,
        **{name: wp.zeros_like(value) for name in ("grad", "moment1", "moment2")},
        "owner": wp.array(owner, dtype=int, device=device),
        "held": wp.zeros(len(owner), dtype=int, device=device),
        "kind": wp.array(kind, dtype=int, device=device),
        "paint": wp.zeros(len(kind), dtype=int, device=device),
        "ages": wp.zeros(len(kind), dtype=int, device=device),
        "clock": wp.zeros(1, dtype=int, device=device),
        "biases": wp.zeros(len(kind), dtype=wp.vec2, device=device),
        "decay": wp.zeros(1, dtype=float, device=device),
        "broken": wp.zeros(len(kind), dtype=int, device=device),
    }


def step(s: dict[str, Any], gradient: np.ndarray, device: str, **values: float) -> None:
    s["grad"].assign(gradient)
    decay = {"step_count": 20, "final": values.pop("final", 0.1), **BETAS}
    run(adam.advance, s["ages"].shape[0], device, s, **decay)
    settings = {**BETAS, "kinds": BOTH, "paints": 1, "rate": 0.1, "low": -100.0, "high": 100.0}
    run(adam.adam_update, s["value"].shape, device, s, **{**settings, **values})


def test_matches_torch(device: str) -> None:
    """Rows of shapes of both kinds, two of one shape."""
    rng = np.random.default_rng(7)
    start = rng.normal(size=(5, 4)).astype(np.float32)
    gradients = rng.normal(size=(20, 5, 4)).astype(np.float32)
    s = state(start, [0, 1, 1, 2, 3], [0, 1, 0, 1], device)
    x = torch.tensor(start, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.Adam([x], lr=0.1, betas=(0.8, 0.8), eps=1e-12)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda n: 0.1 + 0.9 * 0.5 * (1 + np.cos(np.pi * min((n + 1) / 20, 1)))
    )
    for g in gradients:
        step(s, g, device)
        x.grad = torch.tensor(g, dtype=torch.float64)
        optimizer.step()
        schedule.step()
    np.testing.assert_allclose(s["value"].numpy(), x.detach().numpy(), rtol=1e-4, atol=1e-4)
    assert s["clock"].numpy()[0] == 20
    assert (s["ages"].numpy() == 20).all()


def test_keeps_bounds(device: str) -> None:
    s = state(np.array([[0.5, 0.5]], np.float32), [0], [0], device)
    step(s, np.array([[-1.0, 1.0]], np.float32), device, rate=5.0, low=0.0, high=1.0)
    np.testing.assert_array_equal(s["value"].numpy(), [[1.0, 0.0]])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["grad", "moment1", "moment2", "value"])
def test_numbers_that_are_not_finite_are_not_applied(device: str, where: str, bad: float) -> None:
    """Its shape is marked, and nothing else changes: neither the row's moments nor other shapes."""
    start = np.full((3, 2), 0.5, np.float32)
    s, other = (state(start, [0, 1, 1], [0, 0], device) for _ in range(2))
    gradient = np.ones((3, 2), np.float32)
    step(other, gradient, device)
    poisoned = gradient.copy() if where == "grad" else s[where].numpy().copy()
    poisoned[1, 1] = bad
    s[where].assign(poisoned)
    step(s, poisoned if where == "grad" else gradient, device)
    assert s["broken"].numpy().tolist() == [0, 1]
    for name in ("value", "moment1", "moment2"):
        after, wanted = s[name].numpy(), other[name].numpy().copy()
        wanted[1, 1] = poisoned[1, 1] if name == where else (0.5 if name == "value" else 0.0)
        np.testing.assert_array_equal(after, wanted)


def test_a_row_is_corrected_by_the_age_of_its_own_shape(device: str) -> None:
    """A shape placed late makes the step that it would have made at the start."""
    s = state(np.zeros((3, 1), np.float32), [1, 0, 1], [0, 0], device)
    s["ages"].assign(np.array([50, 0], np.int32))
    step(s, np.ones((3, 1), np.float32), device, final=1.0)
    moved = -s["value"].numpy()[:, 0]
    np.testing.assert_allclose(moved[[0, 2]], 0.1, rtol=1e-5)
    moment = 0.2 / (1 - 0.8**51)
    np.testing.assert_allclose(moved[1], 0.1 * moment / np.sqrt(moment), rtol=1e-4)


def test_shapes_without_the_attribute_stay_as_they_are(device: str) -> None:
    s = state(np.zeros((4, 1), np.float32), [0, 1, 2, 3], [0, 1, 0, 1], device)
    step(s, np.ones((4, 1), np.float32), device, kinds=1 << Kind.STROKE, low=-1.0, high=-0.01)
    assert (s["value"].numpy()[:, 0] < 0).tolist() == [False, True, False, True]
    assert (s["moment2"].numpy()[:, 0] > 0).tolist() == [False, True, False, True]


def test_held_rows_stay_as_they_are_with_their_moments(device: str) -> None:
    """The others move as if nothing were held; let go, a row goes on from the moments that it had."""
    rng = np.random.default_rng(3)
    start = rng.normal(size=(4, 2)).astype(np.float32)
    gradients = rng.normal(size=(6, 4, 2)).astype(np.float32)
    held, free = (state(start, [0, 1, 1, 2], [0, 1, 0], device) for _ in range(2))
    for g in gradients[:3]:
        step(held, g, device)
        step(free, g, device)
    before = {name: held[name].numpy().copy() for name in ("value", "moment1", "moment2")}
    held["held"].assign(np.array([0, 1, 0, 1], np.int32))
    for g in gradients[3:]:
        step(held, g, device)
        step(free, g, device)
    for name, old in before.items():
        np.testing.assert_array_equal(held[name].numpy()[[1, 3]], old[[1, 3]])
        np.testing.assert_array_equal(held[name].numpy()[[0, 2]], free[name].numpy()[[0, 2]])
        assert (free[name].numpy()[[1, 3]] != old[[1, 3]]).all()
    held["held"].zero_()
    step(held, gradients[0], device)
    np.testing.assert_allclose(
        held["moment1"].numpy()[1], 0.8 * before["moment1"][1] + 0.2 * gradients[0, 1], rtol=1e-5
    )
    assert (held["value"].numpy()[1] != before["value"][1]).all()
