"""Scenes: shapes on a canvas, which are optimised and which files hold. NumPy only."""

from warpsplat.scene.attributes import ATTRIBUTES as ATTRIBUTES
from warpsplat.scene.attributes import GRADIENTS as GRADIENTS
from warpsplat.scene.attributes import NO_DASHES as NO_DASHES
from warpsplat.scene.attributes import NO_PICTURE as NO_PICTURE
from warpsplat.scene.attributes import OPACITY_RANGE as OPACITY_RANGE
from warpsplat.scene.attributes import TRAITS as TRAITS
from warpsplat.scene.attributes import Attribute as Attribute
from warpsplat.scene.attributes import Basis as Basis
from warpsplat.scene.attributes import Cap as Cap
from warpsplat.scene.attributes import Join as Join
from warpsplat.scene.attributes import Kind as Kind
from warpsplat.scene.attributes import Paint as Paint
from warpsplat.scene.attributes import Rule as Rule
from warpsplat.scene.attributes import Spread as Spread
from warpsplat.scene.attributes import Unit as Unit
from warpsplat.scene.scene import Bools as Bools
from warpsplat.scene.scene import Canvas as Canvas
from warpsplat.scene.scene import FloatArray as FloatArray
from warpsplat.scene.scene import Floats as Floats
from warpsplat.scene.scene import IndexArray as IndexArray
from warpsplat.scene.scene import KeptPicture as KeptPicture
from warpsplat.scene.scene import Scene as Scene
