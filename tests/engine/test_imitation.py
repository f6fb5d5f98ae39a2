"""An effect in the place of another, while the effects that are kept adapt themselves."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rigtwin.components import RigPlant, find
from rigtwin.diagnosis.imitation import Imitator
from rigtwin.numerics.arrays import Array
from tests.engine.linear import no_tolerances

PLANT = RigPlant()
KEPT, LOST, OTHER = (find(f"{kind}@rail", PLANT) for kind in ("coulomb", "viscous", "asymmetry"))
SIZE = 40


def column(phase: float) -> Array:
    return np.sin(np.arange(SIZE) + phase)


def imitate(response: Array) -> tuple[Any, Any]:
    """Imitate the viscous friction of a linear fit by an effect of a given response."""
    first, second = column(0.0), np.cos(3.0 * np.arange(SIZE))

    def residual(plant: RigPlant) -> Array:
        rail = plant.rail
        explained = (rail.coulomb - 50.0) * first + rail.viscous * second
        return 3.0 * first + 2.0 * second - explained - rail.asymmetry * response

    fit: Any = SimpleNamespace(effects=(KEPT, LOST), values=((53.0,), (2.0,)))
    fitter: Any = SimpleNamespace(
        plant=PLANT,
        space=no_tolerances(SIZE),
        evidence=SimpleNamespace(residual=residual),
        responses_beside=lambda candidate, fit: [((1.0,), response)],
        scale_start=lambda candidate, start, share: ((share * start[0],),),
        bounds=lambda effects: (np.array([-1.5]), np.array([np.inf])),
    )
    linearised: Any = SimpleNamespace(
        columns_of=lambda effects: -first[:, None],
        move=lambda effects, moves: ((53.0 + moves[0],),),
    )
    imitator = Imitator(fitter, fit, linearised, [1], (2.0 * second,))
    return imitator, imitator.imitate(OTHER)


def test_what_the_kept_effect_takes_up_does_not_count_against_the_candidate():
    # The candidate responds as the lost effect does, and as 5 N of the kept one.
    response = np.cos(3.0 * np.arange(SIZE)) + 5.0 * column(0.0)
    imitator, imitation = imitate(response)
    assert imitation.cosine == pytest.approx(1.0)
    assert imitation.start == pytest.approx((2.0,))
    # 3 N − 2 · 5 N beside 50 N.
    assert imitation.beside == (pytest.approx((43.0,)),)
    assert imitator.place_beside(imitation) == imitation.beside


def test_an_opposed_response_imitates_nothing():
    _, imitation = imitate(-np.cos(3.0 * np.arange(SIZE)))
    assert imitation.cosine == 0.0
    # A start of −2 would be below the effect's range.
    assert imitation.start == (-1.5,)


def test_the_kept_effect_stays_where_moving_it_fits_worse():
    imitator, imitation = imitate(np.cos(3.0 * np.arange(SIZE)))
    far = type(imitation)(imitation.cosine, OTHER, imitation.start, ((90.0,),))
    assert imitator.place_beside(far) == ((53.0,),)
