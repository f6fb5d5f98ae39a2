"""Effects added to, or removed from, the settings of a test by their name."""

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
    """Return a configuration with an effect.

    Parameters
    ----------
    configuration
        Configuration to start from; it is not modified.
    effect
        Effect that the plant can have.
    values
        Parameter → value, in the parameter's unit.

    Returns
    -------
    Configuration
        Copy with the effect.

    Raises
    ------
    RigtwinError
        For a value out of bounds.
    """
    return override(configuration, {effect.group: values})


def without_effect(configuration: Configuration, name: str) -> Configuration:
    """Return a configuration without an effect of the nominal machine: its magnitude is 0.

    Parameters
    ----------
    configuration
        Configuration to start from; it is not modified.
    name
        Name of the effect, such as `coulomb@rail`.

    Returns
    -------
    Configuration
        Copy without the effect.

    Raises
    ------
    RigtwinError
        If the machine does not have the effect.
    """
    effect = find(name, configuration.plant)
    if not _is_removable(effect, configuration.plant):
        removable = [
            candidate.name
            for candidate in candidates(configuration.plant)
            if _is_removable(candidate, configuration.plant)
        ]
        raise RigtwinError(
            f"cannot take out {name}: the twin has none of it; "
            f"it has {', '.join(removable) or 'none'}"
        )
    return with_effect(configuration, effect, {effect.kind.parameters[0]: 0.0})


def _is_removable(effect: Effect, plant: Plant) -> bool:
    """Return whether a magnitude of 0 means that the effect is absent, and the plant has it."""
    parameter, quantity = next(iter(effect.quantities().items()))
    magnitude = effect.nominal(plant)[parameter]
    # A limit, such as of saturation, is absent at its upper bound rather than at 0.
    return effect.searched and magnitude not in (0.0, quantity.high) and quantity.low <= 0.0


def apply_effects(configuration: Configuration, texts: Sequence[str]) -> Configuration:
    """Return a configuration with effects as `--effect` takes them.

    Parameters
    ----------
    configuration
        Configuration to start from; it is not modified.
    texts
        Effects such as `coulomb@rail=80` or `stribeck@rail=20,stribeck_velocity=0.02`. The text
        `setting@controller=kp:0.5` changes a setting of the controller without storing it in the
        recording.

    Returns
    -------
    Configuration
        Copy with the effects.

    Raises
    ------
    RigtwinError
        For an unknown effect, parameter or value. The message names what is allowed.
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
