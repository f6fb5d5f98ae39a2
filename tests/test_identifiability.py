"""What sensors can never show."""

from __future__ import annotations

from pathlib import Path

import pytest

import rigtwin
from rigtwin.cli import main

CART = """
<mujoco model="cart">
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="cart">
      <joint name="rail" type="slide" axis="1 0 0" range="-0.2 0.2" damping="4"/>
      <geom type="box" size="0.1 0.1 0.1" mass="2"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="rail" gear="5"/></actuator>
  <sensor><jointpos name="place" joint="rail"/></sensor>
</mujoco>
"""
TABLE = """
[machine]
name = "cart"
title = "a cart that is pushed"
model = "cart.xml"
nominal = "rough"

[components]
cart = { body = "cart" }
rail = { joint = "rail" }
push = { actuator = "push", command = "push" }
place = { sensor = "place", channel = "place", effects = [] }

[[replays]]
name = "cart"
moved_by = "push"
observe = ["place"]
"""


def cart(folder: Path) -> rigtwin.Machine:
    (folder / "cart.xml").write_text(CART)
    (folder / "cart.toml").write_text(TABLE)
    return rigtwin.machine(folder / "cart.toml")


@pytest.mark.slow
def test_two_zeros_and_a_gain_that_scales_all_there_is():
    machine = rigtwin.machine("damper-bench")
    can = rigtwin.identifiability(machine)
    assert can.confounded["offset@damper"] == ("offset@load_cell",)
    assert can.confounded["offset@load_cell"] == ("offset@damper",)
    # Force over velocity is all that a damper bench measures.
    assert set(can.confounded["gain@load_cell"]) == {"viscous@damper", "coulomb@damper"}
    assert {"viscous@damper", "coulomb@damper", "lag@load_cell"} <= set(can.seen)
    # Every effect that is looked for is judged once.
    judged = [*can.seen, *can.unseen, *can.confounded]
    assert sorted(judged) == sorted(effect.name for effect in machine.effects() if effect.searched)


def test_the_table_comes_before_what_takes_long(capsys, monkeypatch):
    monkeypatch.setattr("rigtwin.cli.machine.ALLOWED", 0.0)
    assert main(["machine", "check", "damper-bench"]) == 0
    out, err = capsys.readouterr()
    *_, done, untried = out.splitlines()
    assert done == "no mistakes"
    assert untried.startswith("not worked out within 0 s, --identifiability goes on: ")
    assert "viscous@damper" in untried
    # Off a terminal too something is said before the first result.
    assert err.startswith("working out what its sensors can show, 0 s: packages")


def test_effects_that_the_time_does_not_suffice_for_are_neither_seen_nor_unseen():
    machine = rigtwin.machine("damper-bench")
    stages: list[str] = []
    can = rigtwin.identifiability(machine, seconds=0.0, progress=stages.append)
    assert (can.seen, can.unseen, can.confounded) == ((), (), {})
    assert set(can.untried) == {e.name for e in rigtwin.effects(machine) if e.searched}
    assert stages[0] == "made-up motions"


@pytest.mark.slow
def test_a_mass_and_its_friction_scale_like_the_force_that_moves_them(tmp_path):
    can = rigtwin.identifiability(cart(tmp_path))
    assert set(can.confounded["gain@push"]) <= {"mass@cart", "viscous@rail", "coulomb@rail"}
    assert "viscous@rail" in can.seen
    assert not can.unseen


@pytest.mark.slow
def test_an_actuator_that_is_watched_directly_hides_nothing():
    can = rigtwin.identifiability(rigtwin.machine("position-actuator"))
    assert not can.unseen
    assert not can.confounded


def test_joints_that_act_on_each_other_are_moved_too():
    can = rigtwin.identifiability(rigtwin.machine("double-pendulum"))
    assert {"coulomb@shoulder", "coulomb@elbow", "gain@torque_1"} <= set(can.seen)
    assert not can.unseen


@pytest.mark.slow
def test_the_suspension_rig_can_show_all_that_is_looked_for():
    can = rigtwin.identifiability(rigtwin.machine("suspension-rig"))
    assert not can.unseen
    assert not can.confounded
