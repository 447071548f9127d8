"""Files for other tools, a module a format; each reads nothing but the output folder of a run, COCO's its sequence too.

    export_glb(OutputFolder.open("out/tabletop"), Path("map.glb"), points=50_000)

Every exporter reads the map as `ObjectMap.load` gives it, writes its file whole or not at all, and returns how many
things, poses, boxes or rows it wrote. Packages that only one format needs are imported when it is asked for.
"""

from __future__ import annotations

from .formats import FORMATS, Exporter, ExportFormat, export_format, format_of

__all__ = ["FORMATS", "ExportFormat", "Exporter", "export_format", "exporter", "format_of"]


def exporter(name: str) -> Exporter:
    """The function that writes a format of `FORMATS`; raises `ValueError` where there is no such format."""
    return export_format(name).load()
