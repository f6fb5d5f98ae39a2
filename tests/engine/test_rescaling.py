"""Hypotheses at other scales of all forces: the same motion, explained by fewer effects."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rigtwin.components import find
from rigtwin.components.plant import Plant
from rigtwin.description.document import load
from rigtwin.diagnosis.rescaling import start_rescaled
from tests.test_links import model

DESCRIPTION = '[machine]\nname = "arm"\nmodel = "arm.xml"\n\n[[replays]]\ntest = "servos"\n'
"""Arm with servos of 120 and 80 Nm/rad, 6 and 4 Nms/rad, and links of 1.2 and 0.8 kg."""
NAMES = [
    *(f"{kind}@{servo}" for kind in ("gains", "position_gain", "damping_gain") for servo in "ab"),
    "mass@upper",
    "mass@fore",
    "coulomb@shoulder",
    "delay@a",
]


@pytest.fixture
def plant(tmp_path: Path) -> Plant:
    text = model().replace('"m1"', '"a"').replace('"m2"', '"b"')
    (tmp_path / "arm.xml").write_text(text)
    (tmp_path / "arm.toml").write_text(DESCRIPTION)
    return load(tmp_path / "arm.toml").plant


def starts_from(plant: Plant, **values: float) -> list[dict[str, float]]:
    """Return the rescaled starts of a hypothesis; `kind_component` stands for `kind@component`."""
    effects = {name: find(name, plant) for name in NAMES}
    named = {name.replace("@", "_"): effect for name, effect in effects.items()}
    leader: Any = SimpleNamespace(
        effects=tuple(named[name] for name in values),
        values=tuple((value,) for value in values.values()),
    )
    starts = start_rescaled(plant, leader, list(effects.values()))
    return [
        {str(effect.name): value for effect, (value,) in zip(*start, strict=True)}
        for start in starts
    ]


def test_a_gain_and_the_masses_are_the_damping_of_another_scale(plant: Plant):
    """120 a, 1.2 a, 80 a, 4 a, 0.8 a and F a move as 6/a and F do."""
    factor = 0.8
    (start,) = [
        start
        for start in starts_from(
            plant,
            position_gain_a=120.0 * factor,
            gains_b=factor,
            mass_upper=1.2 * factor,
            mass_fore=0.8 * factor,
            coulomb_shoulder=0.5 * factor,
            delay_a=0.01,
        )
        if len(start) == 3
    ][:1]
    assert start == pytest.approx(
        {"delay@a": 0.01, "damping_gain@a": 6.0 / factor, "coulomb@shoulder": 0.5}
    )


def test_heavy_links_are_weak_servos(plant: Plant):
    starts = starts_from(plant, mass_upper=1.2 / 0.7, mass_fore=0.8 / 0.7)
    assert any(start == pytest.approx({"gains@a": 0.7, "gains@b": 0.7}) for start in starts)


def test_a_factor_on_both_gains_is_multiplied_out(plant: Plant):
    starts = starts_from(plant, gains_a=1.2, position_gain_a=100.0)
    assert {"damping_gain@a": pytest.approx(7.2)} in starts


def test_what_has_no_scale_is_left_alone(plant: Plant):
    assert starts_from(plant, delay_a=0.01) == []


PUSHED = """
<mujoco>
  <worldbody>
    <body name="cart">
      <joint name="slider" type="slide" axis="1 0 0" damping="4" armature="0.5"/>
      <geom size="0.1" mass="2"/>
    </body>
  </worldbody>
  <actuator><motor name="drive" joint="slider"/></actuator>
</mujoco>
"""


def test_a_heavy_cart_with_much_friction_has_a_weak_drive(tmp_path: Path):
    """Mass, rotor and damping are those of the MJCF at the scale of a gain of 0.8."""
    (tmp_path / "cart.xml").write_text(PUSHED)
    (tmp_path / "cart.toml").write_text(
        '[machine]\nname = "cart"\nmodel = "cart.xml"\n\n[[replays]]\ntest = "force commands"\n'
    )
    plant = load(tmp_path / "cart.toml").plant
    names = ("mass@cart", "armature@slider_rotor", "viscous@slider", "stiffness@slider")
    effects = [find(name, plant) for name in (*names, "gain@drive", "gain@slider_position")]
    values = ((2.5,), (0.625,), (5.0,), (30.0,))
    leader: Any = SimpleNamespace(effects=tuple(effects[:4]), values=values)
    starts = [
        {str(effect.name): value for effect, (value,) in zip(*start, strict=True)}
        for start in start_rescaled(plant, leader, effects)
    ]
    expected = {"gain@drive": 0.8, "stiffness@slider": 24.0}
    assert any(start == pytest.approx(expected) for start in starts)
    assert not any("gain@slider_position" in start for start in starts)
