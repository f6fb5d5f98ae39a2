"""Vehicles on the rig as it runs, plain and compensated."""

from __future__ import annotations

import numpy as np
import pytest

import rigtwin
from benchmarks.vehicles import configure, run, silent, smooth_rail
from experiments.vehicles import VEHICLES, configuration, find_vehicle
from rigtwin.cli import main
from rigtwin.errors import RigtwinError
from rigtwin.studies.stability.compensated import with_cylinder_delay
from rigtwin.studies.stability.mapping import Axis, around, stability_map
from rigtwin.studies.stability.sampled_loop import decay
from rigtwin.studies.stability.tested import (
    configure_vehicle,
    decay_compensated,
    decay_plain,
    set_for_compensation,
)


@pytest.mark.parametrize("name", VEHICLES)
def test_every_vehicle_of_table_6_1_is_unstable_plain_and_stable_compensated(name: str) -> None:
    margin = rigtwin.rig_margin(name)
    assert margin.plain == pytest.approx(decay(configuration(VEHICLES[name])), rel=1e-12)
    assert margin.plain < 0.0 < margin.compensated
    assert margin.delay_margin is not None
    assert margin.delay_margin > 2.5e-3


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("assumed", [0.5, 1.5])
def test_a_delay_of_5_ms_may_be_told_wrong_by_half(name: str, assumed: float) -> None:
    late = with_cylinder_delay(set_for_compensation(configure_vehicle(find_vehicle(name))), 5e-3)
    controller = late.controller._replace(plate_delay=assumed * 5e-3)
    assert decay(late._replace(controller=controller)) > 0.0


def test_what_a_loop_bears_is_where_it_turns_unstable() -> None:
    truck, margin = find_vehicle("truck"), rigtwin.rig_margin("truck")
    assert margin.delay_margin is not None
    assert decay_compensated(truck, margin.delay_margin - 2e-4) > 0.0
    assert decay_compensated(truck, margin.delay_margin + 2e-4) < 0.0


def test_a_map_of_the_rig_as_it_runs_has_its_decay() -> None:
    car = find_vehicle("quarter-car")
    across, up = (
        Axis("sprung_mass", np.array([50.0, 200.0])),
        around("suspension_stiffness", car, 0.01, 2),
    )
    for model, judge in (("sampled", decay_plain), ("compensated", decay_compensated)):
        stability = stability_map(model, car, 0.01, across, up)
        heavy = car._replace(sprung_mass=200.0, suspension_stiffness=float(up.values[0]))
        assert stability.rightmost[0, 1] == pytest.approx(-judge(heavy), rel=1e-9)
    with pytest.raises(RigtwinError, match="the model has the rig's own lags"):
        stability_map("sampled", car, 0.01, around("tau", car, 0.01, 2), up)


def test_the_command_counts_the_compensator_in(capsys) -> None:
    assert main(["stability", "--vehicle", "truck"]) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    assert line.startswith("the rig as it runs: slowest motion +2.3 1/s plain, -0.28 1/s with")
    assert "stable with 6.7 ms more delay than it is told of" in line
    assert main(["stability", "--set", "suspension_stiffness=1e8"]) == 0
    assert "unstable with that too" in capsys.readouterr().out


def test_other_compensators_are_judged_too(capsys) -> None:
    """What knows one delay alone does not carry a truck; docs/compensation.md has the table."""
    for name in ("none", "forward-prediction", "lag"):
        assert rigtwin.rig_margin("truck", compensator=name).compensated < 0.0
    assert rigtwin.rig_margin("motorcycle", compensator="lag").compensated > 0.0
    assert main(["stability", "--vehicle", "truck", "--compensator", "lag"]) == 0
    assert "unstable with that too" in capsys.readouterr().out
    with pytest.raises(RigtwinError, match="compensator 'smith' is not one of none, forward"):
        rigtwin.rig_margin("truck", compensator="smith")


@pytest.mark.slow
@pytest.mark.parametrize("name", VEHICLES)
def test_on_a_road_the_plate_is_where_the_ideal_vehicle_s_body_is(name: str) -> None:
    settings = configure(name, "road10")
    assert not run(settings, "road10", compensated=False).position < 1.0
    assert run(settings, "road10", compensated=True).position < 0.04
    clean = settings._replace(plant=smooth_rail(silent(settings.plant)))
    residual = run(clean, "road10", compensated=True)
    assert residual.position < 0.03
    assert residual.force < 0.05
