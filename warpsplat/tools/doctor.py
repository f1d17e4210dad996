"""Checks of everything that a run needs. Each imports what it checks, which may be broken."""

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from warpsplat._version import __version__
from warpsplat.errors import explain

PACKAGES = {
    "click": "click",
    "jinja2": "jinja2",
    "numpy": "numpy",
    "opencv-contrib-python-headless": "cv2",
    "pillow": "PIL",
    "pyyaml": "yaml",
    "resvg-py": "resvg_py",
    "warp-lang": "warp",
}
"""Required packages and their modules."""

EXTRAS = {
    "torch": ("torch", "warpsplat.torch, and code written for DiffVG"),
    "pdf": ("typst", "outputs that end in .pdf"),
    "dxf": ("ezdxf", "outputs that end in .dxf"),
    "video": ("av", "animations that end in .mp4"),
    "ray": ("ray", "warpsplat batch --executor ray"),
    "serve": ("starlette", "warpsplat serve"),
    "remote": ("upath", "images and results behind URLs"),
}
"""Extra -> its package and purpose."""


@dataclass(frozen=True)
class Check:
    """Result of a check."""

    text: str
    """One line."""
    values: dict[str, Any] = field(default_factory=dict)
    """The same as data."""
    status: Literal["ok", "note", "broken"] = "ok"
    hint: str = ""
    """The remedy."""
    name: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return values for JSON."""
        found = {"name": self.name, "status": self.status, "text": self.text, **self.values}
        return found | ({"hint": self.hint} if self.hint else {})


def checks(device: str = "auto") -> Iterator[Check]:
    """Yield all checks, in an order in which a failure explains later ones; ``device``: of the self-test."""
    tests: dict[str, Callable[[], Check]] = {
        "python": check_python,
        "packages": check_packages,
        "extras": check_extras,
        "devices": check_devices,
        "machine": check_machine,
        "kernel cache": check_cache,
        "viewer": check_viewer,
        "self-test": lambda: check_run(device),
        "adjoint": lambda: check_adjoint(device),
    }
    for name, test in tests.items():
        try:
            check = test()
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # broken packages raise anything
            check = Check(explain(error)[0], status="broken")
        yield replace(check, name=name)


def check_python() -> Check:
    """Check the interpreter and the system."""
    values = {"warpsplat": __version__, "python": platform.python_version(), "executable": sys.executable}
    values["system"] = f"{platform.system()} {platform.release()} {platform.machine()}"
    text = f"warpsplat {__version__}, Python {values['python']} ({sys.executable}) on {values['system']}"
    if sys.maxsize < 2**32:
        return Check(f"{text}: 32 bits", values, "broken", "a 64-bit Python is needed")
    return Check(text, values)


def version_of(package: str) -> str | None:
    """Return the version of an installed package, or None."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def check_packages() -> Check:
    """Check that each required package can be imported."""
    versions: dict[str, str] = {}
    broken: list[str] = []
    for package, name in PACKAGES.items():
        try:
            module = importlib.import_module(name)
            versions[package] = version_of(package) or str(getattr(module, "__version__", "?"))
        except BaseException as error:  # native libraries fail in their own ways
            cause = explain(error)[0].removeprefix("internal error: ").split(" (set ")[0]
            broken.append(f"{package} ({cause})")
    if broken:
        hint = "reinstall warpsplat: pip install --force-reinstall warpsplat"
        return Check("cannot be imported: " + ", ".join(broken), {"versions": versions}, "broken", hint)
    text = ", ".join(f"{name} {version}" for name, version in versions.items())
    return Check(text, {"versions": versions})


def check_extras() -> Check:
    """Check the optional packages."""
    found = {extra: version_of(package) for extra, (package, _) in EXTRAS.items()}
    installed = [f"{extra} ({EXTRAS[extra][0]} {version})" for extra, version in found.items() if version]
    missing = [f"{extra} (for {EXTRAS[extra][1]})" for extra, version in found.items() if not version]
    text = ", ".join(installed)
    if not missing:
        return Check(text, {"versions": found})
    text += "; " * bool(installed) + "not installed: " + ", ".join(missing)
    return Check(text, {"versions": found}, "note")


def check_devices() -> Check:
    """Check the devices that Warp finds, and what stands in the way of others."""
    import warp as wp

    from warpsplat.rendering.device import choose_device, no_gpu, obstacle, start_warp

    start_warp()
    driver, gpus = wp.get_cuda_driver_version(), wp.get_cuda_devices()
    devices: list[dict[str, Any]] = [
        {"name": str(d), "description": d.name, "memory": None if d.is_cpu else d.total_memory}
        for d in wp.get_devices()
    ]
    reasons = {str(gpu): obstacle(gpu) for gpu in gpus} if gpus else {"no GPU": no_gpu()}
    obstacles = {name: why for name, why in reasons.items() if why}
    values = {
        "devices": devices,
        "default_device": str(choose_device("auto")),
        "cuda_driver": None if driver is None else ".".join(map(str, driver)),
    }
    shown = [
        f"{d['name']} ({d['description']}" + (f", {d['memory'] / 1e9:.0f} GB)" if d["memory"] else ")")
        for d in devices
    ]
    text = ", ".join(shown) + f"; default: {values['default_device']}"
    text += "".join(f"; {name}: {why.cause}" for name, why in obstacles.items())
    hint = "; ".join(dict.fromkeys(why.remedy for why in obstacles.values() if why.remedy))
    return Check(text, values, "note" if hint else "ok", hint)


def check_machine() -> Check:
    """Check cores and memory."""
    from warpsplat.native import available_cores, free_memory

    cores, free = available_cores(), free_memory()
    values = {"cpu_threads": cores, "free_memory": free}
    if free is None:
        return Check(f"{cores} CPU threads", values)
    text = f"{cores} CPU threads, {free / 1e9:.1f} GB of memory free"
    min_memory = 1e9  # free memory that a photograph of some megapixels needs [bytes]
    if free < min_memory:
        return Check(text, values, "note", "large images need more; end other programs")
    return Check(text, values)


def check_cache() -> Check:
    """Check the folder of compiled kernels."""
    import warp as wp

    folder = Path(str(wp.config.kernel_cache_dir))
    modules = [path for path in folder.glob("wp_*") if path.is_dir()] if folder.is_dir() else []
    size = sum(map(_size, modules))
    values = {"folder": str(folder), "modules": len(modules), "bytes": size}
    text = f"{folder}: {len(modules)} modules, {size / 1e6:.0f} MB"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder):
            pass
    except OSError as error:
        text, hint = f"{folder}: cannot be written: {error.strerror}", "WARP_CACHE_PATH names another folder"
        return Check(text, values, "broken", hint)
    return Check(text, values)


def _size(folder: Path) -> int:
    """Return the bytes of a folder's files; another process may be removing some of them."""
    size = 0
    with contextlib.suppress(FileNotFoundError):
        for file in folder.iterdir():
            size += file.stat().st_size
    return size


def _binaries(folder: Path) -> set[Path]:
    """Return the compiled modules, of which each kind of device has its own."""
    from warpsplat.rendering.kernel_cache import BINARIES

    return {path for path in folder.glob("wp_*/*") if path.suffix in BINARIES}


def check_viewer() -> Check:
    """Check resvg, which renders files for measurement."""
    from warpsplat.svg.viewer import render_svg

    head = '<svg xmlns="http://www.w3.org/2000/svg" width="2" height="2">'
    image = render_svg(f'{head}<path d="M0 0h1v2H0z" fill="red"/></svg>').convert("RGBA")
    found = [image.getpixel((x, 1)) for x in (0, 1)]
    if found != [(255, 0, 0, 255), (0, 0, 0, 0)]:
        return Check(f"resvg renders wrong pixels: {found}", {}, "broken", "pip install --upgrade resvg-py")
    return Check("resvg renders correctly")


KNOWN_PSNR, PSNR_TOLERANCE = 23.65, 1.0
"""Result of the self-test and its tolerance [dB]: devices round in different ways, which a run amplifies."""


def check_run(device: str) -> Check:
    """Check a tiny run whose PSNR is known."""
    import numpy as np
    import warp as wp

    from warpsplat.run.vectorize import vectorize

    y, x = np.mgrid[:48, :48] / np.float32(48)
    image = np.stack([x, y, 0.5 + 0.4 * np.sin(6 * x) * np.cos(5 * y)], axis=2).astype(np.float32)
    folder = Path(str(wp.config.kernel_cache_dir))
    before = _binaries(folder)
    started = time.monotonic()
    result = vectorize(image, 16, subject="photo", iterations=60, seed=0, device=device)
    seconds = time.monotonic() - started
    assert result.score
    psnr, compiled = result.score.psnr, len(_binaries(folder) - before)
    values = {"psnr": round(psnr, 2), "seconds": round(seconds, 2), "compiled": compiled}
    text = f"16 shapes in 60 steps: {psnr:.1f} dB in {seconds:.1f} s"
    text += f", {compiled} modules compiled" if compiled else ", kernels were compiled before"
    if abs(psnr - KNOWN_PSNR) > PSNR_TOLERANCE:
        hint = "wrong kernels or a faulty device: remove the kernel cache, try --device cpu"
        return Check(f"{text}; {KNOWN_PSNR:.1f} dB are expected", values, "broken", hint)
    return Check(text, values)


MAX_DIFFERENCE = 0.02
"""Relative, between a derivative and the difference quotient in single precision."""


def check_adjoint(device: str) -> Check:
    """Check a derivative of an image against the difference quotient."""
    import numpy as np

    from warpsplat.rendering.backend import Backend, Viewport
    from warpsplat.rendering.device import choose_device
    from warpsplat.rendering.parameters import Parameters
    from warpsplat.rendering.renderer import Renderer
    from warpsplat.run.prepare import starting_scene

    rng = np.random.default_rng(0)
    y, x = np.mgrid[:32, :32] / np.float32(32)
    scene = starting_scene(np.stack([x, y, 1 - x], axis=2).astype(np.float32), 6)
    parameters = Parameters(scene, Backend.on(choose_device(device)))
    renderer = Renderer(parameters, Viewport(32, 32))
    renderer.forward_complete()
    weights = np.stack([np.sin(5 * x), np.cos(4 * y), x * y], axis=2).astype(np.float32)
    renderer.write_image_grad(weights)
    renderer.backward()
    direction = rng.normal(size=scene.points.shape).astype(np.float32)
    derivative = float((parameters.arrays["points_grad"].numpy() * direction).sum(dtype="float64"))

    def weighted_sum(step: float) -> float:
        parameters.arrays["points"].assign(scene.points + np.float32(step) * direction)
        renderer.forward_complete()
        return float((renderer.read_image() * weights).sum(dtype="float64"))

    step = 0.01  # [px]
    quotient = (weighted_sum(step) - weighted_sum(-step)) / (2 * step)
    difference = abs(derivative - quotient) / max(abs(quotient), 1e-9)
    text = f"derivative and difference quotient of an image differ by {100 * difference:.2f} %"
    if not difference <= MAX_DIFFERENCE:
        hint = "remove the kernel cache, try --device cpu"
        return Check(text, {"difference": difference}, "broken", hint)
    return Check(text, {"difference": difference})
