"""Matplotlib's SVG made fit to stand inside a page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from html import escape

_NUMBERS = re.compile(r'\b(?:d|x|y|width|height|transform)="[^"]*"')


def for_page(svg: str, key: str, label: str, variables: Mapping[str, str]) -> str:
    """Only the `<svg>` element, scaled by the page, with the page's font and colours, ids of its own, short numbers.

    Args:
        svg: a document from matplotlib, with text as text.
        key: begins every id.
        label: what the picture shows, for those who cannot see it.
        variables: colour in the document -> CSS variable of the page that takes its place.
    """
    element = svg[svg.index("<svg") :].strip()
    head, body = element.split(">", 1)
    box = re.search(r'viewBox="[^"]*"', head)
    assert box is not None  # matplotlib always writes one
    body = re.sub(r"<style.*?</style>", "", body, flags=re.DOTALL)  # it would hold for the whole page
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = re.sub(r' transform="rotate\(-?0 [^"]*"', "", body)
    body = re.sub(r"font-family: [^;\"]*; ", "", body)
    body = _NUMBERS.sub(lambda found: re.sub(r"(\.\d\d)\d+", r"\1", found.group()), body)
    body = re.sub(r'\bid="([^"]*)"', rf'id="{key}-\1"', body)
    body = re.sub(r"url\(#([^)]*)\)", rf"url(#{key}-\1)", body)
    body = re.sub(r'xlink:href="#([^"]*)"', rf'href="#{key}-\1"', body)
    for color, variable in variables.items():
        body = body.replace(color, f"var({variable})")
    body = re.sub(r"\s*\n\s*", "\n", body)
    return f'<svg class="plot" {box.group()} role="img" aria-label="{escape(label)}">{body}'
