"""Inertia matrix and bias of rigid bodies, against MuJoCo's own stages, and arrays of records."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from rigtwin.components.dry_friction import Friction
from rigtwin.models.bodies import find_terms
from rigtwin.models.multibody import Multibody
from rigtwin.numerics.arrays import to_records

ARM = """
<mujoco>
  <option density="1.2" viscosity="0.02"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" stiffness="3" damping="0.2" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0 0.1 -0.4" size="0.03" mass="1.5"/>
      <body name="fore" pos="0 0.1 -0.4" gravcomp="0.5">
        <joint name="elbow" axis="1 0.2 0"/>
        <geom type="capsule" fromto="0 0 0 0 0 -0.3" size="0.02" mass="0.8"/>
        <body name="hand" pos="0 0 -0.3">
          <joint name="wrist" axis="0 0 1" type="hinge"/>
          <geom type="box" size="0.05 0.02 0.08" mass="0.3"/>
        </body>
      </body>
    </body>
  </worldbody>
  {tendon}
  <equality><joint joint1="wrist" joint2="elbow" polycoef="0.1 -1.5 0 0 0"/></equality>
</mujoco>
"""
TENDON = """
  <tendon>
    <fixed name="cable" {acts}>
      <joint joint="shoulder" coef="1"/><joint joint="elbow" coef="-0.5"/>
    </fixed>
  </tendon>
"""


@pytest.mark.parametrize("acts", [None, "", 'stiffness="7"', 'damping="0 0.3"', 'armature="0.1"'])
def test_inertia_and_bias_are_those_of_mujoco(tmp_path: Path, acts: str | None) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM.format(tendon="" if acts is None else TENDON.format(acts=acts)))
    bodies = Multibody(path, ["shoulder", "elbow"], [], [])
    data = bodies.data()
    compiled = bodies.bodies(data)
    # A tendon without any force of its own is not computed at all.
    assert compiled.tendons == bool(acts)
    model = mujoco.MjModel.from_xml_path(str(path))
    reference = mujoco.MjData(model)
    # The wrist turns by 0.1 rad − 1.5 times the elbow.
    ties = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, -1.5]])
    random = np.random.default_rng(3)
    for _ in range(5):
        place, speed = random.uniform(-2.0, 2.0, 2), random.uniform(-3.0, 3.0, 2)
        inertia, bias = np.empty((2, 2)), np.empty(2)
        find_terms(compiled, place, speed, inertia, bias)
        reference.qpos[:], reference.qvel[:] = ties @ place + [0.0, 0.0, 0.1], ties @ speed
        mujoco.mj_forward(model, reference)
        full = np.empty((3, 3))
        mujoco.mj_fullM(model, reference, full)
        force = reference.qfrc_bias - reference.qfrc_passive
        assert inertia == pytest.approx(ties.T @ full @ ties, rel=1e-12)
        assert bias == pytest.approx(ties.T @ force, rel=1e-12, abs=1e-12)


def test_records_keep_fields_and_types() -> None:
    rubbing = Friction(True, 1.0, 0.2, 0.01, 2.0, 0.0, 0.1, 0.0)
    records = to_records(Friction, [rubbing, rubbing._replace(changing=False, coulomb=3.0)])
    assert records.shape == (2,)
    assert records["changing"].tolist() == [True, False]
    assert records["coulomb"].tolist() == [1.0, 3.0]
    assert to_records(Friction, []).dtype == records.dtype
