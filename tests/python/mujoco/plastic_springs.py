"""Models whose springs yield, and their steps in MuJoCo; versions before 4.0, which have none, are helped to them."""

from __future__ import annotations

import copy
from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from tightloop.mujoco import export
from tightloop.mujoco.texts import texts

#: Whether this MuJoCo has plastic springs.
IS_NATIVE = hasattr(mujoco.mjtState, "mjSTATE_PLASTIC")
_WIDTHS = {mujoco.mjtJoint.mjJNT_BALL: 4, mujoco.mjtJoint.mjJNT_HINGE: 1, mujoco.mjtJoint.mjJNT_SLIDE: 1}


class Robot:
    """A model from MJCF; `yields` has what older versions of MuJoCo do not read, by kind and name."""

    def __init__(self, xml: str) -> None:
        self.yields: dict[tuple[str, str], float] = {}
        self.rests_of_keys: list[list[float]] = []
        if not IS_NATIVE:
            xml = self._strip(xml)
        self.model = mujoco.MjModel.from_xml_string(xml)

    def _strip(self, xml: str) -> str:
        root = ElementTree.fromstring(xml)
        for element in root.iter():
            bound = element.attrib.pop("springyield", None)
            if bound is not None:
                kind = "joint" if element.tag == "joint" else "tendon"
                self.yields[kind, element.attrib["name"]] = float(bound)
            if element.tag == "key":
                self.rests_of_keys.append([float(x) for x in element.attrib.pop("plastic", "").split()])
        return ElementTree.tostring(root, encoding="unicode")

    def bounds(self, kind: str, names: list[str]) -> NDArray[np.float64]:
        """Yield of each element; 0 where its spring is elastic."""
        return np.array([self.yields.get((kind, name), 0.0) for name in names])

    def add_to(self, found: dict[str, NDArray[Any]]) -> None:
        """Add what MuJoCo 4.0 has to the exported arrays of the model."""
        starts: list[float] = []
        for kind, prefix in (("joint", "jnt"), ("tendon", "tendon")):
            bounds = self.bounds(kind, texts(found[f"names.{kind}"]))
            places = np.full(len(bounds), -1, np.int32)
            for k in np.flatnonzero(bounds):
                places[k] = len(starts)
                starts += _rest(self.model, kind, int(k)).tolist()
            found[f"{prefix}_springyield"], found[f"{prefix}_plasticadr"] = bounds, places
        keys = [rests or starts for rests in self.rests_of_keys]
        found["key_plastic"] = np.array(keys, np.float64).reshape(len(keys), len(starts))

    def patch(self, monkeypatch: pytest.MonkeyPatch) -> mujoco.MjModel:
        """Let tightloop read the model as from MuJoCo 4.0, and return it."""
        if IS_NATIVE:
            return self.model
        original = export.arrays

        def arrays(model: Any) -> dict[str, NDArray[Any]]:
            found = original(model)
            if model is self.model:
                self.add_to(found)
            return found

        monkeypatch.setattr(export, "arrays", arrays)
        return self.model


def _rest(model: mujoco.MjModel, kind: str, k: int) -> NDArray[np.float64]:
    """Rest of a spring, a view."""
    if kind == "tendon":
        return model.tendon_lengthspring[k]
    first = model.jnt_qposadr[k]
    return model.qpos_spring[first : first + _WIDTHS[mujoco.mjtJoint(model.jnt_type[k])]]


class World:
    """A model of its own, and its data."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.model = robot, copy.deepcopy(robot.model)
        self.data, self._start = mujoco.MjData(self.model), mujoco.MjData(self.model)

    def rests(self) -> NDArray[np.float64]:
        """Rests of the springs that yield."""
        if IS_NATIVE:
            return self.data.plastic.copy()
        kinds = self._yielding()
        return np.concatenate([_rest(self.model, kind, k) for kind, k, _ in kinds])

    def step(self) -> None:
        """Make a step, by the rule of MuJoCo 4.0 where this one has none."""
        before, start = self.data.qpos.copy(), self._start
        start.qpos[:] = before
        for measure in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_tendon):
            measure(self.model, start)
        mujoco.mj_step(self.model, self.data)
        if IS_NATIVE:
            return
        velocity = self.data.qvel.copy()
        if self.model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            mujoco.mj_differentiatePos(self.model, velocity, self.model.opt.timestep, before, self.data.qpos)
        for kind, k, bound in self._yielding():
            rest = _rest(self.model, kind, k)
            if kind == "tendon":
                _move_rests(rest, self._next_length(k, velocity), bound)
            elif len(rest) == 1:
                q = self.data.qpos[self.model.jnt_qposadr[k]]
                rest[0] = np.clip(rest[0], q - bound, q + bound)
            else:
                first, turn = self.model.jnt_qposadr[k], np.empty(3)
                mujoco.mju_subQuat(turn, self.data.qpos[first : first + 4], rest)
                if (angle := np.linalg.norm(turn)) > bound:
                    mujoco.mju_quatIntegrate(rest, turn, (angle - bound) / angle)

    def _yielding(self) -> list[tuple[str, int, float]]:
        model, found = self.model, []
        names = {
            "joint": [model.joint(k).name for k in range(model.njnt)],
            "tendon": [model.tendon(k).name for k in range(model.ntendon)],
        }
        for kind, own in names.items():
            bounds = self.robot.bounds(kind, own)
            found += [(kind, int(k), float(bounds[k])) for k in np.flatnonzero(bounds)]
        return found

    def _next_length(self, k: int, velocity: NDArray[np.float64]) -> float:
        model, data, start = self.model, self.data, self._start
        first, count = model.tendon_adr[k], model.tendon_num[k]
        if model.wrap_type[first] == mujoco.mjtWrap.mjWRAP_JOINT:
            joints = model.wrap_objid[first : first + count]
            return float(model.wrap_prm[first : first + count] @ data.qpos[model.jnt_qposadr[joints]])
        entries = slice(model.ten_J_rowadr[k], model.ten_J_rowadr[k] + model.ten_J_rownnz[k])
        # on from where the step began
        rate = start.ten_J.ravel()[entries] @ velocity[model.ten_J_colind[entries]]
        return float(start.ten_length[k] + model.opt.timestep * rate)


def _move_rests(rests: NDArray[np.float64], length: float, bound: float) -> None:
    stretch = length - np.clip(length, *rests)
    beyond = stretch - np.clip(stretch, -bound, bound)
    is_rope = rests[0] == 0.0 and rests[1] > 0.0
    if not (is_rope and beyond > 0.0):
        rests[0] += beyond
    rests[1] += beyond
