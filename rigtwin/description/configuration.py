"""All settings of one test of one machine.

One type for every machine. What a machine does not have (a road, say) is a group without settings.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Generic, NamedTuple, TypeVar

from controllers import Settings
from rigtwin.components import RigPlant
from rigtwin.components.plant import Plant
from rigtwin.components.quantity import Choice, Quantity, fields
from rigtwin.description.settings import Road, Safety, Timing
from rigtwin.errors import RigtwinError

P = TypeVar("P", bound=Plant)
C = TypeVar("C", bound=tuple)
MOST_TICKS = 100_000_000
"""More than a day at 1 kHz."""


class Configuration(NamedTuple, Generic[P, C]):
    """All settings of one test of one machine; by default of the nominal suspension rig.

    Keys are `group.name`, e.g. `rail.coulomb`, `controller.kp`, `timing.duration`. plant and
    controller are NamedTuples, of whatever components and settings the machine has.
    """

    plant: P = RigPlant()  # type: ignore[assignment]
    controller: C = Settings()  # type: ignore[assignment]
    safety: Safety = Safety()
    timing: Timing = Timing()
    road: Road = Road()

    @property
    def substeps(self) -> int:
        """Integration steps a tick. Raises RigtwinError unless the period is a whole multiple of
        the timestep."""
        ratio = self.timing.period / self.timing.timestep
        if ratio < 0.999 or abs(ratio - round(ratio)) > 1e-6:
            raise RigtwinError(
                f"timing.period = {self.timing.period:g} s must be a whole multiple of "
                f"timing.timestep = {self.timing.timestep:g} s; here it is {ratio:.4g} times"
            )
        return round(ratio)

    @property
    def ticks(self) -> int:
        """Ticks in the test, at least one. Raises RigtwinError for more than fit into memory."""
        ticks = max(1, round(self.timing.duration / self.timing.period))
        if ticks > MOST_TICKS:
            raise RigtwinError(
                f"timing.duration / timing.period = {ticks} ticks: expected at most {MOST_TICKS}"
            )
        return ticks


def groups(configuration: Configuration) -> dict[str, Any]:
    """The groups of settings.

    Parameters
    ----------
    configuration
        Of any machine.

    Returns
    -------
    dict
        Name → NamedTuple: the plant's components side by side with the rest; none that is empty.
    """
    rest = {
        name: value
        for name, value in configuration._asdict().items()
        if name != "plant" and len(value)
    }
    return {**configuration.plant._asdict(), **rest}


def flatten(configuration: Configuration) -> dict[str, dict[str, float | str]]:
    """The settings as TOML and recordings hold them.

    Parameters
    ----------
    configuration
        Of any machine.

    Returns
    -------
    dict
        Group → name → number or label.
    """
    return {
        name: {
            key: value.label if isinstance(value, Choice) else float(value)
            for key, value in group._asdict().items()
        }
        for name, group in groups(configuration).items()
    }


def parameters(configuration: Configuration) -> Iterator[tuple[str, Any, Quantity | type[Choice]]]:
    """(key, value, what it means) of every setting."""
    for name, group in groups(configuration).items():
        for key, meaning in fields(type(group)).items():
            yield f"{name}.{key}", getattr(group, key), meaning
