"""Rays against MuJoCo's ``mj_ray``, at the poses of a frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from live_model import live
from numpy.typing import NDArray
from random_mjcf import EVERYTHING, random_mjcf

import tightloop as tl
from tightloop import optional_imports
from tightloop.sim.rays import RayHits

Array = NDArray[Any]

# Distances are of the order of 1 m; a few roundings of a quadratic equation near its double root cost half the digits.
TOLERANCE = 1e-9
WORLDS, RAYS = 4, 200
POSES = {"body": ("body_q",), "geom": ("geom_xpos", "geom_xmat")}


def ball(rings: int = 24) -> str:
    """Return a mesh of a dented ball as attributes of ``<mesh>``."""
    height, turn = np.meshgrid(np.linspace(0.05, np.pi - 0.05, rings), np.linspace(0, 2 * np.pi, 2 * rings + 1)[:-1])
    radius = 0.3 + 0.05 * np.sin(5 * turn) * np.sin(height)
    points = radius[..., None] * np.stack(
        [np.sin(height) * np.cos(turn), np.sin(height) * np.sin(turn), np.cos(height)], axis=-1
    )
    place = np.arange(height.size).reshape(height.shape)
    a, b = place[:, :-1], np.roll(place, -1, axis=0)[:, :-1]
    faces = np.concatenate([np.stack([a, a + 1, b], -1).reshape(-1, 3), np.stack([b, a + 1, b + 1], -1).reshape(-1, 3)])
    vertex = " ".join(f"{x:.9g}" for x in points.ravel())
    return f'vertex="{vertex}" face="{" ".join(map(str, faces.ravel()))}" inertia="shell"'


SHAPES = f"""
<mujoco>
  <asset>
    <mesh name="tetrahedron" vertex="0 0 0 .4 0 0 0 .4 0 0 0 .4"/>
    <mesh name="box" vertex="-1 -1 -1 1 -1 -1 -1 1 -1 1 1 -1 -1 -1 1 1 -1 1 -1 1 1 1 1 1" scale=".1 .2 .15"/>
    <mesh name="ball" {ball()}/>
    <material name="glass" rgba="1 1 1 0"/>
    <material name="paint" rgba="1 0 0 1"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="2 1.5 .1" pos="0 0 -1" euler="5 3 0"/>
    <geom name="wall" type="plane" size="0 0 .1" pos="0 4 0" euler="80 0 0" group="5"/>
    <geom name="stone" type="ellipsoid" size=".3 .2 .4" pos="1 1 0" euler="10 20 30" group="1" contype="0"
          conaffinity="0"/>
    <body name="fixed" pos="-.8 .8 .3"><geom name="post" type="cylinder" size=".2 .5" euler="40 0 10"/></body>
    <body name="arm" pos="0 0 .5">
      <joint type="ball"/>
      <geom name="upper" type="capsule" size=".1" fromto="0 0 0 .6 .1 .1" group="2"/>
      <geom name="skin" type="mesh" mesh="tetrahedron" pos=".5 .5 .1" contype="0" conaffinity="0" group="2"/>
      <body name="hand" pos=".7 0 0"><joint axis="0 1 0"/>
        <geom name="palm" type="box" size=".2 .1 .15" group="3"/>
        <geom name="thumb" type="mesh" mesh="box" pos="0 .5 .2" euler="30 10 0" group="9"/>
      </body>
    </body>
    <body name="loose" pos="0 -1 .5"><freejoint/>
      <geom name="dented" type="mesh" mesh="ball"/>
      <geom name="bead" size=".15" pos=".5 0 0" material="paint" rgba="1 1 1 0"/>
      <geom name="clear" size=".6" material="glass"/>
      <geom name="unseen" size=".6" rgba="1 1 1 0"/>
    </body>
  </worldbody>
</mujoco>"""
# Geoms of SHAPES that rays never meet.
UNSEEN = {"clear", "unseen"}


def some_rays(seed: int, worlds: int = WORLDS) -> tuple[Array, Array]:
    """Rays of any length, half of which begin near the middle."""
    rng = np.random.default_rng(seed)
    pnt = rng.normal(0, 1, (worlds, RAYS, 3)) * np.repeat([0.5, 2.0], RAYS // 2)[:, None]
    return pnt, (rng.normal(0, 0.6, (worlds, RAYS, 3)) - pnt) * rng.uniform(0.1, 3, (worlds, RAYS, 1))


def expected(
    model: mujoco.MjModel, places: tuple[Array, Array], pnt: Array, vec: Array, *options: Any
) -> tuple[Array, Array, Array]:
    """What MuJoCo says of geoms that are placed so; ``options`` are those of ``mj_ray``."""
    group, static, exclude = options or (None, True, -1)
    xpos, xmat = places
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shape = pnt.shape[:2]
    dist, geomid, normal = np.empty(shape), np.empty(shape, np.int32), np.zeros((*shape, 3))
    hit, face = np.zeros(1, np.int32), np.zeros(3)
    for world, ray in np.ndindex(shape):
        data.geom_xpos[:], data.geom_xmat[:] = xpos[world], xmat[world]
        dist[world, ray] = mujoco.mj_ray(
            model, data, pnt[world, ray], vec[world, ray], group, static, exclude, hit, face
        )
        geomid[world, ray] = hit[0]
        if hit[0] >= 0:
            normal[world, ray] = face
    return dist, geomid, normal


def assert_same(found: RayHits, wanted: tuple[Array, Array, Array], tolerance: float = TOLERANCE) -> None:
    dist, geomid, normal = wanted
    np.testing.assert_array_equal(found.geomid, geomid)
    np.testing.assert_allclose(found.dist, dist, rtol=tolerance, atol=tolerance)
    np.testing.assert_allclose(found.normal, normal, atol=100 * tolerance)


def placed(frame: tl.Frame) -> tuple[Array, Array]:
    return np.array(frame.geom_xpos, float), np.array(frame.geom_xmat, float)


def both(frame: tl.Frame) -> list[Any]:
    """A frame with the poses of geoms, and one with those of bodies alone."""
    return [frame, tl.FrameCopy({"body_q": frame.body_q})]


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_every_shape_is_met_as_in_mujoco(precision: str) -> None:
    with live(SHAPES, worlds=WORLDS, precision=precision, fields=("body_q", *POSES["geom"])) as run:
        frame = run.place(run.states(1))
        places, (pnt, vec) = placed(frame), some_rays(2)
        wanted = expected(run.model, places, pnt, vec)
        names = [run.model.geom(geom).name for geom in range(run.model.ngeom)]
        met = {names[geom] for geom in np.unique(wanted[1]) if geom >= 0}
        assert met == set(names) - UNSEEN, "the rays meet every geom that is seen"
        by_geoms, by_bodies = (run.sim.rays(pnt, vec, frame=own) for own in both(frame))
        assert_same(by_geoms, wanted)
        if precision == "f64":
            assert_same(by_bodies, wanted)
        else:
            same = by_bodies.geomid == by_geoms.geomid
            assert same.mean() > 0.99, "poses in single precision differ at edges alone"
            assert np.median(abs(by_bodies.dist - by_geoms.dist)[same]) < 1e-6
        assert by_geoms.geomid.dtype == np.int32 and by_geoms.dist.dtype == np.float64


def test_rays_from_inside_meet_the_surface_around_them() -> None:
    with live(SHAPES, worlds=1, fields=POSES["geom"]) as run:
        frame = run.sim.forward()
        places, rng = placed(frame), np.random.default_rng(3)
        pnt = np.repeat(places[0], 20, axis=1) + rng.normal(0, 0.02, (1, 20 * run.model.ngeom, 3))
        vec = rng.normal(0, 1, pnt.shape)
        assert_same(run.sim.rays(pnt, vec, frame=frame), expected(run.model, places, pnt, vec))


@pytest.mark.parametrize("seed", range(6))
def test_random_models_are_met_as_in_mujoco(seed: int) -> None:
    xml = random_mjcf(seed, 8, replace(EVERYTHING, geoms=True))
    with live(xml, worlds=WORLDS, fields=("body_q", *POSES["geom"])) as run:
        frame = run.place(run.states(seed))
        pnt, vec = some_rays(seed)
        wanted = expected(run.model, placed(frame), pnt, vec)
        assert (wanted[1] >= 0).any()
        for own in both(frame):
            assert_same(run.sim.rays(pnt, vec, frame=own), wanted)


def test_filters_are_mujocos() -> None:
    with live(SHAPES, worlds=WORLDS, fields=POSES["geom"]) as run:
        frame = run.place(run.states(4))
        places, (pnt, vec) = placed(frame), some_rays(5)
        groups = [np.array(flags, np.uint8) for flags in ([1, 0, 0, 1, 0, 0], [0, 1, 1, 0, 0, 1], [0] * 6)]
        assert run.sim.body_names == [f"m/{run.model.body(body).name}" for body in range(run.model.nbody)]
        for group in (None, *groups):
            for static in (True, False):
                for body in (-1, 0, 3, 4):
                    found = run.sim.rays(pnt, vec, geomgroup=group, flg_static=static, bodyexclude=body, frame=frame)
                    assert_same(found, expected(run.model, places, pnt, vec, group, static, body))
        bodies = np.array([-1, 0, 4, 3])
        mixed = run.sim.rays(pnt, vec, bodyexclude=bodies, frame=frame)
        for world, body in enumerate(bodies):
            alone = run.sim.rays(pnt, vec, bodyexclude=int(body), frame=frame)
            np.testing.assert_array_equal(mixed.geomid[world], alone.geomid[world])
        per_ray = run.sim.rays(pnt, vec, bodyexclude=np.tile(bodies[:, None], (1, RAYS)), frame=frame)
        np.testing.assert_array_equal(per_ray.dist, mixed.dist)


def test_rays_equal_in_all_worlds_need_no_copies() -> None:
    with live(SHAPES, worlds=WORLDS, fields=("body_q",)) as run:
        run.place(run.states(6))
        pnt, vec = (array[0] for array in some_rays(7))
        full = [np.broadcast_to(array, (WORLDS, RAYS, 3)) for array in (pnt, vec)]
        wanted = run.sim.rays(*full)
        assert_same(run.sim.rays(pnt, vec), wanted, 0.0)
        assert_same(run.sim.rays(full[0], vec), wanted, 0.0)
        eye = run.sim.rays((0, 0, 3), vec)
        assert eye.dist.shape == (WORLDS, RAYS)
        assert_same(eye, run.sim.rays(np.tile([0.0, 0, 3], (RAYS, 1)), vec), 0.0)
        assert run.sim.rays((0, 0, 3), (0, 0, -1)).dist.shape == (WORLDS, 1)
        narrow = run.sim.rays(pnt.astype(np.float32), vec.astype(np.float32))
        assert_same(
            narrow, run.sim.rays(pnt.astype(np.float32).astype(float), vec.astype(np.float32).astype(float)), 0.0
        )
        assert run.sim.rays(np.empty((0, 3)), (0, 0, 1)).normal.shape == (WORLDS, 0, 3)


def test_multi_ray_says_the_same() -> None:
    with live(SHAPES, worlds=1, fields=("body_q",)) as run:
        data = mujoco.MjData(run.model)
        mujoco.mj_forward(run.model, data)
        vec = np.random.default_rng(8).normal(0, 1, (RAYS, 3))
        geomid, dist, normal = np.empty(RAYS, np.int32), np.empty(RAYS), np.empty(3 * RAYS)
        eye = np.array([0.3, -0.2, 1.5])
        cutoff = mujoco.mjMAXVAL
        mujoco.mj_multiRay(run.model, data, eye, vec.ravel(), None, True, -1, geomid, dist, normal, RAYS, cutoff)
        assert_same(run.sim.rays(eye, vec), (dist[None], geomid[None], normal.reshape(1, -1, 3)))


def test_what_is_wrong_is_named() -> None:
    with live(SHAPES, worlds=WORLDS, fields=("body_q",)) as run:
        rays, (pnt, vec) = run.sim.rays, some_rays(9)
        wrong: list[tuple[str, dict[str, Any]]] = [
            ("pnt has shape", {"pnt": pnt[:2]}),
            ("last axis", {"pnt": pnt[..., :2]}),
            ("and vec .*; give", {"vec": vec[:, :7]}),
            ("dtype", {"vec": vec.astype(bool)}),
            ("NaN", {"pnt": pnt * np.nan}),
            ("length 0", {"vec": vec * 0}),
            ("6 flags", {"geomgroup": [1, 0]}),
            ("bodyexclude must", {"bodyexclude": 99}),
            ("bodyexclude has dtype", {"bodyexclude": 0.5}),
            ("bodyexclude has shape", {"bodyexclude": [0, 1]}),
        ]
        for message, changed in wrong:
            with pytest.raises(tl.ArgumentError, match=message):
                rays(**({"pnt": pnt, "vec": vec} | changed))
    with live(SHAPES, worlds=1, fields=("geom_xpos",)) as run, pytest.raises(tl.UnknownField, match="body_q"):
        run.sim.rays((0, 0, 1), (0, 0, -1))
    scene = tl.Scene()
    scene.add_box(half_extents=(1, 1, 1))
    scene.add_body(name="cube", mass=1.0)
    with tl.launch(scene, worlds=1) as sim, pytest.raises(tl.SceneError, match="add a MuJoCo model"):
        sim.rays((0, 0, 1), (0, 0, -1))


HILL = """<mujoco><asset><hfield name="hill" nrow="3" ncol="3" size="1 1 1 .1" elevation="0 0 0 0 1 0 0 0 0"/></asset>
<worldbody><geom name="hill" type="hfield" hfield="hill" contype="0" conaffinity="0" group="4"/><geom size=".1"/>
</worldbody></mujoco>"""


def test_rays_meet_height_fields_where_those_of_mujoco_do() -> None:
    model = mujoco.MjModel.from_xml_string(HILL)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(5)
    # above, inside and below: MuJoCo's field has a box of its base inside, whose top rays from inside meet
    pnt = rng.uniform((-1.5, -1.5, -0.4), (1.5, 1.5, 2.7), (800, 3))
    vec = rng.normal((0, 0, -0.5), 1, (800, 3))
    geom, normal = np.zeros(1, np.int32), np.zeros(3)
    far, found = [], []
    for origin, way in zip(pnt, vec, strict=True):
        far.append(mujoco.mj_ray(model, data, origin, way, None, True, -1, geom, normal))
        found.append([geom[0], *normal])
    with live(HILL, worlds=1, fields=("geom_xpos", "geom_xmat")) as run:
        hits = run.sim.rays(pnt, vec)
    far, found = np.array(far), np.array(found)
    hit = far >= 0
    assert (found[:, 0] == 0).sum() > 30
    np.testing.assert_array_equal(hits.geomid[0], np.where(hit, found[:, 0], -1))
    np.testing.assert_allclose(hits.dist[0], far, atol=1e-9)
    np.testing.assert_allclose(hits.normal[0][hit], found[hit, 1:], atol=1e-9)


def test_two_models_count_their_geoms_and_bodies_one_after_the_other() -> None:
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(SHAPES), name="first")
    scene.add_mujoco(mujoco.MjModel.from_xml_string(SHAPES), name="second", pos=(10, 0, 0))
    with tl.launch(scene, worlds=2, precision="f64") as sim:
        pnt, vec = some_rays(10, 2)
        first, second = sim.rays(pnt, vec), sim.rays(pnt + np.array([10.0, 0, 0]), vec)
        model = mujoco.MjModel.from_xml_string(SHAPES)
        geoms, parts = model.ngeom, {model.ngeom + model.geom(name).id for name in ("dented", "bead")}
        near = (first.geomid >= 0) & (first.geomid < geoms) & (first.geomid != 1) & (first.dist < 3)
        assert near.mean() > 0.2
        np.testing.assert_array_equal(second.geomid[near], first.geomid[near] + geoms)
        loose = sim.body_names.index("second/loose")
        without = sim.rays(pnt + np.array([10.0, 0, 0]), vec, bodyexclude=loose)
        assert parts <= set(np.unique(second.geomid))
        assert not parts & set(np.unique(without.geomid))


def test_a_saved_scene_needs_no_mujoco(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from safetensors.numpy import load_file, save_file

    model = mujoco.MjModel.from_xml_string(SHAPES)
    tl.Scene.from_mujoco(model, name="m").save(tmp_path / "scene.toml")

    def missing(_: str) -> None:
        raise ModuleNotFoundError(name="mujoco")

    monkeypatch.setattr(optional_imports, "import_module", missing)
    pnt, vec = some_rays(11, 1)
    with tl.launch(tl.Scene.load(tmp_path / "scene.toml"), worlds=1, fields=POSES["geom"], precision="f64") as sim:
        frame = sim.forward()
        assert_same(sim.rays(pnt, vec, frame=frame), expected(model, placed(frame), pnt, vec))
    file = tmp_path / "scene_models" / "m.safetensors"
    arrays = load_file(file)
    del arrays["geom_group"]
    save_file(arrays, file)
    with tl.launch(tl.Scene.load(tmp_path / "scene.toml"), worlds=1) as sim:
        assert (sim.rays(pnt, vec).geomid >= 0).any()
        with pytest.raises(tl.ArgumentError, match="save the scene again"):
            sim.rays(pnt, vec, geomgroup=[1] * 6)
