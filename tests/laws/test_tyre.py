"""A tyre: a compliant contact that only pushes, stiffer the further it is squeezed."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import RigPlant, Tyre
from rigtwin.components.tyre import tyre_force
from rigtwin.simulation.plant_forces import stiffness_ratio
from rigtwin.simulation.rig_contacts import contacts
from tests.laws.written import law_of

TYRES = [
    Tyre(),
    Tyre(80_000.0),
    Tyre(damping=600.0),
    Tyre(hardening=40.0),
    Tyre(60_000.0, hardening=25.0, hardening_power=2.0, damping=100.0),
    Tyre(hardening=-50.0, hardening_power=1.5),
]
DEFLECTION = np.array([-0.002, 0.0, 0.0005, 0.004, 0.01, 0.03, 0.004, 0.0005])
RATE = np.array([0.3, 0.3, 0.02, -0.05, 0.1, 0.0, -1.0, -0.3])


@law_of("stiffness", Tyre)
@law_of("damping", Tyre)
@law_of("hardening", Tyre)
@pytest.mark.parametrize("tyre", TYRES)
def test_a_tyre_is_a_hardening_spring_and_a_damper_that_only_push(tyre):
    """F = k δ (1 + c δ (δ/10 mm)^(p−1)) + d δ' while in contact, and never below zero."""
    for deflection, rate in zip(DEFLECTION, RATE, strict=True):
        force = 0.0
        if deflection > 0.0:
            power = (deflection / 0.01) ** (tyre.hardening_power - 1.0)
            slope = max(1.0 + tyre.hardening * deflection * power, 0.0)
            force = max(tyre.stiffness * slope * deflection + tyre.damping * rate, 0.0)
        found = tyre_force(tyre, np.array([deflection]), np.array([rate]))
        assert found == pytest.approx(force, abs=1e-9)


def test_the_nominal_tyre_pushes_with_50_newtons_per_millimetre():
    assert tyre_force(Tyre(), np.array([0.001]), np.array([0.5]))[0] == pytest.approx(50.0)


def test_a_tyre_that_softens_to_nothing_pushes_no_more():
    soft = Tyre(hardening=-50.0)
    assert tyre_force(soft, np.array([0.01, 0.03]), np.zeros(2)) == pytest.approx([250.0, 0.0])


@law_of("hardening", Tyre)
@pytest.mark.parametrize("tyre", TYRES)
def test_the_running_rig_has_the_same_hardening(tyre):
    now = contacts(RigPlant(tyre=tyre), 0.0, 0.0, 0.0)
    for deflection in DEFLECTION:
        beyond = max(deflection, 0.0)
        power = (beyond / 0.01) ** (tyre.hardening_power - 1.0)
        expected = max(1.0 + tyre.hardening * beyond * power, 0.0)
        assert stiffness_ratio(now, float(deflection)) == pytest.approx(expected)
