"""The page as one HTML text: parts of this folder joined, data as base64, and a policy that forbids any request."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from functools import cache
from html import escape
from importlib.resources import files

GENERATOR = "thingmap page/1"
HEAD_BYTES = 600  # of a page in which its generator is found
SCRIPTS = (  # in the order in which they need each other
    "vectors.js",
    "data.js",
    "state.js",
    "gl.js",
    "camera.js",
    "controls.js",
    "geometry.js",
    "scene.js",
    "picking.js",
    "tags.js",
    "search.js",
    "panel.js",
    "timeline.js",
    "main.js",
)
SHADERS = (
    "points.vert",
    "points.frag",
    "shade.vert",
    "shade.frag",
    "lines.vert",
    "lines.frag",
    "faces.vert",
    "faces.frag",
)


def document(title: str, blocks: Mapping[str, bytes]) -> str:
    """The whole page.

    Only the one script and the one style of the page are allowed, by their SHA-256: text of a map can neither run nor
    load anything, whatever it holds.

    Args:
        title: of the window; any text.
        blocks: name -> bytes, which the script finds as `data.js` says.
    """
    style = part("page.css")
    script = joined_scripts()
    policy = "; ".join(
        (
            "default-src 'none'",
            f"script-src '{_digest(script)}'",
            f"style-src '{_digest(style)}'",
            "img-src blob:",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )
    data = [
        _block("data-" + name, "application/octet-stream", base64.b64encode(content).decode("ascii"))
        for name, content in blocks.items()
    ]
    data += [_block(name, "x-shader/glsl", part(name)) for name in SHADERS]
    values = {
        "GENERATOR": GENERATOR,
        "POLICY": policy,
        "TITLE": escape(title),
        "STYLE": style,
        "DATA": "\n".join(data),
        "SCRIPT": script,
    }
    text = part("page.html")
    pieces = text.split("%%")  # every second piece is a name
    return "".join(values[piece] if place % 2 else piece for place, piece in enumerate(pieces))


def joined_scripts() -> str:
    """The files of the script one after another, in a scope of their own."""
    body = "\n".join(f"// {name}\n{part(name)}" for name in SCRIPTS)
    return f'(() => {{\n"use strict";\n{body}\n}})();\n'


@cache
def part(name: str) -> str:
    """The text of a file of this folder."""
    return files(__name__.rpartition(".")[0]).joinpath(name).read_text(encoding="utf-8")


def is_page(head: bytes) -> bool:
    """Whether a file with this beginning was written here, by any version."""
    return b'content="thingmap page/' in head[:HEAD_BYTES]


def _block(name: str, kind: str, text: str) -> str:
    return f'<script type="{kind}" id="{name}">{text}</script>'


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii")
