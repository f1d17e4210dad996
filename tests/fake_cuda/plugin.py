"""``pytest --device fake-cuda``: tests that take a device get the test device, and break no rule of CUDA."""

from __future__ import annotations

import os
import sys
from collections.abc import Generator

import pytest

from tests import fake_cuda
from tests.fake_cuda import rules


def install_if_asked_for() -> bool:
    """Install the test device if pytest is to use it; return whether it is."""
    if os.environ.get(fake_cuda.VARIABLE):
        return True  # of a process of pytest-xdist, say, in which Python has installed it at its start
    if not any(argument.removeprefix("--device=") == fake_cuda.NAME for argument in sys.argv):
        return False
    if not fake_cuda.SUPPORTED:
        raise pytest.UsageError(f"the test device knows Warp {fake_cuda.VERSIONS[0]}x on Linux")
    from tests.fake_cuda.install import install

    os.environ.update(fake_cuda.environment(fake_cuda.options))  # also for what the tests start
    install()
    return True


ACTIVE = install_if_asked_for()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, None, None]:
    """Fail a test in which a rule was broken."""
    del rules.broken[:]
    yield
    from tests.fake_cuda import install

    install.finish()
    assert not rules.broken, "\n".join(rules.broken)
