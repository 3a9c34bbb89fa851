"""Contacts of height fields against MuJoCo, at random states in f64.

Models with MuJoCo's search have its points; those that disable it (`nativeccd`) have tightloop's own, as `f32` has.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl

Array = NDArray[np.float64]

FIELDS = ("contact_count", "contact_pos", "contact_normal", "contact_distance", "qacc", "contacts_left_out")
#: Contacts that a pair keeps.
KEPT = 8
#: Two contacts are the same within this [m and –]: MuJoCo's search ends at 1e-6.
SAME = 1e-6
#: MuJoCo's own search (nativeccd) is exact to rounding for curved shapes. For boxes and meshes it returns
#: depths below the least one of all separating axes (10 % of it at times); libccd, the older search, does not.
NATIVE = ("sphere", "small_sphere", "capsule", "cylinder", "ellipsoid")
HULL = np.random.default_rng(9).normal(0, 0.08, (24, 3))
GEOMS = {
    "sphere": 'type="sphere" size=".08"',
    "small_sphere": 'type="sphere" size=".03"',
    "capsule": 'type="capsule" size=".05 .1"',
    "box": 'type="box" size=".1 .07 .05"',
    "cylinder": 'type="cylinder" size=".07 .06"',
    "ellipsoid": 'type="ellipsoid" size=".1 .07 .05"',
    "mesh": 'type="mesh" mesh="hull"',
}
XML = """<mujoco model="m">
<option solver="Newton" tolerance="0" iterations="100" ls_iterations="100" cone="{cone}">
<flag nativeccd="{native}"/></option>
<asset><hfield name="hills" nrow="21" ncol="17" size="1.6 2 .3 .4"/><mesh name="hull" vertex="{vertices}"/></asset>
<worldbody><geom name="hills" type="hfield" hfield="hills" pos=".3 -.2 .1" {turn}/>
<body pos="0 0 1"><freejoint/><geom name="it" {geom} margin="{margin}"/></body></worldbody></mujoco>"""


@dataclass
class Found:
    """Contacts of one world."""

    pos: Array
    normal: Array
    distance: Array


@dataclass
class Both:
    """Contacts and accelerations of MuJoCo and ours, an entry per world."""

    theirs: list[Found]
    ours: list[Found]
    their_qacc: Array
    our_qacc: Array
    qpos: Array


def hills(
    geom: str,
    ground: str,
    *,
    cone: str = "elliptic",
    margin: float = 0.0,
    turn: str = "",
    native: bool | None = None,
) -> mujoco.MjModel:
    vertices = " ".join(f"{x:.6f}" for x in HULL.ravel())
    flag = "enable" if (geom in NATIVE if native is None else native) else "disable"
    xml = XML.format(geom=GEOMS[geom], cone=cone, margin=margin, turn=turn, vertices=vertices, native=flag)
    model = mujoco.MjModel.from_xml_string(xml)
    rows, columns = int(model.hfield_nrow[0]), int(model.hfield_ncol[0])
    heights = {
        "rough": np.random.default_rng(0).uniform(0, 1, (rows, columns)),
        "flat": np.zeros((rows, columns)),
        "steps": np.tile(np.floor(np.arange(columns) / 4) * 0.25, (rows, 1)),
    }
    model.hfield_data[:] = heights[ground].ravel()
    return model


def compared(model: mujoco.MjModel, worlds: int, seed: int, *, depth: float = 0.02) -> Both:
    """Put the geom at random places, its lowest point up to `depth` [m] below the sample nearest to its centre."""
    rng = np.random.default_rng(seed)
    qpos, data = np.zeros((worlds, 7)), mujoco.MjData(model)
    qpos[:, 0], qpos[:, 1] = rng.uniform(-1.1, 1.6, worlds), rng.uniform(-2.0, 1.6, worlds)
    turns = rng.normal(size=(worlds, 4))
    qpos[:, 3:] = turns / np.linalg.norm(turns, axis=1)[:, None]
    geom, theirs = np.zeros(1, np.int32), []
    their_qacc = np.zeros((worlds, model.nv))
    for row, qacc in zip(qpos, their_qacc, strict=True):
        mujoco.mj_forward(model, data)
        far = mujoco.mj_ray(model, data, [*row[:2], 5.0], [0, 0, -1.0], None, True, 1, geom)
        row[2] = 5.0 - far + rng.uniform(-depth, 1.0 * model.geom_rbound[1])
        mujoco.mj_resetData(model, data)
        data.qpos[:] = row
        mujoco.mj_forward(model, data)
        qacc[:] = data.qacc
        contacts = data.contact
        theirs.append(Found(contacts.pos.copy(), contacts.frame[:, :3].copy(), contacts.dist.copy()))
    scene = tl.Scene.from_mujoco(model)
    with tl.launch(scene, worlds=worlds, precision="f64", fields=FIELDS) as sim:
        frame = sim.write(joint_q=qpos[:, [0, 1, 2, 4, 5, 6, 3]])
        counts = frame.contact_count
        assert not frame.contacts_left_out.any()
        ours = [
            Found(
                *(
                    np.array(part[world, : counts[world]])
                    for part in (frame.contact_pos, frame.contact_normal, frame.contact_distance)
                )
            )
            for world in range(worlds)
        ]
        return Both(theirs, ours, their_qacc, np.array(frame.qacc), qpos)


def nearest(one: Found, k: int, other: Found) -> float:
    """How far a contact is from the nearest of others, in distance, normal and place."""
    off = np.maximum(abs(other.distance - one.distance[k]), abs(other.normal - one.normal[k]).max(1))
    return float(np.maximum(off, abs(other.pos - one.pos[k]).max(1)).min())


def same_contacts(both: Both, within: float) -> Array:
    """Worlds in which both have the same contacts, one of each."""
    found = []
    for theirs, ours in zip(both.theirs, both.ours, strict=True):
        same = 0 < len(theirs.distance) == len(ours.distance)
        same = same and all(nearest(theirs, k, ours) < within for k in range(len(theirs.distance)))
        found.append(same and all(nearest(ours, k, theirs) < within for k in range(len(ours.distance))))
    return np.array(found)


def split(both: Both, depth: float) -> dict[str, Array]:
    """Errors of distance, normal and place of MuJoCo's contacts in ours: of those below and those above a depth [m].

    Worlds in which either side leaves contacts out do not count.
    """
    rows: dict[str, list[list[float]]] = {"shallow": [], "deep": []}
    for theirs, ours in zip(both.theirs, both.ours, strict=True):
        if not 0 < len(ours.distance) < KEPT or len(theirs.distance) > KEPT:
            assert len(ours.distance) or (theirs.distance > -SAME).all()
            continue
        for k, distance in enumerate(theirs.distance):
            off = abs(ours.distance - distance), abs(ours.normal - theirs.normal[k]).max(1)
            places = abs(ours.pos - theirs.pos[k]).max(1)
            best = np.lexsort((places, np.round(np.maximum(*off), 9)))[0]
            rows["shallow" if distance > -depth else "deep"].append([off[0][best], off[1][best], places[best]])
    return {name: np.array(errors).reshape(-1, 3) for name, errors in rows.items()}


@pytest.mark.parametrize("ground", ["rough", "steps", "flat"])
@pytest.mark.parametrize(("geom", "radius"), [("sphere", 0.08), ("small_sphere", 0.03), ("capsule", 0.05)])
def test_spheres_and_capsules_have_the_contacts_of_mujoco(geom: str, radius: float, ground: str) -> None:
    """All of them. Where the sphere's centre or the capsule's axis is in a prism, MuJoCo searches the way out (EPA)."""
    found = split(compared(hills(geom, ground), 400, seed=1), radius)
    shallow, deep = found["shallow"], found["deep"]
    print(f"{geom} {ground}: {len(shallow)} outside: {shallow.max(0)}; {len(deep)} inside: {deep.max(0)}")
    assert len(shallow) > 300 and len(deep) > 50
    assert shallow[:, :2].max() < SAME
    # a capsule along a triangle touches in a line: MuJoCo has one point of it
    assert (shallow[:, 2] < SAME).mean() > 0.99
    # two ways out may be equally short
    assert (deep[:, 0] < SAME).mean() > 0.98 and (deep[:, 1] < 1e-3).mean() > 0.98


def test_cylinders_have_the_depths_of_mujoco_where_those_are_a_way_out() -> None:
    """MuJoCo has one point and one normal of many where two features share an area, or a curve is flat."""
    model, errors = hills("cylinder", "rough"), []
    both = compared(model, 400, seed=1)
    for theirs, ours in zip(both.theirs, both.ours, strict=True):
        if not 0 < len(ours.distance) < KEPT:
            continue
        for k, distance in enumerate(theirs.distance):
            # walls between prisms are level; so steep a triangle does not occur here
            if theirs.normal[k, 2] > 0.8:
                errors.append(abs(ours.distance - distance).min())
    print(f"cylinder: {len(errors)}: {np.quantile(errors, [0.5, 0.9, 0.99, 1.0])}")
    assert len(errors) > 100 and (np.array(errors) < SAME).mean() > 0.97


@pytest.mark.parametrize("margin", [0.0, 0.01])
@pytest.mark.parametrize("geom", GEOMS)
def test_points_are_mujocos_where_a_pair_keeps_all(geom: str, margin: float) -> None:
    both = compared(hills(geom, "rough", margin=margin, native=True), 300, seed=6)
    few = np.array([0 < len(theirs.distance) <= KEPT for theirs in both.theirs])
    same = same_contacts(both, 1e-9)
    print(f"{geom}: {few.sum()} of 300, {same[few].mean()}")
    # as many in every world; of spheres and capsules all the same, of others some ends of searches differ
    alike = [len(theirs.distance) == len(ours.distance) for theirs, ours in zip(both.theirs, both.ours, strict=True)]
    assert few.sum() > 60 and np.array(alike)[few].mean() > 0.99
    assert same[few].mean() > {"box": 0.6, "mesh": 0.6, "cylinder": 0.6, "ellipsoid": 0.85}.get(geom, 0.98)
    size = np.maximum(1.0, abs(both.their_qacc).max(1))
    assert (abs(both.our_qacc - both.their_qacc).max(1) / size)[same].max() < 1e-6


@dataclass
class Solid:
    """A convex polyhedron: its corners, normals of its faces, and directions of its edges."""

    corners: Array
    normals: Array
    edges: Array


def least_depth(prism: Solid, shape: Solid) -> float:
    """Distance along the best axis (exact), in penetration of those that face the prism's top within 60 degrees."""
    crossed = np.cross(prism.edges[:, None], shape.edges[None]).reshape(-1, 3)
    axes = np.concatenate([prism.normals, shape.normals, crossed])
    lengths = np.linalg.norm(axes, axis=1)
    axes = axes[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    axes = np.concatenate([axes, -axes])
    distances = (shape.corners @ axes.T).min(0) - (prism.corners @ axes.T).max(0)
    up = prism.normals[0] * np.sign(prism.normals[0][2]) / np.linalg.norm(prism.normals[0])
    return float(distances.max() if distances.max() > 0 else distances[axes @ up > 0.5].max())


def prisms(model: mujoco.MjModel, low: Array, high: Array) -> list[Solid]:
    """The prisms of the field under a box."""
    rows, columns = int(model.hfield_nrow[0]), int(model.hfield_ncol[0])
    size, place = model.hfield_size[0], model.geom("hills").pos
    z = model.hfield_data.reshape(rows, columns) * size[2] + place[2]
    x = place[0] + np.linspace(-size[0], size[0], columns)
    y = place[1] + np.linspace(-size[1], size[1], rows)
    found = []
    for r in np.flatnonzero((y[1:] > low[1]) & (y[:-1] < high[1])):
        for c in np.flatnonzero((x[1:] > low[0]) & (x[:-1] < high[0])):
            for third in ((r + 1, c), (r, c + 1)):
                top = np.array([[x[k], y[j], z[j, k]] for j, k in ((r, c), (r + 1, c + 1), third)])
                bottom = np.column_stack([top[:, :2], np.full(3, place[2] - size[3])])
                ways = top[[1, 2, 0]] - top
                across = np.column_stack([ways[:, 1], -ways[:, 0], np.zeros(3)])
                normals = np.concatenate([[np.cross(ways[0], ways[1]), [0, 0, 1]], across])
                # those of its bottom are far from the way out
                edges = np.concatenate([ways, [[0, 0, 1]]])
                found.append(Solid(np.concatenate([top, bottom]), normals, edges))
    return found


def polyhedron(model: mujoco.MjModel) -> Solid:
    """A box or the hull of a mesh in the frame of its geom."""
    geom = model.geom("it")
    if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return Solid(signs * geom.size, np.eye(3), np.eye(3))
    # MuJoCo's graph of the hull: numbers of vertices and faces, then edges, vertices and faces
    start = int(model.mesh_graphadr[0])
    vertices, faces = int(model.mesh_graph[start]), int(model.mesh_graph[start + 1])
    end = start + 2 + 2 * vertices + vertices + 3 * faces
    corners = model.mesh_vert[model.mesh_graph[end : end + 3 * faces].reshape(faces, 3)]
    ways = corners[:, [1, 2, 0]] - corners
    normals = np.cross(ways[:, 0], ways[:, 1])
    return Solid(corners.reshape(-1, 3), normals, ways.reshape(-1, 3))


# a box has all its axes, and differs where an axis is at 60 degrees; a mesh is searched from its best face
@pytest.mark.parametrize(("geom", "share"), [("box", 0.95), ("mesh", 0.75)])
def test_polyhedra_touch_each_prism_at_its_least_depth(geom: str, share: float) -> None:
    """Against all separating axes: MuJoCo takes walls between prisms too, and its depths are not always least ones."""
    model = hills(geom, "rough")
    worlds, errors = 300, []
    solid, data = polyhedron(model), mujoco.MjData(model)
    both = compared(model, worlds, seed=5)
    for world in range(worlds):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = both.qpos[world]
        mujoco.mj_kinematics(model, data)
        turn = data.geom("it").xmat.reshape(3, 3)
        placed = Solid(data.geom("it").xpos + solid.corners @ turn.T, solid.normals @ turn.T, solid.edges @ turn.T)
        depths = [least_depth(prism, placed) for prism in prisms(model, placed.corners.min(0), placed.corners.max(0))]
        depths = [depth for depth in depths if depth < -1e-6]
        ours = both.ours[world].distance
        if len(ours) >= KEPT:
            continue
        off = [abs(ours - depth).min() if len(ours) else np.inf for depth in depths]
        errors += off
    print(f"{geom}: {len(errors)}: {np.quantile(errors, [0.5, 0.7, 0.8, 0.9, 0.95, 1.0])}")
    assert len(errors) > 100 and (np.array(errors) < SAME).mean() >= share


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("geom", ["sphere", "small_sphere", "capsule"])
def test_worlds_with_the_same_contacts_accelerate_alike(geom: str, cone: str) -> None:
    both = compared(hills(geom, "rough", cone=cone, turn='euler="0 0 20"'), 400, seed=2)
    same = same_contacts(both, 1e-9)
    print(f"{geom} {cone}: {same.sum()} worlds")
    assert same.sum() > 40
    size = np.maximum(1.0, abs(both.their_qacc).max(1))
    off = abs(both.our_qacc - both.their_qacc).max(1) / size
    assert off[same].max() < 1e-6


@pytest.mark.parametrize(("geom", "radius"), [("sphere", 0.08), ("capsule", 0.05)])
def test_contacts_begin_within_the_margin(geom: str, radius: float) -> None:
    both = compared(hills(geom, "rough", margin=0.01), 300, seed=3)
    shallow = split(both, radius)["shallow"]
    found = np.concatenate([ours.distance for ours in both.ours])
    assert len(shallow) > 200 and shallow[:, :2].max() < SAME
    assert (found < 0.01 + 1e-9).all() and (found > 0.001).sum() > 10


def test_a_tilted_field_has_the_contacts_of_mujoco() -> None:
    shallow = split(compared(hills("sphere", "rough", turn='euler="15 -20 30"'), 300, seed=4), 0.08)["shallow"]
    assert len(shallow) > 200 and shallow.max() < SAME


def test_a_field_on_a_body_that_moves_is_refused() -> None:
    xml = """<mujoco model="m"><asset><hfield name="h" nrow="3" ncol="3" size="1 1 .1 .1"/></asset><worldbody>
    <geom size=".1"/><body mocap="true"><geom name="f" type="hfield" hfield="h"/></body></worldbody></mujoco>"""
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except ValueError:
        pytest.skip("this version of MuJoCo refuses it itself")
    with pytest.raises(tl.SceneError, match="geom `f`: no support for height fields on bodies that move"):
        tl.Scene.from_mujoco(model)
