"""Rigid bodies of an MJCF in the coordinates of the joints that move, by MuJoCo.

They give the inertia matrix M(q) and the bias c(q, q'), that is gravity, Coriolis and centrifugal
forces less passive ones, of the equation of motion M·q'' + c = τ.

A joint that an equality ties to a coordinate moves with it. All other joints stay where the MJCF
has them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from pathlib import Path

import mujoco
import numpy as np

from rigtwin.description.component import Component
from rigtwin.description.mechanism import Mechanism, compile_model
from rigtwin.models.bodies import Bodies, arrange_moments, find_terms
from rigtwin.models.rigid import list_nominal, rest_of, strip
from rigtwin.numerics.arrays import Array

UNCHANGED = 1e-9
"""Relative variation below which inertia matrix and bias count as constant."""
PLACES = 5
"""Random states at which that is tested."""
LEAST = 1e-12
"""Smallest mass, kg, and moment of inertia, kg m², of a body: MuJoCo refuses 1e-15 and less."""


class Multibody:
    """Rigid bodies without the friction, springs and rotors that components describe.

    Contacts, joint limits and actuators of the MJCF are switched off.

    Parameters
    ----------
    path
        MJCF of the machine.
    joints
        Joints whose positions are the coordinates.
    guides, rotors
        Components whose friction, springs and inertia are modelled elsewhere.

    Raises
    ------
    RigtwinError
        If the MJCF cannot be read.
    """

    def __init__(
        self,
        path: Path,
        joints: Sequence[str],
        guides: Sequence[Component],
        rotors: Sequence[Component],
    ) -> None:
        self._path, self._guides, self._rotors = path, guides, rotors
        mechanism = Mechanism(path)
        self._model = self._prepare(mechanism.model)
        names = list(joints)
        ties, base = np.eye(len(joints)), np.zeros(len(joints))
        # A tied joint moves by ratio · coordinate + offset; chains come in the order of dependence.
        for tie in mechanism.ties_of(joints)[0]:
            place = names.index(tie.to)
            ties = np.vstack([ties, tie.ratio * ties[place]])
            base = np.append(base, tie.offset + tie.ratio * base[place])
            names.append(tie.joint)
        self._ties, self._from, self._tied = ties, base, names
        self._numbers = [mechanism.number("joint", name) for name in names]
        self.coordinates = len(joints)
        self._remember_terms()

    def express(self, acts_on: Sequence[tuple[str, float]]) -> Array:
        """Return the direction of a component in the coordinates, shape (coordinates,).

        `acts_on` lists joints and coefficients, as a fixed tendon does.
        """
        direction = np.zeros(self.coordinates)
        for joint, coefficient in acts_on:
            if joint in self._tied:
                direction += coefficient * self._ties[self._tied.index(joint)]
        return direction

    def measure(self, acts_on: Sequence[tuple[str, float]]) -> float:
        """Return the position of a component at zero coordinates, m or rad."""
        position = 0.0
        for joint, coefficient in acts_on:
            if joint in self._tied:
                position += coefficient * float(self._from[self._tied.index(joint)])
            else:
                number = self._model.joint(joint).id
                position += coefficient * float(self._model.qpos0[self._model.jnt_qposadr[number]])
        return position

    def rest_of(self, component: Component) -> float:
        """Return the position at which the spring of a joint or tendon is slack, m or rad."""
        return rest_of(self._model, component)

    def place(self) -> Array:
        """Return the positions of the coordinates in the MJCF, m or rad, shape (coordinates,)."""
        at = self._model.jnt_qposadr[self._numbers[: self.coordinates]]
        return np.array(self._model.qpos0[at])

    def list_nominal(self, name: str) -> tuple[float, Array, Array]:
        """Return mass, centre of mass and inertia of a body in the MJCF; see `rigid`."""
        return list_nominal(self._model, name)

    def change(
        self, parameters: Mapping[str, Array], gravity: Callable[[Array], Array] | None
    ) -> Multibody:
        """Return a copy with changed bodies or gravity.

        Parameters
        ----------
        parameters
            Body → its ten inertial parameters, as in `components.body.INERTIAL`, shape (10,).
        gravity
            Function that turns gravity, m/s², shape (3,); None to leave it as it is.

        Returns
        -------
        Multibody
            Bodies with these parameters.
        """

        turned = np.empty(4)

        def alter(spec: mujoco.MjSpec) -> None:
            for name, (mass, mx, my, mz, *moments) in parameters.items():
                mass = max(mass, LEAST)
                body, centre = spec.body(name), np.array([mx, my, mz]) / mass
                # MuJoCo wants principal moments about the centre of mass: parallel axes, then
                # eigenvalues, with axes that form a right-handed frame.
                shifted = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
                about = arrange_moments(moments) - shifted
                principal, axes = np.linalg.eigh(about)
                axes[:, 2] *= np.linalg.det(axes)
                mujoco.mju_mat2Quat(turned, np.ascontiguousarray(axes).ravel())
                body.explicitinertial = True
                body.mass, body.ipos, body.iquat = mass, centre, turned
                # Rounding may leave a moment of zero slightly negative, which MuJoCo refuses.
                body.inertia = np.maximum(principal, LEAST)
                body.fullinertia = np.full(6, np.nan)
            if gravity is not None:
                spec.option.gravity = gravity(np.array(spec.option.gravity))

        changed = copy(self)
        changed._model = self._prepare(compile_model(self._path, alter))
        changed._remember_terms()
        return changed

    def scale(self, shares: Mapping[str, float]) -> Multibody:
        """Return a copy with scaled masses.

        `shares` maps a joint to the factor on mass and inertia of all bodies that it carries.
        """
        scaled = copy(self)
        scaled._model = model = copy(self._model)
        for joint, share in shares.items():
            carried = [int(model.jnt_bodyid[model.joint(joint).id])]
            for body in range(carried[0] + 1, model.nbody):
                if model.body_parentid[body] in carried:
                    carried.append(body)
            model.body_mass[carried] *= share
            model.body_inertia[carried] *= share
        mujoco.mj_setConst(model, mujoco.MjData(model))
        scaled._remember_terms()
        return scaled

    def _prepare(self, model: mujoco.MjModel) -> mujoco.MjModel:
        model.opt.disableflags |= (
            mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
        )
        strip(model, self._guides, self._rotors)
        # MuJoCo precomputes the inertia of simple bodies; it has to be told of the changes.
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model

    def _remember_terms(self) -> None:
        """Remember how MuJoCo stores the inertia matrix, and both terms if they are constant."""
        self._projection = self._project()
        random = np.random.default_rng(PLACES)
        size = self.coordinates
        self._steady: Array | None = None
        samples = []
        data = self.data()
        bodies = self.bodies(data)
        for _ in range(PLACES):
            inertia, bias = np.empty((size, size)), np.empty(size)
            place, speed = random.uniform(-1.0, 1.0, size), random.uniform(-1.0, 1.0, size)
            find_terms(bodies, place, speed, inertia, bias)
            samples.append(np.column_stack([inertia, bias]))
        spread = np.max(np.ptp(np.stack(samples), axis=0))
        if spread <= UNCHANGED * np.max(np.abs(samples[0])):
            self._steady = samples[0]

    def data(self) -> mujoco.MjData:
        """Return new MuJoCo data for these bodies, which one caller must not share with another."""
        return mujoco.MjData(self._model)

    def bodies(self, data: mujoco.MjData, added: Array | None = None) -> Bodies:
        """Return the bodies as compiled code takes them.

        Compiled code knows `data` by its address only: the caller keeps it alive. `added` is the
        inertia of rotors, kg, shape (coordinates, coordinates).
        """
        model, size, steady = self._model, self.coordinates, self._steady
        sources, targets, factors = self._projection
        return Bodies(
            model=model._address,
            data=data._address,
            places=np.array(model.jnt_qposadr[self._numbers], np.int64),
            dofs=np.array(model.jnt_dofadr[self._numbers], np.int64),
            ties=self._ties,
            base=self._from,
            qpos=data.qpos,
            qvel=data.qvel,
            bias=data.qfrc_bias,
            passive=data.qfrc_passive,
            entries=data.M,
            sources=sources,
            targets=targets,
            factors=factors,
            bias_address=data.qfrc_bias.ctypes.data,
            tendons=_tendons_act(model),
            added=np.zeros((size, size)) if added is None else added,
            steady=steady is not None,
            inertia=np.zeros((size, size)) if steady is None else steady[:, :-1].copy(),
            constant=np.zeros(size) if steady is None else steady[:, -1].copy(),
        )

    def _project(self) -> tuple[np.ndarray, np.ndarray, Array]:
        """Return how entries of MuJoCo's inertia matrix add up to the coordinates' matrix.

        These are the numbers of the entries, their places in the coordinates' matrix, shape
        (entries, 2), and their factors.
        """
        model, ties = self._model, self._ties
        joint_of = {int(model.jnt_dofadr[n]): joint for joint, n in enumerate(self._numbers)}
        sources, targets, factors = [], [], []
        for dof, joint in joint_of.items():
            start = model.M_rowadr[dof]
            for entry in range(start, start + model.M_rownnz[dof]):
                if (second := joint_of.get(int(model.M_colind[entry]))) is None:
                    continue
                products = np.outer(ties[joint], ties[second])
                # Only the lower triangle is stored: add the mirrored entry.
                if second != joint:
                    products = products + products.T
                for i, j in np.argwhere(products != 0.0):
                    sources.append(entry)
                    targets.append((int(i), int(j)))
                    factors.append(float(products[i, j]))
        places = np.array(targets, np.int64).reshape(-1, 2)
        return np.array(sources, np.int64), places, np.array(factors)


def _tendons_act(model: mujoco.MjModel) -> bool:
    """Return whether a tendon has a spring, damping or inertia that no component describes.

    `find_terms` then needs MuJoCo's complete position stage, which also looks for contacts and
    takes about three times as long as the parts that inertia and bias need.
    """
    coefficients = (
        model.tendon_stiffness,
        model.tendon_stiffnesspoly,
        model.tendon_damping,
        model.tendon_dampingpoly,
        model.tendon_armature,
    )
    return any(np.any(each) for each in coefficients)
