"""The few functions of Ray that the executor calls, in this process and in a fixed order.

A call is done when somebody waits for it, that of the actor that has done least, and only where that has
a place: actors take what they declare of a node, in the order in which they were made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from types import SimpleNamespace
from typing import Any


class RayError(Exception):
    pass


class Reference:
    def __init__(self, actor: FakeActor, method: str, given: tuple[Any, ...]) -> None:
        self.actor, self.method, self.given = actor, method, given
        self.value: Any = None
        self.error: RayError | None = None
        self.done = False


class FakeActor:
    def __init__(self, ray: FakeRay, kind: type, options: dict[str, Any]) -> None:
        self.ray, self.kind, self.options = ray, kind, options
        self.inner: Any = None
        self.node: dict[str, float] | None = None
        self.dead = False
        self.calls = 0

    @property
    def cost(self) -> dict[str, float]:
        return {"CPU": self.options["num_cpus"], "GPU": self.options["num_gpus"]}

    def __getattr__(self, method: str) -> Any:
        return SimpleNamespace(remote=lambda *given: Reference(self, method, given))

    def die(self) -> None:
        self.dead = True
        if self.node is not None:
            for name, count in self.cost.items():
                self.node[name] = self.node.get(name, 0) + count
            self.node = None


class FakeRay:
    """A cluster."""

    def __init__(self, *nodes: dict[str, float]) -> None:
        self.all = [dict(node) for node in nodes]
        self.free = [dict(node) for node in nodes]
        self.exceptions = SimpleNamespace(RayError=RayError)
        self.actors: list[FakeActor] = []
        self.sent: list[Reference] = []
        """Tasks, in the order in which they were done."""
        self.doom: Counter[Any] = Counter()
        """How often an actor dies when it is given this task, by its number, or at this method."""
        self.words = "The actor died unexpectedly.\nmore of it"
        """Message of Ray's error then."""
        self.between: Callable[[str], None] = lambda method: None
        """Called before each call that is done."""
        self.connected = False
        self.addresses: list[str] = []
        self.known = {"auto"}
        """Addresses at which a cluster answers."""

    def is_initialized(self) -> bool:
        return self.connected

    def init(self, address: str, **options: Any) -> None:
        self.addresses.append(address)
        if address not in {"local", *self.known}:
            raise ConnectionError("nobody")
        self.connected = True

    def shutdown(self) -> None:
        self.connected = False

    def nodes(self) -> list[dict[str, Any]]:
        return [{"Alive": True, "Resources": node} for node in self.all]

    def remote(self, kind: type) -> Any:
        def options(**given: Any) -> Any:
            return SimpleNamespace(remote=lambda: self._made(kind, given))

        return SimpleNamespace(options=options)

    def _made(self, kind: type, options: dict[str, Any]) -> FakeActor:
        self.actors.append(FakeActor(self, kind, options))
        return self.actors[-1]

    def kill(self, actor: FakeActor) -> None:
        actor.die()

    def living(self) -> list[FakeActor]:
        return [actor for actor in self.actors if not actor.dead]

    def wait(
        self, references: Iterable[Reference], num_returns: int, timeout: float
    ) -> tuple[list[Reference], list[Reference]]:
        assert num_returns == 1
        waiting = list(references)
        self._place()
        for reference in sorted(waiting, key=lambda reference: reference.actor.calls):
            if reference.done or reference.actor.dead or reference.actor.node is not None:
                self._do(reference)
                return [reference], [other for other in waiting if other is not reference]
        return [], waiting

    def _place(self) -> None:
        for actor in self.living():
            if actor.node is None:
                fits = [n for n in self.free if all(n.get(k, 0) >= c for k, c in actor.cost.items())]
                if fits:
                    actor.node = fits[0]
                    for name, count in actor.cost.items():
                        actor.node[name] = actor.node.get(name, 0) - count
                    actor.inner = actor.kind()

    def _do(self, reference: Reference) -> None:
        if reference.done:
            return
        reference.done = True
        reference.actor.calls += 1
        self.between(reference.method)
        what = reference.given[0].number if reference.method == "do" else reference.method
        if self.doom[what] > 0:
            self.doom[what] -= 1
            reference.actor.die()
        if reference.actor.dead:
            reference.error = RayError(self.words)
            return
        if reference.method == "do":
            self.sent.append(reference)
        reference.value = getattr(reference.actor.inner, reference.method)(*reference.given)

    def get(self, reference: Reference) -> Any:
        assert reference.done
        if reference.error:
            raise reference.error
        return reference.value
