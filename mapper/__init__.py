"""The loop, the back end, the map and what people do with it."""

from typing import TYPE_CHECKING, Any

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


def __getattr__(name: str) -> Any:
    # looked up when asked for: importing the solver takes a second, and a map can be read without it
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f".{_PLACES[name]}", __name__), name)
