"""Synthetic sequences as a line of text, such as `synth:kitchen?seed=3&clutter=high`."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, unquote

from ..errors import UserError
from ..paths import user_path
from .config import DEFAULT_FRAMES, DEFAULT_OBJECTS, ClutterLevel, Preset, SyntheticConfig
from .rendering.sensor import IDEAL, SWITCHES, DepthSensor

if TYPE_CHECKING:
    from .sequence import SyntheticSequence

PREFIX = "synth:"
NUMBERS = ("seed", "objects", "frames", "width", "blur")
PARAMETERS = ("seed", "objects", "clutter", "frames", "width", "meshes", "blur", "pace", "without")
BOUNDARY = re.compile(r"&(?=[a-z_]+=)")  # an & that no parameter follows belongs to a folder's name


def open_synth(name: str) -> SyntheticSequence:
    """The synthetic sequence that a line describes.

    Args:
        name: as `parse_synth` reads it.

    Raises:
        UserError: as `parse_synth`, or the scene cannot be built (too many things for its places, unusable meshes).
    """
    config = parse_synth(name)
    from .sequence import SyntheticSequence  # the renderer is slow to import; a mistake is told before

    return SyntheticSequence(config)


def parse_synth(name: str) -> SyntheticConfig:
    """What a line asks for.

    Args:
        name: a preset, or with parameters as
            `tabletop?seed=3&objects=20&clutter=high&frames=150&width=640&meshes=FOLDER&blur=4&pace=2.5&without=axial+shadow`;
            a leading `synth:` is allowed. `without` names effects of the depth sensor to switch off, `all` for a
            sensor that reads the truth. Characters of FOLDER may be percent-encoded; they have to be where `&` and
            a word with `=` follow each other in it. Everything else is as in `SyntheticConfig`.

    Raises:
        UserError: no such preset or parameter, or a value that is none of the allowed ones.
    """
    base, _, query = name.removeprefix(PREFIX).partition("?")
    if base not in list(Preset):
        raise UserError(f"{PREFIX}{base}: expected one of {', '.join(Preset)}, found {base!r}; name one of them")
    values: dict[str, Any] = {}
    for key, text in _parameters(base, query):
        if key in values:
            raise UserError(f"{PREFIX}{base}: expected {key} once, found it again; leave one out")
        values[key] = _value(base, key, text)
    without = values.pop("without", ())
    return replace(SyntheticConfig(Preset(base), sensor=_sensor_without(without)), **values)


def synth_line(config: SyntheticConfig) -> str:
    """The shortest line that asks for a configuration: the preset, and what differs from its defaults.

    Numbers of the sensor and the camera other than the sensor's switches have no words and are left out.
    """
    changed = {
        "seed": config.seed or None,
        "objects": config.object_count if config.object_count != DEFAULT_OBJECTS[config.preset] else None,
        "clutter": config.clutter if config.clutter is not ClutterLevel.MEDIUM else None,
        "frames": config.frame_count if config.frame_count != DEFAULT_FRAMES[config.preset] else None,
        "width": config.width if config.width != 640 else None,
        "meshes": quote(str(config.meshes)) if config.meshes is not None else None,
        "blur": config.blur if config.blur > 1 else None,
        "pace": _plainly(config.pace) if config.pace != 1.0 else None,
        "without": _switched_off(config.sensor) or None,
    }
    words = [f"{key}={value}" for key, value in changed.items() if value is not None]
    return f"{PREFIX}{config.preset}" + ("?" + "&".join(words) if words else "")


def _parameters(base: str, query: str) -> Iterator[tuple[str, str]]:
    for word in BOUNDARY.split(query) if query else ():
        key, _, text = word.partition("=")
        if key not in PARAMETERS:
            raise UserError(f"{PREFIX}{base}: expected parameters {', '.join(PARAMETERS)}, found {key!r}; leave it out")
        yield key, text


def _value(base: str, key: str, text: str) -> Any:
    if key in NUMBERS:
        try:
            return int(text)
        except ValueError:
            expected = f"a whole number for {key}"
    elif key == "pace":
        try:
            return float(text)
        except ValueError:
            expected = "a number for pace"
    elif key == "clutter":
        if text in list(ClutterLevel):
            return ClutterLevel(text)
        expected = f"clutter to be one of {', '.join(ClutterLevel)}"
    elif key == "meshes":
        if text:
            return _folder(text)
        expected = "the folder of the meshes"
    else:
        effects = tuple(word for word in re.split(r"[+, ]", unquote(text)) if word)
        unknown = [word for word in effects if word not in (*SWITCHES, "all")]
        if effects and not unknown:
            return effects
        expected, text = f"without to name some of {', '.join(SWITCHES)} or all", (unknown or [text])[0]
    raise UserError(f"{PREFIX}{base}: expected {expected}, found {text!r}; change it")


def _folder(text: str) -> Path:
    """A path as it stands where there is such a folder, else with its percent codes decoded."""
    plain = user_path(text)
    return plain if plain.exists() else user_path(unquote(text))


def _sensor_without(effects: tuple[str, ...]) -> DepthSensor:
    return IDEAL if "all" in effects else replace(DepthSensor(), **dict.fromkeys(effects, False))


def _plainly(number: float) -> str:
    """With all its digits, and without a point where it is whole."""
    return repr(float(number)).removesuffix(".0")


def _switched_off(sensor: DepthSensor) -> str:
    off = [name for name in SWITCHES if not getattr(sensor, name)]
    return "all" if len(off) == len(SWITCHES) else "+".join(off)
