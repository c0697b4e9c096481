from .examples import Example as Example, ExampleSets as ExampleSets, Scan as Scan, SurfaceKey as SurfaceKey
from .parts import Part as Part
from .protocol import SurfaceSystem as SurfaceSystem
from .registry import get_system as get_system, read_settings as read_settings, system_names as system_names
from .shipped import SHIPPED as SHIPPED, default_system as default_system, load_system as load_system
