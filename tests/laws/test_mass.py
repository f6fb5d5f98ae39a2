"""The mass of a described joint, and the rotor that turns with it but has no weight."""

from __future__ import annotations

import numpy as np
import pytest

from rigtwin.components import Guide, Mass, Rotor
from tests.helpers.described import TOML, described, recording_of
from tests.laws.written import law_of

PERIOD = 1e-3
TIME = PERIOD * np.arange(500)
ROTOR = '[components.rotor]\njoint = "axis"\ntype = "rotor"\n\n[components.drive]'


@law_of("mass", Mass)
@law_of("armature", Rotor)
@pytest.mark.parametrize(("mass", "rotor"), [(None, 0.0), (5.0, 0.0), (2.0, 1.5)])
def test_a_pushed_joint_accelerates_its_mass_and_its_rotor(tmp_path, mass, rotor):
    """x = F t²/(2 (m + J)); the MJCF's mass is 2 kg."""
    machine = described(tmp_path, toml=TOML.replace("[components.drive]", ROTOR))
    plant = machine.plant._replace(guide=Guide(), rotor=Rotor(rotor))
    if mass is not None:
        plant = plant._replace(mass=Mass(mass))
    recording = recording_of(machine, np.full(len(TIME), 6.0), np.zeros(len(TIME)))
    model = machine.physics.model(
        machine, recording.inputs, machine.configuration._replace(plant=plant), 4
    )
    expected = 0.5 * 6.0 / ((mass or 2.0) + rotor) * TIME**2
    np.testing.assert_allclose(model.predict(plant)[0], expected, atol=2e-3 * expected[-1])


def test_a_mass_and_a_rotor_are_none_unless_described():
    assert Mass().mass == 0.0
    assert Rotor().inertia == 0.0
