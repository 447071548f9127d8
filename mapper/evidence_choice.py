"""Which evidence model a run takes: what the configuration names, else what the detector does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ..detectors.detector import Detector
from ..factors.evidence_model import SHIPPED_HOG, EvidenceModel, generic_evidence_model, load_evidence_model
from .config import MapperConfig

GENERIC = "generic"  # name of the evidence model that was learned from nothing
NAMED = {"hog": SHIPPED_HOG}  # those that come with thingmap besides the default one


def with_evidence_of(detector: Detector | None, config: MapperConfig) -> MapperConfig:
    """The configuration with the name of the detector's own evidence model, where it names none itself.

    So the file of a run's configuration says which one it was.
    """
    own = getattr(detector, "evidence_model", "")
    if config.evidence.model or not own:
        return config
    return replace(config, evidence=replace(config.evidence, model=own))


def evidence_model(name: str) -> EvidenceModel | None:
    """The evidence model of a name: a file, one that comes with thingmap, or "generic" for none; None for no name.

    Raises:
        InputError: the file is missing or damaged.
    """
    if name == GENERIC:
        return generic_evidence_model()
    return load_evidence_model(NAMED.get(name, Path(name))) if name else None
