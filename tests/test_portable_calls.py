"""Calls whose results depend on the processor must not lie between an image and the bytes of its file.

``warpsplat.portable`` says why, and has what to call instead.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import ROOT

LEFT_OUT = "warpsplat/kernels", "warpsplat/paper/kernels", "warpsplat/torch", "warpsplat/pydiffvg"
"""Folders that write no files, or not with NumPy."""

EXCEPTIONS = {
    ("warpsplat/tools/doctor.py", "np.cos"): "pictures and weights that are looked at for a moment",
    ("warpsplat/tools/doctor.py", "np.sin"): "the same",
    ("warpsplat/tools/doctor.py", ".normal"): "the same",
    ("warpsplat/fit/costs.py", "**"): "progress",
    ("warpsplat/drawing/costs.py", "**"): "progress",
    ("warpsplat/drawing/costs.py", "math.log"): "progress",
    ("warpsplat/drawing/costs.py", "math.log10"): "progress",
    ("warpsplat/drawing/costs.py", "math.log1p"): "progress",
    ("warpsplat/drawing/costs.py", "np.hypot"): "progress",
    ("warpsplat/tools/bench.py", ".normal"): "scenes whose time is taken",
    ("warpsplat/tools/bench.py", "cv2.GaussianBlur"): "the same",
    ("warpsplat/tools/bench.py", "np.cos"): "the same",
    ("warpsplat/tools/bench.py", "np.sin"): "the same",
    ("warpsplat/pages/reports/pictures.py", "cv2.resize"): "a report's pictures",
    ("warpsplat/pages/reports/shapes.py", "np.log10"): "a report's figures",
    ("warpsplat/metrics.py", "cv2.GaussianBlur"): "SSIM, which is only shown",
    ("warpsplat/metrics.py", "cv2.resize"): "MS-SSIM, which is only shown",
    ("warpsplat/ssimulacra2.py", "np.cbrt"): "SSIMULACRA2, which is only shown",
    ("warpsplat/ssimulacra2.py", "**"): "the same",
    ("warpsplat/ssimulacra2.py", "cv2.GaussianBlur"): "the same",
    ("warpsplat/ssimulacra2.py", "cv2.mean"): "the same",
    ("warpsplat/ssimulacra2.py", "cv2.transform"): "the same",
    ("warpsplat/ssimulacra2.py", "cv2.resize"): "the same",
    ("warpsplat/pages/plot.py", "**"): "a page's plot",
    ("warpsplat/pages/plot.py", "math.log10"): "a page's plot",
    ("warpsplat/portable/elementary.py", "**"): "powers of -1, which are whole numbers",
    ("warpsplat/portable/filters.py", "cv2.distanceTransformWithLabels"): "counts in whole numbers",
    ("warpsplat/drawing/trace/assign.py", "cv2.distanceTransformWithLabels"): "counts in whole numbers",
    ("warpsplat/motion/preview.py", "cv2.resize"): "a preview",
}
"""Forbidden calls that a file may make, and why."""


def words(text: str) -> set[str]:
    """Return the words of a text."""
    return set(text.split())


ELEMENTARY = words(
    "exp exp2 expm1 log log2 log10 log1p sin cos tan sinh cosh tanh asinh acosh atanh cbrt pow"
)

FORBIDDEN = {
    "math": ELEMENTARY | words("cbrt hypot acos asin atan atan2 dist erf erfc gamma lgamma fma sumprod"),
    "np": ELEMENTARY
    | words("""
        cbrt hypot arcsin arccos arctan arctan2 arcsinh arccosh arctanh acos asin atan atan2 power
        float_power logaddexp
        logaddexp2 angle sinc i0 unwrap geomspace logspace vander dot inner vdot vecdot matvec vecmat matmul
        tensordot einsum cov corrcoef convolve correlate interp roots poly polyfit polyval fft partition
        argpartition
    """),
}
"""Functions with code of their own for some processors, or of the C library, by module. ``cmath`` and
``np.linalg`` are forbidden as a whole (but lengths along an axis), ``cv2`` but for ``EXACT``."""

METHODS = words("""
    argsort dot argpartition normal standard_normal multivariate_normal lognormal exponential
    standard_exponential gamma standard_gamma beta chisquare binomial poisson laplace rayleigh weibull
""")
"""Methods of arrays and of random generators, whatever they are called on."""

EXACT = words("""
    connectedComponents connectedComponentsWithStats findContours drawContours dilate erode morphologyEx
    getStructuringElement medianBlur fillPoly line circle ellipse polylines rectangle copyMakeBorder imdecode
    applyColorMap ximgproc thinning boundingRect
""")
"""Functions of OpenCV that compute with integers, or only compare."""


def named(node: ast.AST) -> str:
    """Return a dotted name as it is written; "" for another expression."""
    return ast.unparse(node) if isinstance(node, (ast.Attribute, ast.Name)) else ""


def is_allowed_call(call: ast.Call) -> bool:
    """Return whether the arguments make a call portable."""
    given = {keyword.arg: named(keyword.value) or ast.unparse(keyword.value) for keyword in call.keywords}
    name = named(call.func)
    if name == "np.linalg.norm":
        return "axis" in given and "ord" not in given and len(call.args) == 1
    if name == "cv2.resize":
        return given.get("interpolation") == "cv2.INTER_NEAREST"
    return (
        isinstance(call.func, ast.Attribute)
        and call.func.attr == "argsort"
        and given.get("kind") == "'stable'"
    )


def is_whole_power(left: ast.expr, right: ast.expr) -> bool:
    """Return whether it is a square, or a power of two integer literals."""
    if isinstance(right, ast.Constant) and right.value == 2:
        return True
    return all(isinstance(side, ast.Constant) and isinstance(side.value, int) for side in (left, right))


def forbidden_name(node: ast.Attribute) -> str:
    """Return the forbidden name that an attribute is; "" if it is allowed."""
    home, name = named(node.value), node.attr
    if home == "cv2" and name not in EXACT and not name.isupper() and not name.startswith("COLOR_"):
        return f"cv2.{name}"
    if home in FORBIDDEN and name in FORBIDDEN[home]:
        return f"{home}.{name}"
    if home == "cmath" or (home == "np.linalg" and name != "LinAlgError"):
        return f"{home}.{name}"
    return f".{name}" if name in METHODS else ""


def forbidden(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield forbidden names and their lines."""
    allowed = {
        id(call.func) for call in ast.walk(tree) if isinstance(call, ast.Call) and is_allowed_call(call)
    }
    for node in ast.walk(tree):
        if isinstance(node, (ast.BinOp, ast.AugAssign)):
            sides = (node.left, node.right) if isinstance(node, ast.BinOp) else (node.target, node.value)
            if isinstance(node.op, ast.MatMult):
                yield "@", node.lineno
            elif isinstance(node.op, ast.Pow) and not is_whole_power(*sides):
                yield "**", node.lineno
        elif isinstance(node, ast.Attribute) and id(node) not in allowed and forbidden_name(node):
            yield forbidden_name(node), node.lineno
        elif isinstance(node, ast.Call) and named(node.func) == "pow":
            yield "pow", node.lineno
        elif isinstance(node, ast.ImportFrom) and node.module in {"math", "cmath", "cv2", "numpy"}:
            yield f"from {node.module}", node.lineno


def sources() -> Iterator[tuple[str, ast.AST]]:
    """Yield the files to inspect: path from the project's folder, and syntax tree."""
    for folder, _, files in os.walk(ROOT / "warpsplat", followlinks=True):
        for file in files:
            path = Path(folder, file).relative_to(ROOT).as_posix()
            if file.endswith(".py") and not path.startswith(LEFT_OUT):
                yield path, ast.parse((ROOT / path).read_text(encoding="utf-8"))


def test_nothing_depends_on_the_processor() -> None:
    found, used = [], set()
    for path, tree in sources():
        for name, line in forbidden(tree):
            used.add((path, name))
            if (path, name) not in EXCEPTIONS:
                found.append(f"{path}:{line}: {name}")
    assert not found, "warpsplat.portable has what to call instead"
    assert not {key for key in EXCEPTIONS if (ROOT / key[0]).exists()} - used, "exceptions that nothing needs"


@pytest.mark.parametrize(
    ("code", "names"),
    [
        ("np.exp(x)", ["np.exp"]),
        ("values = map(math.log, sizes)", ["math.log"]),
        ("from math import sin", ["from math"]),
        ("cmath.rect(1, x)", ["cmath.rect"]),
        ("a @ b", ["@"]),
        ("a @= b", ["@"]),
        ("x ** 3 + 2 ** y + x ** 0.5", ["**", "**", "**"]),
        ("x **= 3", ["**"]),
        ("pow(x, 2)", ["pow"]),
        ("np.linalg.solve(a, b)", ["np.linalg.solve"]),
        ("np.linalg.norm(a)", ["np.linalg.norm"]),
        ("np.linalg.norm(a, 1, axis=0)", ["np.linalg.norm"]),
        ("np.argsort(a)", [".argsort"]),
        ("a.argsort(kind='quicksort')", [".argsort"]),
        ("a.dot(b)", [".dot"]),
        ("rng.normal(size=3)", [".normal"]),
        ("cv2.resize(a, size, interpolation=cv2.INTER_AREA)", ["cv2.resize"]),
        ("cv2.filter2D(a, -1, k)", ["cv2.filter2D"]),
        ("np.fft.rfft(a)", ["np.fft"]),
        ("np.sqrt(x) + math.sqrt(y) + elementary.exp(x) + np.abs(x)", []),
        ("x**2 + 2**16", []),
        ("np.linalg.norm(a, axis=1, keepdims=True)", []),
        ("raise np.linalg.LinAlgError", []),
        ("np.argsort(a, kind='stable') + a.argsort(kind='stable') + np.sort(a)", []),
        ("rng.uniform(size=3) + rng.integers(3)", []),
        ("cv2.resize(a, size, interpolation=cv2.INTER_NEAREST)", []),
        ("cv2.dilate(a, k, borderType=cv2.BORDER_REPLICATE)", []),
        ("cv2.applyColorMap(a, cv2.COLORMAP_INFERNO)", []),
        ("text.partition(':')", []),
    ],
)
def test_forbidden_calls_are_found(code: str, names: list[str]) -> None:
    assert [name for name, _ in forbidden(ast.parse(code))] == names
