"""`thingmap train`: detectors of one's own objects."""

from __future__ import annotations

import typer

from .train_hog import hog
from .train_shape_context import shape_context

train = typer.Typer(no_args_is_help=True, rich_markup_mode=None, help="Train detectors of your own objects.")
train.command()(hog)
train.command()(shape_context)
