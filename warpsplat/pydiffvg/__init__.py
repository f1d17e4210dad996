"""DiffVG's Python interface on our renderer: ``import warpsplat.pydiffvg as pydiffvg``.

``python -m warpsplat.pydiffvg SCRIPT ARGUMENTS`` runs a script that imports ``pydiffvg`` without changes. It
renders with ``warpsplat.torch``; docs/pydiffvg.md lists what is supported.
"""

from warpsplat.pydiffvg.color import LinearGradient as LinearGradient
from warpsplat.pydiffvg.color import RadialGradient as RadialGradient
from warpsplat.pydiffvg.device import device as device
from warpsplat.pydiffvg.device import get_device as get_device
from warpsplat.pydiffvg.device import get_use_gpu as get_use_gpu
from warpsplat.pydiffvg.device import set_device as set_device
from warpsplat.pydiffvg.device import set_use_gpu as set_use_gpu
from warpsplat.pydiffvg.device import use_gpu as use_gpu
from warpsplat.pydiffvg.diffvg import FilterType as FilterType
from warpsplat.pydiffvg.image import imwrite as imwrite
from warpsplat.pydiffvg.optimize_svg import OptimizableSvg as OptimizableSvg
from warpsplat.pydiffvg.optimize_svg import SvgOptimizationSettings as SvgOptimizationSettings
from warpsplat.pydiffvg.parse_svg import parse_scene as parse_scene
from warpsplat.pydiffvg.parse_svg import svg_to_scene as svg_to_scene
from warpsplat.pydiffvg.pixel_filter import PixelFilter as PixelFilter
from warpsplat.pydiffvg.render_pytorch import OutputType as OutputType
from warpsplat.pydiffvg.render_pytorch import RenderFunction as RenderFunction
from warpsplat.pydiffvg.render_pytorch import set_print_timing as set_print_timing
from warpsplat.pydiffvg.save_svg import prettify as prettify
from warpsplat.pydiffvg.save_svg import save_svg as save_svg
from warpsplat.pydiffvg.shape import Circle as Circle
from warpsplat.pydiffvg.shape import Ellipse as Ellipse
from warpsplat.pydiffvg.shape import Path as Path
from warpsplat.pydiffvg.shape import Polygon as Polygon
from warpsplat.pydiffvg.shape import Rect as Rect
from warpsplat.pydiffvg.shape import ShapeGroup as ShapeGroup
from warpsplat.pydiffvg.shape import from_svg_path as from_svg_path
