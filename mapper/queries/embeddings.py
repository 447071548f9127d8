"""Things ranked by how alike a text's embedding and their own are."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...datasets.errors import UserError
from ..map.thing import Thing
from .answer import Answer

TEMPERATURE = 0.01  # of cosines: the lowest to which CLIP's training may go (Radford et al. 2021, section 2.5)


def find_by_embedding(
    things: Sequence[Thing], text: str, encoder: Callable[[str], np.ndarray], temperature: float = TEMPERATURE
) -> list[Answer]:
    """Every thing that has an embedding, with a share of what the text may mean, in their order.

    For unit vectors t of the text and e_i of the things,

        p_i = P(thing i exists) exp(t.e_i / T) / sum_j exp(t.e_j / T)

    The fraction is the posterior of "the text means thing i" *if exactly one thing of the map is meant* and the encoder
    was trained with this softmax. So it is a ranking on the scale of probabilities, not calibrated by anything here:
    of two equal mugs each gets half, and the best of a map without any mug still gets most.

    Raises:
        UserError: no thing has an embedding, or the encoder's vectors are no such vectors or of another length.
        ValueError: `temperature` is not positive.
    """
    if not temperature > 0.0:
        raise ValueError(f"temperature must be positive, but got {temperature}")
    known = [thing for thing in things if getattr(thing, "embedding", None) is not None]
    if not known:
        raise UserError(
            "no thing of this map has an embedding; map with a detector that gives `Detections.embedding`, "
            "or ask without an encoder"
        )
    own = np.stack([np.asarray(getattr(thing, "embedding"), dtype=np.float64) for thing in known])  # noqa: B009
    vector = np.asarray(encoder(text), dtype=np.float64).squeeze()
    if vector.shape != own.shape[1:] or not np.all(np.isfinite(vector)):
        raise UserError(
            f"the encoder must give {own.shape[1]} finite numbers, as the things' embeddings have, but gave an array "
            f"of shape {vector.shape}; use the text encoder that belongs to the detector's image encoder"
        )
    lengths = np.linalg.norm(own, axis=1) * np.linalg.norm(vector)
    logit = own @ vector / np.maximum(lengths, 1e-12) / temperature
    weight = np.exp(logit - logit.max())
    share = weight / weight.sum()
    return [Answer(thing, float(p) * thing.existence) for thing, p in zip(known, share, strict=True)]
