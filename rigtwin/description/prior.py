"""Prior belief in a machine's nominal values, before any data are seen.

`nominal = "known"` or `"rough"` in a description chooses one of these priors. A diagnosis reads
their numbers alone, so that one method judges every machine.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf


@dataclass(frozen=True)
class ModelPrior:
    """Prior belief in a machine's nominal model.

    Parameters
    ----------
    word
        Word of the description that chooses this prior.
    even
        Share of the declared model error that is spread evenly over the fitted band, 0 to 1. The
        rest follows the signal's own spectrum, line by line.
    error
        Size of the discrepancy that the model may have without any single cause, as a share of a
        signal's standard deviation. A larger rest points to an effect that has no name.
    form
        Deviation of the library's laws from the forms that they have in the machine, as a share of
        the amplitude that they explain. A rare effect that explains less may only correct a form.
    scale
        Smallest standard error of a change, as a share of the change. Declared masses and gains,
        from which all forces and motions take their scale, are not exact.
    implausible_scale
        Ratio of a measured signal to its prediction, or its inverse, from which the unit of the
        recording is wrong rather than the gain of the machine.
    """

    word: str
    even: float
    error: float
    form: float
    scale: float
    implausible_scale: float


PRIORS: Mapping[str, ModelPrior] = {
    prior.word: prior
    for prior in (
        ModelPrior("known", 0.0, 0.02, 0.03, 0.0, 5.0),
        ModelPrior("rough", 1.0, 0.5, 0.14, 0.008, inf),
    )
}
"""Word of the description → prior."""
