"""How to install an extra of thingmap: from where thingmap itself was installed."""

from __future__ import annotations

import json
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

PACKAGE = "thingmap"


def install_command(extra: str) -> str:
    """The command that installs an extra beside this thingmap, whether it came from a folder or from an index."""
    pip = "pip" if find_spec("pip") else "uv pip"  # an environment that uv made has no pip of its own
    folder = _folder()
    return f'{pip} install "{PACKAGE if folder is None else folder}[{extra}]"'


def _folder() -> Path | None:
    """The folder that thingmap was installed from, where it was one and is still there."""
    try:
        origin = distribution(PACKAGE).read_text("direct_url.json")  # PEP 610; an index leaves no such file
    except PackageNotFoundError:
        return None
    parts = urlsplit(json.loads(origin)["url"] if origin else "")
    folder = Path(url2pathname(parts.path))
    return folder if parts.scheme == "file" and folder.is_dir() else None
