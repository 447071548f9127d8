"""The loop, the back end, the map and what people do with it."""

from typing import TYPE_CHECKING

from ..datasets.on_demand import on_demand

if TYPE_CHECKING:
    from .config import MapperConfig as MapperConfig
    from .map.object_map import ObjectMap as ObjectMap
    from .map.thing import Thing as Thing
    from .mapper import MapUpdate as MapUpdate
    from .mapper import SemanticMapper as SemanticMapper

_PLACES = {
    "MapperConfig": "config",
    "ObjectMap": "map.object_map",
    "Thing": "map.thing",
    "MapUpdate": "mapper",
    "SemanticMapper": "mapper",
}
__all__ = ["MapUpdate", "MapperConfig", "ObjectMap", "SemanticMapper", "Thing"]


__getattr__ = on_demand(__name__, _PLACES)  # the solver takes a second, and a map can be read without it
