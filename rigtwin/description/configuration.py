"""All settings of one test of one machine.

Every machine uses the same type. A group that a machine lacks, such as the road, has no settings.
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
"""Largest number of ticks in a test: more than a day at 1 kHz."""


class Configuration(NamedTuple, Generic[P, C]):
    """All settings of one test of one machine. The defaults are those of the nominal rig.

    A setting's key is `group.name`, such as `rail.coulomb`, `controller.kp`, `timing.duration`.

    Attributes
    ----------
    plant
        NamedTuple of the machine's components.
    controller
        NamedTuple of the controller's settings.
    safety
        Limits that end a test.
    timing
        Duration, control period and integration step.
    road
        Spectrum of the pseudo-random road.
    """

    plant: P = RigPlant()  # type: ignore[assignment]
    controller: C = Settings()  # type: ignore[assignment]
    safety: Safety = Safety()
    timing: Timing = Timing()
    road: Road = Road()

    @property
    def substeps(self) -> int:
        """Integration steps per tick. Raises RigtwinError unless the period is a whole multiple of
        the timestep."""
        # Decimal periods are no exact multiples in binary, hence the tolerance of 1e-6.
        ratio = self.timing.period / self.timing.timestep
        if ratio < 0.999 or abs(ratio - round(ratio)) > 1e-6:
            raise RigtwinError(
                f"timing.period = {self.timing.period:g} s must be a whole multiple of "
                f"timing.timestep = {self.timing.timestep:g} s; here it is {ratio:.4g} times"
            )
        return round(ratio)

    @property
    def ticks(self) -> int:
        """Number of ticks of the test, at least one. Raises RigtwinError above `MOST_TICKS`, which
        would not fit into memory."""
        ticks = max(1, round(self.timing.duration / self.timing.period))
        if ticks > MOST_TICKS:
            raise RigtwinError(
                f"timing.duration / timing.period = {ticks} ticks: expected at most {MOST_TICKS}"
            )
        return ticks


def groups(configuration: Configuration) -> dict[str, Any]:
    """Return the groups of settings.

    Parameters
    ----------
    configuration
        Configuration of any machine.

    Returns
    -------
    dict
        Group name → NamedTuple. The plant's components stand beside the other groups; groups
        without settings are omitted.
    """
    rest = {
        name: value
        for name, value in configuration._asdict().items()
        if name != "plant" and len(value)
    }
    return {**configuration.plant._asdict(), **rest}


def flatten(configuration: Configuration) -> dict[str, dict[str, float | str]]:
    """Return the settings as TOML files and recordings store them.

    Parameters
    ----------
    configuration
        Configuration of any machine.

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
    """Yield key, value and allowed values of every setting."""
    for name, group in groups(configuration).items():
        values = group._asdict()
        for key, meaning in fields(type(group)).items():
            yield f"{name}.{key}", values[key], meaning
