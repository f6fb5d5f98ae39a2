"""Effects by name in the settings of a test, put in or taken out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rigtwin.components import candidates, find
from rigtwin.components.effect import Effect
from rigtwin.components.plant import Plant
from rigtwin.description.changes import override
from rigtwin.description.configuration import Configuration
from rigtwin.errors import RigtwinError


def with_effect(
    configuration: Configuration, effect: Effect, values: Mapping[str, float]
) -> Configuration:
    """The configuration with an effect.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    effect
        One that the plant can have.
    values
        Parameter → value.

    Returns
    -------
    Configuration
        With it.

    Raises
    ------
    RigtwinError
        For a value out of bounds.
    """
    return override(configuration, {effect.group: values})


def without_effect(configuration: Configuration, name: str) -> Configuration:
    """The configuration with an effect of the nominal machine taken out: its magnitude set to 0.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    name
        Such as `coulomb@rail`.

    Returns
    -------
    Configuration
        Without it.

    Raises
    ------
    RigtwinError
        If the machine has none of it to take out.
    """
    effect = find(name, configuration.plant)
    if not _is_removable(effect, configuration.plant):
        there = [
            each.name
            for each in candidates(configuration.plant)
            if _is_removable(each, configuration.plant)
        ]
        raise RigtwinError(
            f"cannot take out {name}: the twin has none of it; it has {', '.join(there) or 'none'}"
        )
    return with_effect(configuration, effect, {effect.kind.parameters[0]: 0.0})


def _is_removable(effect: Effect, plant: Plant) -> bool:
    parameter, quantity = next(iter(effect.quantities().items()))
    there = effect.nominal(plant)[parameter]
    return effect.searched and there not in (0.0, quantity.high) and quantity.low <= 0.0


def apply_effects(configuration: Configuration, texts: Sequence[str]) -> Configuration:
    """The configuration with effects as `--effect` takes them.

    Parameters
    ----------
    configuration
        To start from; it stays as it is.
    texts
        `coulomb@rail=80`, `stribeck@rail=20,stribeck_velocity=0.02`, or `setting@controller=kp:0.5`
        for a setting that is not what the recording will say.

    Returns
    -------
    Configuration
        With them.

    Raises
    ------
    RigtwinError
        Naming the effect and what is allowed.
    """
    for text in texts:
        name, equals, values = text.partition("=")
        if not equals:
            raise RigtwinError(
                f"effect {text}: expected KIND@COMPONENT=VALUE, such as coulomb@rail=80"
            )
        if name == "setting@controller":
            key, _, value = values.partition(":")
            configuration = override(configuration, {"controller": {key: value}})
            continue
        effect = find(name, configuration.plant)
        first, *more = values.split(",")
        changes: dict[str, object] = {effect.kind.parameters[0]: first}
        for item in more:
            key, _, value = item.partition("=")
            if key not in effect.kind.parameters:
                raise RigtwinError(
                    f"effect {text}: {effect.name} has "
                    f"{', '.join(effect.kind.parameters)}, not {key!r}"
                )
            changes[key] = value
        configuration = override(configuration, {effect.group: changes})
    return configuration
