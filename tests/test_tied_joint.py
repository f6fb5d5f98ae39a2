"""A joint that is replayed alone, and carries along the joints that are tied to it."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigtwin.description.mechanism import Mechanism

LIFT = """
<mujoco>
  <worldbody>
    <body name="carriage">
      <joint name="lift" type="slide" axis="0 0 1" armature="7.5"/>
      <inertial pos="0 0 0" mass="46" diaginertia="1 1 1"/>
    </body>
    <body name="counterweight">
      <joint name="rope" type="slide" axis="0 0 1"/>
      <inertial pos="0 0 0" mass="38" diaginertia="1 1 1"/>
    </body>
  </worldbody>
  <equality><joint joint1="rope" joint2="lift" polycoef="0 {ratio} 0 0 0"/></equality>
</mujoco>
"""


@pytest.mark.parametrize("ratio", [-1.0, -0.5, 2.0])
def test_a_tied_joint_adds_its_inertia_and_weight(tmp_path: Path, ratio: float) -> None:
    """M = m + r^2 m_tied and G = (m + r m_tied) g, for q_tied = r q."""
    (tmp_path / "lift.xml").write_text(LIFT.format(ratio=ratio))
    joint = Mechanism(tmp_path / "lift.xml").joint("lift")
    assert joint.inertia == pytest.approx(46.0 + 7.5 + 38.0 * ratio**2)
    assert joint.gravity == pytest.approx([9.81 * (46.0 + 38.0 * ratio)] * len(joint.gravity))
