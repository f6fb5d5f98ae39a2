"""Controllers against the equations of the thesis, and Python against compiled."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from controllers import (
    SIZE,
    Commands,
    Compensator,
    Demand,
    Measurements,
    Mode,
    Settings,
    Skyhook,
    Structure,
    Travel,
    controller,
    initial_state,
    packed,
    unpacked,
    update,
)
from controllers.filters import low_pass
from controllers.force import MOTOR_CONSTANT, force_loop
from controllers.skyhook import semi_active_damping
from tests.helpers.recordings import beginning, rig_recording

PERIOD = 1e-3
EVERY = [
    Settings(mode=mode, travel=travel, skyhook=skyhook, skyhook_damping=200.0, voltage_limit=limit)
    for mode, travel, skyhook, limit in itertools.product(Mode, Travel, Skyhook, (10.0, 1.2))
]
EVERY += [
    Settings(structure=structure, compensator=one)
    for structure, one in itertools.product(Structure, Compensator)
]


def stream(count: int) -> list[tuple[Measurements, Demand]]:
    """Measurements and demands of the size that the rig sees."""
    random = np.random.default_rng(7)
    walk = np.cumsum(random.standard_normal((count, 3)), axis=0) * 1e-4
    force = 220 + 40 * random.standard_normal(count)
    demand = np.cumsum(random.standard_normal((count, 2)), axis=0) * 1e-4
    return [
        (Measurements(w[0], w[1], w[2], f), Demand(d[0], d[1], 230.0 + f * 0.1))
        for w, f, d in zip(walk.tolist(), force.tolist(), demand.tolist(), strict=True)
    ]


@numba.njit
def compiled_update(controlling, state, measured, demand):  # type: ignore[no-untyped-def]
    return update(controlling, unpacked(packed(state), state.plate), measured, demand)


@pytest.mark.parametrize(
    "settings",
    EVERY,
    ids=lambda s: "-".join(
        f"{v.label if hasattr(v, 'label') else v}" for v in (*s[:4], s.skyhook, s.voltage_limit)
    ),
)
def test_python_and_compiled_agree(settings):
    controlling = controller(settings, PERIOD)
    plain = fast = initial_state(controlling)
    one = None
    for measured, demand in stream(100):
        plain, one = update(controlling, plain, measured, demand)
        fast, other = compiled_update(controlling, fast, measured, demand)
        # Modal coordinates of the structure grow without bound under such forces: compared to their
        # size.
        assert np.max(np.abs(np.subtract(one, other)) / np.maximum(1.0, np.abs(one))) < 1e-12
    assert isinstance(one, Commands)


def test_a_packed_state_unpacks_to_itself():
    controlling = controller(
        Settings(structure=Structure.BEAM, compensator=Compensator.TWO_STEP), PERIOD
    )
    state = initial_state(controlling)
    for measured, demand in stream(60):
        state, _ = update(controlling, state, measured, demand)
    assert len(packed(state)) == SIZE
    assert unpacked(packed(state), state.plate)[:-1] == state[:-1]


def test_controllers_know_nothing_of_the_twin():
    code = (
        "import controllers, sys; assert not {'mujoco', 'rigtwin'} "
        "& set(sys.modules), sorted(sys.modules)"
    )
    root = Path(__file__).parents[1]
    assert subprocess.run([sys.executable, "-c", code], cwd=root, check=False).returncode == 0


def test_low_pass_is_backward_euler():
    assert low_pass(1.0, 3.0, 0.01, 0.001) == pytest.approx(1.0 + 0.001 / 0.011 * 2.0)
    assert low_pass(1.0, 3.0, 0.0, 0.001) == 3.0


def test_integral_is_held_at_the_voltage_limit():
    settings = Settings(voltage_limit=1.0)
    integral, voltage = force_loop(settings, 5.0, 1000.0, 0.0, 0.0, PERIOD)
    assert (integral, voltage) == (5.0, 1.0)
    integral, voltage = force_loop(settings, 0.0, 100.0, 90.0, 20.0, PERIOD)
    assert integral == pytest.approx(10.0 * 10.0 * PERIOD)
    assert voltage == pytest.approx((100.0 + 0.3 * 10.0 + integral + 20.0) / MOTOR_CONSTANT)


def test_semi_active_damper_only_dissipates():
    settings = Settings(skyhook=Skyhook.SEMI_ACTIVE, skyhook_damping=200.0)
    for sprung, travel in itertools.product(np.linspace(-1, 1, 21), repeat=2):
        damping = semi_active_damping(settings, sprung, travel)
        assert settings.damping_min <= damping <= settings.damping_max
        if sprung * travel <= 0:
            assert damping == settings.damping_min


def test_first_sample_sets_the_filters():
    controlling = controller(Settings(), PERIOD)
    state, commands = update(
        controlling, initial_state(controlling), Measurements(0, 0, -0.01, 210.0), Demand(0, 0, 0)
    )
    assert (state.travel, state.velocity, state.force) == (-0.01, 0.0, 210.0)
    assert commands.force == pytest.approx(200.0 + 10.0)
    assert commands.structure == pytest.approx(-0.004 + (210.0 / 25 - 9.81) * 1e-6)


@pytest.mark.parametrize("name", ["nominal-imposed", "nominal-road10", "nominal-drop"])
def test_commands_of_the_stand_in_rig_reproduce(name):
    recording = beginning(rig_recording(name), 8.0)
    settings = Settings(mode=Mode.parse(str(recording.controller["mode"])))
    columns = [recording.column("/sensor", field) for field in Measurements._fields]
    demands = [recording.column("/command", field) for field in Demand._fields]
    controlling = controller(settings, recording.period)
    state, commands = initial_state(controlling), []
    for row in range(recording.ticks):
        measured, demand = (
            Measurements(*(c[row] for c in columns)),
            Demand(*(d[row] for d in demands)),
        )
        state, command = update(controlling, state, measured, demand)
        commands.append(command)
    for number, field in enumerate(Commands._fields):
        recorded = recording.column("/command", field)
        assert np.max(np.abs(np.array(commands)[:, number] - recorded)) <= 2e-7 * max(
            1.0, np.max(np.abs(recorded))
        )
