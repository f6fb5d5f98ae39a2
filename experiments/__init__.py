"""The named experiments of the suspension rig, one module for each study."""

from experiments import imposed, quarter_car, single_mass, vehicles
from rigtwin.errors import RigtwinError
from rigtwin.simulation.experiment import Experiment

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for module in (quarter_car, single_mass, imposed, vehicles)
    for experiment in module.EXPERIMENTS
}


def find(name: str) -> Experiment:
    """Return the experiment of a name.

    Raises RigtwinError, listing the names that exist, for an unknown name.
    """
    try:
        return EXPERIMENTS[name]
    except KeyError:
        raise RigtwinError(
            f"unknown experiment {name!r}; there are {', '.join(EXPERIMENTS)}"
        ) from None


__all__ = ["EXPERIMENTS", "find"]
