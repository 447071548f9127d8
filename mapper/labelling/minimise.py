"""From the random field's configuration to labels: cuts or mean field, with a bound where one is asked for."""

from __future__ import annotations

from dataclasses import dataclass

from .alpha_expansion import expand
from .dual_bound import DualBound, bound_energy
from .energy import PottsEnergy
from .labels import Labelling
from .mean_field import mean_field
from .mrf_config import MrfConfig


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """The labels, and how good they are.

    Attributes:
        labelling: by alpha-expansion, or by mean field (`MrfConfig.fast`).
        bound: what no labelling is below; None if not asked for.
    """

    labelling: Labelling
    bound: DualBound | None

    @property
    def gap(self) -> float | None:
        """(E - bound) / |bound|: at most so much lower could the energy be. None without a bound."""
        return None if self.bound is None else self.bound.gap(self.labelling.energy)


def minimise(energy: PottsEnergy, config: MrfConfig) -> Minimum:
    """Labels of low energy, by the means and with the limits of `config`."""
    if config.fast:
        labelling = mean_field(energy, config.fast_sweeps).labelling
    else:
        labelling = expand(energy, max_sweeps=config.max_sweeps)
    return Minimum(labelling, bound_energy(energy, config.bound_sweeps) if config.bound_sweeps else None)
