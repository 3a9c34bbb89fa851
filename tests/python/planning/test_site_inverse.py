"""Inverse Jacobians of sites: the equation, sites that are measured from others, and an arm that reaches by them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from test_dynamics import WALKER

import tightloop as tl
from conftest import URDF

Array = NDArray[np.float64]
WORLDS = 5
# Centres of mass of the walker's links in their frames [m]
CENTERS = {"trunk": (0.1, 0.0, 0.02), "leg": (0.0, 0.03, -0.2), "foot": (0.0, 0.0, -0.1)}
PRECISIONS = pytest.mark.parametrize("precision", ["f64", "f32"])


def matrix(quat: Array) -> Array:
    """Rotation of a quaternion (x, y, z, w)."""
    x, y, z, w = quat
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * (w * skew + skew @ skew)


def turned(axis: tuple[float, float, float], angle: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn about a unit axis."""
    x, y, z = np.sin(angle / 2) * np.array(axis)
    return x, y, z, np.cos(angle / 2)


@pytest.fixture
def walkers(tmp_path: Path) -> tl.Scene:
    """One that floats and one that stands, far apart, with sites of every kind."""
    path = tmp_path / "walker.urdf"
    path.write_text(WALKER)
    scene = tl.Scene(dt=1e-3, substeps=1)
    scene.add_urdf(path, name="free", floating=True, pos=(0.3, 0.2, 0.7))
    scene.add_urdf(path, name="fixed", pos=(2.0, 1.0, 0.5), quat=turned((0.6, 0.0, 0.8), 1.1))
    tip = {"pos": (0.05, -0.1, 0.2), "quat": turned((0.0, 0.6, 0.8), 0.7)}
    scene.add_site(name="toe", body="free/foot", **tip)
    scene.add_site(name="knee", body="fixed/leg", **tip, damping=0.3)
    scene.add_site(name="toe_from_trunk", body="free/foot", relative_to="free/trunk", damping=0.1)
    scene.add_site(name="toe_from_base", body="fixed/foot", **tip, relative_to="fixed/trunk")
    scene.add_site(name="toe_from_toe", body="free/foot", **tip, relative_to="fixed/foot", damping=0.2)
    scene.add_site(name="camera", pos=(1.0, 2.0, 3.0), quat=turned((1.0, 0.0, 0.0), 0.4))
    scene.add_site(name="camera_from_knee", pos=(1.0, 2.0, 3.0), relative_to="knee", damping=0.02)
    scene.add_site(name="trunk_from_leg", body="free/trunk", relative_to="free/leg")
    return scene


def jacobian_at(sim: tl.Sim, frame: tl.Frame, world: int, link: str | None, point: Array) -> Array:
    """Velocity of a point that a link carries, then its angular velocity, ``(6, dofs)``, from those of its centre."""
    if link is None:
        return np.zeros((6, len(sim.dof_names)))
    body = sim.body_names.index(link)
    pose, rows = frame.body_q[world, body].astype(float), frame.body_jacobian[world, body].astype(float)
    center = pose[:3] + matrix(pose[3:]) @ CENTERS[link.split("/")[1]]
    return np.vstack([rows[:3] + np.cross(rows[3:].T, point - center).T, rows[3:]])


def site_jacobian(scene: tl.Scene, sim: tl.Sim, frame: tl.Frame, world: int, site: tl.Site) -> Array:
    """What takes ``joint_qd`` to ``site_qd`` of a site."""

    def place(link: str | None, pos: tuple[float, ...], quat: tuple[float, ...]) -> tuple[Array, Array]:
        if link is None:
            return np.array(pos), matrix(np.array(quat))
        pose = frame.body_q[world, sim.body_names.index(link)].astype(float)
        turn = matrix(pose[3:])
        return pose[:3] + turn @ pos, turn @ matrix(np.array(quat))

    point, _ = place(site.body, site.pos, site.quat)
    jacobian = jacobian_at(sim, frame, world, site.body, point)
    if site.relative_to is None:
        return jacobian
    other = scene.sites.get(site.relative_to)
    link = site.relative_to if other is None else other.body
    _, turn = place(link, *((0.0,) * 3, (0.0, 0.0, 0.0, 1.0)) if other is None else (other.pos, other.quat))
    jacobian = jacobian - jacobian_at(sim, frame, world, link, point)
    return np.vstack([turn.T @ jacobian[:3], turn.T @ jacobian[3:]])


@PRECISIONS
def test_it_is_the_damped_least_squares_inverse_of_what_body_jacobian_says(walkers, precision):
    fields = ("joint_q", "joint_qd", "body_q", "body_jacobian", "site_qd", "site_inverse_jacobian")
    random = np.random.default_rng(8)
    with tl.launch(walkers, worlds=WORLDS, precision=precision, fields=fields) as sim:
        q = random.normal(size=(WORLDS, len(sim.coord_names)))
        for first in [k for k, name in enumerate(sim.coord_names) if name.endswith(".qx")]:
            q[:, first : first + 4] /= np.linalg.norm(q[:, first : first + 4], axis=1, keepdims=True)
        frame = sim.write(joint_q=q, joint_qd=random.normal(size=(WORLDS, len(sim.dof_names))))
        assert frame.site_inverse_jacobian.shape == (WORLDS, len(sim.site_names), len(sim.dof_names), 6)
        assert frame.site_inverse_jacobian.dtype == frame.joint_q.dtype
        for world in range(WORLDS):
            for number, site in enumerate(walkers.sites.values()):
                jacobian = site_jacobian(walkers, sim, frame, world, site)
                velocity = jacobian @ frame.joint_qd[world].astype(float)
                close = 1e-12 if precision == "f64" else 1e-4
                np.testing.assert_allclose(velocity, frame.site_qd[world, number], atol=close * 10, rtol=0)
                square = jacobian @ jacobian.T + site.damping**2 * np.eye(6)
                expected = jacobian.T @ np.linalg.inv(square)
                found = frame.site_inverse_jacobian[world, number].astype(float)
                largest = np.abs(expected).max()
                # a solve multiplies the rounding of the numbers by the condition of the matrix
                limit = 1e-9 if precision == "f64" else 16 * np.finfo(np.float32).eps * np.linalg.cond(square)
                assert np.abs(found - expected).max() <= limit * largest, (site.name, world)
                still = ~np.abs(jacobian).max(axis=0).astype(bool)
                assert not found[still].any()
        moved = (frame.site_inverse_jacobian != 0).any(axis=(0, 3))
        own = {name: np.isin(np.arange(len(sim.dof_names)), np.r_[sim.dofs[name]]) for name in ("free", "fixed")}
        for name, dofs in {
            "toe": own["free"],
            "knee": own["fixed"] & (np.cumsum(own["fixed"]) <= 3),
            # what carries both moves neither against the other
            "toe_from_trunk": own["free"] & (np.cumsum(own["free"]) > 6),
            "toe_from_toe": own["free"] | own["fixed"],
            "camera": ~(own["free"] | own["fixed"]),
            "trunk_from_leg": own["free"] & (np.cumsum(own["free"]) > 6) & (np.cumsum(own["free"]) <= 9),
        }.items():
            assert np.array_equal(moved[sim.site_names.index(name)], dofs), name


@PRECISIONS
def test_an_arm_reaches_by_it(precision):
    # the target is where the site stands in another state, seen from the base, which stands askew
    scene = tl.Scene(dt=1 / 480, substeps=1)
    arm = scene.add_urdf(URDF, name="arm", pos=(0.5, -2.0, 0.3), quat=turned((0.6, 0.8, 0.0), 0.9))
    arm.joint_q = [0, 0, 0, -2.4, 0, 2.4, 0.8, 0.04, 0.04]
    scene.add_site(body=arm.link(arm.link_names[-1]), pos=(0.0, 0.0, 0.05), relative_to=arm.link(arm.link_names[0]))
    fields, worlds = ("joint_q", "site_q", "site_inverse_jacobian"), 20
    random = np.random.default_rng(3)
    with tl.launch(scene, worlds=worlds, precision=precision, fields=fields) as sim:
        start = np.array(sim.forward().joint_q, float)
        offset = np.hstack([random.uniform(-0.4, 0.4, (worlds, 7)), np.zeros((worlds, 2))])
        goal = np.array(sim.write(joint_q=start + offset).site_q[:, 0], float)
        frame, q = sim.write(joint_q=start), start
        far = np.abs(frame.site_q[:, 0, :3] - goal[:, :3]).max(axis=1)
        assert (far > 0.02).all()
        step = np.ones((worlds, 6))
        for _ in range(60):
            at = frame.site_q[:, 0].astype(float)
            turn = np.array([matrix(g) @ matrix(a).T for g, a in zip(goal[:, 3:], at[:, 3:], strict=True)])
            # twice the vector of the quaternion, near enough to a rotation vector where the turn is small
            vector = 0.5 * np.stack([turn[:, i, j] - turn[:, j, i] for i, j in ((2, 1), (0, 2), (1, 0))], axis=1)
            step = np.hstack([goal[:, :3] - at[:, :3], vector])
            q = q + np.einsum("wds,ws->wd", frame.site_inverse_jacobian[:, 0].astype(float), step)
            frame = sim.write(joint_q=q)
        left = np.abs(step).max()
        assert left < (1e-6 if precision == "f64" else 1e-5), left


@PRECISIONS
@pytest.mark.parametrize("damping", [0.2, 0.05, 0.01, 1e-3, 1e-4, 1e-6])
def test_where_the_arm_is_stretched_it_stays_within_its_bound(tmp_path, precision, damping):
    # no singular value of J⁺ is above 1 / 2λ. A chain of six that lies straight cannot move in two directions; it lies
    # askew, so that J Jᵀ has rounding everywhere, in which the λ² of f32 would be lost
    inertia = "<inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial>"
    links = "".join(f"<link name='l{k}'>{inertia}</link>" for k in range(7))
    joints = "".join(
        f"<joint name='j{k}' type='continuous'><parent link='l{k}'/><child link='l{k + 1}'/>"
        f"<origin xyz='{0.3 if k else 0} 0 0'/><axis xyz='0 {(k + 1) % 2} {k % 2}'/></joint>"
        for k in range(6)
    )
    (tmp_path / "chain.urdf").write_text(f"<robot name='chain'>{links}{joints}</robot>")
    scene, worlds = tl.Scene(dt=1e-3, substeps=1), 40
    random = np.random.default_rng(6)
    turns = random.normal(size=(8, 4))
    for number, turn in enumerate(turns):
        scene.add_urdf(tmp_path / "chain.urdf", name=f"r{number}", quat=tuple(turn / np.linalg.norm(turn)))
        scene.add_site(body=f"r{number}/l6", pos=(0.3, 0, 0), damping=damping)
    bent = random.choice([0.0, 1e-5, 1e-3, 0.1], (worlds, 1)) * random.uniform(0.5, 1.0, (worlds, 48))
    with tl.launch(scene, worlds=worlds, precision=precision, fields=("joint_q", "site_inverse_jacobian")) as sim:
        inverse = sim.write(joint_q=bent).site_inverse_jacobian.astype(float)
    assert np.isfinite(inverse).all()
    largest = np.linalg.norm(inverse, ord=2, axis=(2, 3)).max()
    assert largest <= 0.5 / damping * (1 + 1e-3)
    if precision == "f64":
        # some world is bent so that it nearly reaches the bound
        assert largest > 0.5 / damping * (0.5 if damping < 0.1 else 0.1)
