"""Calls whose results depend on the processor must not lie between an image and the bytes of its file.

``warpsplat.portable`` says why, and has what to call instead.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Iterator
from pathlib import Path

from tests import ROOT

LEFT_OUT = "warpsplat/kernels", "warpsplat/paper/kernels", "warpsplat/torch", "warpsplat/pydiffvg"
"""Folders that write no files, or not with NumPy."""

EXCEPTIONS = {
    "tools/doctor.py": "np.cos np.sin .normal",  # pictures and weights that are looked at for a moment
    "tools/bench.py": ".normal cv2.GaussianBlur np.cos np.sin",  # scenes whose time is taken
    "pages/reports/pictures.py": "cv2.resize",  # a report's pictures
    "pages/reports/shapes.py": "np.log10",  # a report's figures
    "metrics.py": "cv2.GaussianBlur cv2.resize",  # SSIM and MS-SSIM, which are only shown
    "ssimulacra2.py": "** np.cbrt cv2.GaussianBlur cv2.mean cv2.resize cv2.transform",  # only shown
    "pages/plot.py": "** math.log10",  # a page's plot
    "paper/constants.py": "math.log",  # a constant of models that promise no bits
    "portable/elementary.py": "**",  # powers of -1, which are whole numbers
    "portable/filters.py": "cv2.distanceTransformWithLabels",  # counts in whole numbers
    "drawing/denoise.py": "cv2.boxFilter",  # sums of whole numbers
    "drawing/trace/subject.py": "cv2.boxFilter",  # the same
    "drawing/trace/lattice.py": "@",  # sums of whole numbers
    "drawing/trace/grids.py": "cv2.distanceTransformWithLabels",  # counts in whole numbers
    "motion/preview.py": "cv2.resize",  # a preview
    "forms/frame.py": ".dot",  # Warp's, in kernels
}
"""Forbidden calls that a file may make, and why."""


def words(text: str) -> set[str]:
    return set(text.split())


ELEMENTARY = words(
    "exp exp2 expm1 log log2 log10 log1p sin cos tan sinh cosh tanh asinh acosh atanh cbrt pow"
)

FORBIDDEN = {
    "math": ELEMENTARY | words("cbrt hypot acos asin atan atan2 dist erf erfc gamma lgamma fma sumprod"),
    "np": ELEMENTARY
    | words("""
        cbrt hypot arcsin arccos arctan arctan2 arcsinh arccosh arctanh acos asin atan atan2 power
        float_power logaddexp logaddexp2 angle
        sinc i0 unwrap geomspace logspace vander dot inner vdot vecdot matvec vecmat matmul
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
    applyColorMap ximgproc thinning boundingRect watershed
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
    for path, tree in sources():
        allowed = words(EXCEPTIONS.get(path.removeprefix("warpsplat/"), ""))
        found = list(forbidden(tree))
        wrong = [f"{path}:{line}: {name}" for name, line in found if name not in allowed]
        assert not wrong, "warpsplat.portable has what to call instead"
        assert not allowed - {name for name, _ in found}, f"{path}: exceptions that nothing needs"


FOUND = """
np.exp: np.exp(x)
math.log: values = map(math.log, sizes)
from math: from math import sin
cmath.rect: cmath.rect(1, x)
@: a @ b
**: x ** 0.5
**: x **= 3
pow: pow(x, 2)
np.linalg.solve: np.linalg.solve(a, b)
np.linalg.norm: np.linalg.norm(a, 1, axis=0)
.argsort: a.argsort(kind='quicksort')
.dot: a.dot(b)
.normal: rng.normal(size=3)
cv2.resize: cv2.resize(a, size, interpolation=cv2.INTER_AREA)
cv2.filter2D: cv2.filter2D(a, -1, k)
np.fft: np.fft.rfft(a)
"""

ALLOWED = """
np.sqrt(x) + math.sqrt(y) + elementary.exp(x) + np.abs(x) + x**2 + 2**16
np.linalg.norm(a, axis=1, keepdims=True)
raise np.linalg.LinAlgError
np.argsort(a, kind='stable') + a.argsort(kind='stable') + np.sort(a)
rng.uniform(size=3) + rng.integers(3)
cv2.resize(a, size, interpolation=cv2.INTER_NEAREST)
cv2.dilate(a, k, borderType=cv2.BORDER_REPLICATE)
cv2.applyColorMap(a, cv2.COLORMAP_INFERNO)
text.partition(':')
"""


def test_forbidden_calls_are_found() -> None:
    for line in FOUND.strip().splitlines():
        wanted, _, code = line.partition(": ")
        assert [name for name, _ in forbidden(ast.parse(code))] == [wanted], code
    assert not list(forbidden(ast.parse(ALLOWED)))
