"""What stands in the synthetic world: a builder a class, and things of no class."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from ...errors import UserError
from .books import book
from .bottles import bottle
from .caps import cap
from .cartons import carton, parcel, tissue_box
from .crockery import bowl, coffee_mug
from .flashlight import flashlight
from .groceries import cereal_box, soda_can
from .jars import candle, jar
from .objects import Model
from .plants import plant
from .toys import toy

Builder = Callable[[np.random.Generator], Model]

BUILDERS: dict[str, Builder] = {
    "bowl": bowl,
    "cap": cap,
    "cereal box": cereal_box,
    "coffee mug": coffee_mug,
    "soda can": soda_can,
    "flashlight": flashlight,
    "bottle": bottle,
}
CLASSES = tuple(BUILDERS)  # those of the papers that the evaluation follows
CLUTTER: tuple[tuple[str, Builder, float], ...] = (  # label, builder, share
    ("book", book, 0.24),
    ("toy", toy, 0.22),
    ("plant", plant, 0.14),
    ("box", parcel, 0.10),
    ("box", carton, 0.12),
    ("tissue box", tissue_box, 0.06),
    ("jar", jar, 0.07),
    ("candle", candle, 0.05),
)


def build_model(label: str, rng: np.random.Generator) -> Model:
    """A thing of one of `CLASSES`; shape, size and texture vary with `rng`."""
    return BUILDERS[label](rng)


def build_clutter(rng: np.random.Generator, classes: Iterable[str] = ()) -> Model:
    """A thing of no class; its label says what it is: book, toy, plant, box, tissue box, jar or candle.

    Args:
        rng: says which, and how it looks.
        classes: labels that count as classes, where imported meshes bring more of them.

    Raises:
        UserError: the classes leave nothing that could be clutter.
    """
    kinds = [(builder, share) for label, builder, share in CLUTTER if label not in set(classes)]
    if not kinds:
        raise UserError(
            f"synthetic scene: expected classes that leave something to be clutter, found {', '.join(classes)}; "
            "take fewer meshes"
        )
    shares = np.array([share for _, share in kinds])
    return kinds[int(rng.choice(len(kinds), p=shares / shares.sum()))][0](rng)
