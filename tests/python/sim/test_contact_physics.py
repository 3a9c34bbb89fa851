"""Contacts against closed forms, and what their fields, capacities and filters mean."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl

PRECISIONS = pytest.mark.parametrize("precision", ["f32", "f64"])
CONES = pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
GRAVITY = 9.81
STATE = ("joint_q", "joint_qd")
CONTACTS = (
    "contact_count",
    "contact_pos",
    "contact_normal",
    "contact_distance",
    "contact_force",
    "contact_pair",
    "body_contact_force",
)
# Status bits: not finite, iterations used up, contacts left out
FINITE, LEFT_OUT = 1, 4

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper">{ball}</link><link name="lower">{ball}</link><link name="hand">{ball}</link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/><origin xyz="0.15 0 0"/>
    <axis xyz="0 1 0"/></joint>
  <joint name="wrist" type="continuous"><parent link="lower"/><child link="hand"/><origin xyz="-0.1 0 0"/>
    <axis xyz="0 1 0"/></joint>
</robot>
""".format(
    ball='<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
    '<collision name="ball"><geometry><sphere radius="0.1"/></geometry></collision>'
)


def after(sim: tl.Sim, frames: int) -> tl.Frame:
    """What there is so many control frames later, at least one."""
    for _ in range(frames - 1):
        sim.step()
    return sim.step()


def about_y(angle: float) -> tuple[float, float, float, float]:
    """A turn about y [rad], (x, y, z, w)."""
    return (0.0, float(np.sin(angle / 2)), 0.0, float(np.cos(angle / 2)))


def slope_of(angle: float, half_height: float) -> tuple[tl.Scene, NDArray[np.float64]]:
    """A slope that falls along x, and the unit vector down it."""
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_plane(quat=about_y(angle), mu=0.3, name="slope")
    normal = np.array([np.sin(angle), 0.0, np.cos(angle)])
    scene.add_body(name="thing", pos=tuple(half_height * normal), quat=about_y(angle))
    return scene, np.array([np.cos(angle), 0.0, -np.sin(angle)])


@PRECISIONS
@CONES
def test_a_block_slides_past_the_angle_of_friction_and_not_before(cone, precision):
    mu, seconds = 0.3, 2.0
    for share in (0.99, 1.01):
        angle = np.arctan(share * mu)
        scene, down = slope_of(angle, 0.02)
        scene.solver(cone=cone)
        scene.add_box(body="thing", half_extents=(0.1, 0.1, 0.02), mu=0.0)
        with tl.launch(scene, worlds=1, precision=precision, fields=STATE) as sim:
            start = sim.reset().joint_q[0, :3].astype(float)
            frame = after(sim, int(60 * seconds))
            moved = (frame.joint_q[0, :3] - start) @ down
        if share < 1:
            # a soft contact creeps, MuJoCo's by 3e-6 m with an elliptic and 4e-4 m with a pyramidal cone
            assert 0 <= moved < 1e-3
        else:
            # what friction leaves of gravity moves it by 6 cm: so the coefficient is a hundred times closer than asked
            acceleration = 2 * moved / seconds**2
            assert np.tan(angle) - acceleration / (GRAVITY * np.cos(angle)) == pytest.approx(mu, rel=2e-3)


@PRECISIONS
@CONES
def test_a_ball_rolls_down_a_slope_without_slip(cone, precision):
    angle, radius, seconds = np.arctan(0.2), 0.1, 2.0
    scene, down = slope_of(angle, radius)
    scene.solver(cone=cone)
    scene.add_sphere(body="thing", radius=radius)
    with tl.launch(scene, worlds=1, precision=precision, fields=STATE) as sim:
        frame = after(sim, int(60 * seconds))
        velocity, spin = frame.joint_qd[0, :3] @ down, frame.joint_qd[0, 4]
    expected = 5 / 7 * GRAVITY * np.sin(angle) * seconds
    # its first steps sink it into the slope
    assert velocity == pytest.approx(expected, rel=5e-3)
    # friction needs a slip to answer to: 2e-3 of the velocity in MuJoCo
    assert spin * radius == pytest.approx(velocity, rel=5e-3)


def stack(half: float, boxes: int) -> tl.Scene:
    """Boxes on each other on the ground."""
    scene = tl.Scene(dt=1 / 480, substeps=48)
    scene.add_ground()
    for number in range(boxes):
        scene.add_body(name=f"b{number}", pos=(0, 0, half * (2 * number + 1)))
        scene.add_box(body=f"b{number}", half_extents=(half,) * 3)
    return scene


@PRECISIONS
def test_a_stack_of_five_boxes_keeps_four_contacts_a_box_for_twenty_seconds(precision):
    with tl.launch(stack(0.05, 5), worlds=2, precision=precision, fields=("contact_count",)) as sim:
        assert (after(sim, 200).contact_count == 4 * 5).all()


@PRECISIONS
def test_a_stack_of_five_boxes_stands_for_twenty_seconds(precision):
    half, boxes = 0.05, 5
    with tl.launch(stack(half, boxes), worlds=2, precision=precision, fields=STATE) as sim:
        frame = after(sim, 200)
        q = frame.joint_q.astype(float).reshape(2, boxes, 7)
        assert not frame.status.any()
    settled = half * (2 * np.arange(boxes) + 1)
    # contacts give way by tenths of a millimetre, the lowest most: MuJoCo's top box sinks by 2.05 mm
    assert np.abs(q[:, :, 2] - settled).max() < 2.2e-3
    assert np.abs(q[:, :, :2]).max() < 1e-3
    assert np.abs(q[:, :, 3:6]).max() < 1e-3
    assert np.abs(frame.joint_qd).max() < 1e-3


@CONES
def test_two_balls_that_collide_keep_their_momentum(cone):
    scene = tl.Scene(dt=1 / 480, substeps=4, gravity=(0, 0, 0))
    # the gradient that an early end leaves is a force without a counterforce
    scene.solver(cone=cone, iterations=100, tolerance=0.0)
    radii = np.array([0.1, 0.15])
    for name, radius in zip("ab", radii, strict=True):
        scene.add_body(name=name, pos=(0.0 if name == "a" else 0.3, 0, 0))
        scene.add_sphere(body=name, radius=radius, mu=0.5)
    masses = 1000 * 4 / 3 * np.pi * radii**3
    moments = 0.4 * masses * radii**2
    rng = np.random.default_rng(0)
    worlds = 16
    qd = rng.normal(size=(worlds, 12)) * np.tile([1, 0.3, 0.3, 5, 5, 5], 2)
    # towards each other, not quite centrally
    qd[:, 0], qd[:, 6] = 3.0, -2.0

    def momenta(frame: tl.Frame) -> tuple[NDArray, NDArray]:
        """Of both balls together, about the world's origin."""
        q, v = frame.joint_q.reshape(worlds, 2, 7)[..., :3], frame.joint_qd.reshape(worlds, 2, 6)
        linear = masses[:, None] * v[..., :3]
        return linear.sum(axis=1), (np.cross(q, linear) + moments[:, None] * v[..., 3:]).sum(axis=1)

    with tl.launch(scene, worlds=worlds, precision="f64", fields=(*STATE, "contact_count")) as sim:
        start = momenta(sim.write(joint_qd=qd))
        touched = np.zeros(worlds, bool)
        for _ in range(60):
            touched |= sim.step().contact_count > 0
        frame = sim.forward()
        end = momenta(frame)
        assert touched.all() and not frame.contact_count.any(), "all met and parted"
        assert (np.abs(frame.joint_qd[:, 6] + 2.0) > 0.5).all()
    for before, after in zip(start, end, strict=True):
        # a step rounds its forces, of which edges of a pyramid have a thousand times (impratio) those of their sum
        np.testing.assert_allclose(after, before, rtol=0, atol=1e-11 * np.abs(before).max())


@CONES
@pytest.mark.parametrize("mu", [0.0, 1e-3, 0.02, 0.1])
def test_slippery_cubes_fall_on_each_other_without_harm_in_single_precision(cone, mu):
    # a pyramid's edges are impratio / (2 mu²) times as stiff as its normal
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.solver(cone=cone)
    scene.add_ground(mu=mu)
    for number in range(3):
        scene.add_body(name=f"c{number}", pos=(0, 0, 0.1 + 0.15 * number))
        scene.add_box(body=f"c{number}", half_extents=(0.05,) * 3, mu=mu)
    worlds = 32
    rng = np.random.default_rng(0)
    qd = rng.normal(size=(worlds, 18)) * np.tile([0.5, 0.5, 0.5, 3, 3, 3], 3)
    with tl.launch(scene, worlds=worlds, fields=STATE) as sim:
        frame = sim.write(joint_qd=qd)
        fastest = 0.0
        for _ in range(120):
            frame = sim.step()
            assert not (frame.status & 1).any()
            fastest = max(fastest, float(np.abs(frame.joint_qd.reshape(worlds, 3, 6)[..., :3]).max()))
    # the highest falls 0.4 m: what contacts push out may add some
    assert fastest < 6.0


def heap(contacts_max: int | None = None, rows_max: int | None = None) -> tl.Scene:
    """Three cubes over a ground; where they are is their worlds' matter."""
    scene = tl.Scene(dt=1 / 480, substeps=4, contacts_max=contacts_max, rows_max=rows_max)
    scene.add_ground()
    for number in range(3):
        scene.add_body(name=f"c{number}", pos=(0.3 * number, 0, 1.0))
        scene.add_box(body=f"c{number}", half_extents=(0.05, 0.05, 0.05))
    return scene


def heights(*low: bool) -> NDArray[np.float64]:
    """Positions of the heap's cubes, those that are low in the ground by a millimetre. ``(21,)``"""
    return np.concatenate([[0.3 * n, 0, 0.049 if is_low else 1.0, 0, 0, 0, 1] for n, is_low in enumerate(low)])


@PRECISIONS
@pytest.mark.parametrize("capacity", [{"contacts_max": 6}, {"rows_max": 18}], ids=str)
def test_what_does_not_fit_is_counted_and_flagged_in_its_worlds_alone(precision, capacity):
    few, many = heights(True, False, False), heights(True, True, True)
    # every third world has twelve contacts, where six have room
    q = np.array([many if world % 3 == 1 else few for world in range(20)])
    crowded = np.arange(20) % 3 == 1
    frames = {}
    fields = (*STATE, "contact_count", "contact_force", "body_contact_force")
    for name, scene in (("tight", heap(**capacity)), ("roomy", heap())):
        with tl.launch(scene, worlds=20, precision=precision, fields=(*fields, "contacts_left_out")) as sim:
            first = sim.write(joint_q=q)
            evaluated = first.copy()
            frame = after(sim, 3)
            frames[name] = (evaluated, frame.copy())
    # the state that was written, which is shown and not stepped, does not fit either
    shown = frames["tight"][0]
    assert np.array_equal(shown.status & LEFT_OUT, LEFT_OUT * crowded)
    assert np.array_equal(shown.contacts_left_out, 6 * crowded)
    tight, roomy = frames["tight"][1], frames["roomy"][1]
    assert np.array_equal(tight.status & LEFT_OUT, LEFT_OUT * crowded)
    assert np.array_equal(tight.contacts_left_out, 6 * crowded)
    assert not roomy.status.any() and not roomy.contacts_left_out.any()
    assert (tight.contact_count == np.where(crowded, 6, 4)).all()
    for name in STATE:
        ours, theirs = getattr(tight, name), getattr(roomy, name)
        assert np.array_equal(ours[~crowded].view(np.uint8), theirs[~crowded].view(np.uint8)), name
        assert not np.array_equal(ours[crowded], theirs[crowded])
    assert np.array_equal(tight.body_contact_force[~crowded], roomy.body_contact_force[~crowded])


def test_a_world_whose_contacts_fit_again_is_no_longer_flagged():
    with tl.launch(heap(contacts_max=6), worlds=2, fields=(*STATE, "contacts_left_out")) as sim:
        sim.write(joint_q=heights(True, True, True), mask=[True, False])
        assert np.array_equal(sim.step().contacts_left_out, [6, 0])
        sim.reset()
        frame = sim.step()
        assert not frame.contacts_left_out.any() and not frame.status.any()


@PRECISIONS
def test_permuted_worlds_give_the_same_bits(precision):
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_ground(mu=0.6)
    kinds = ("box", "sphere", "capsule", "cylinder")
    for number, kind in enumerate(kinds):
        scene.add_body(name=kind, pos=(0, 0, 0.2))
        sizes = {"half_extents": (0.06, 0.05, 0.04)} if kind == "box" else {"radius": 0.05}
        sizes |= {"half_height": 0.05} if number > 1 else {}
        getattr(scene, f"add_{kind}")(body=kind, **sizes)
    worlds, rng = 37, np.random.default_rng(1)
    q = np.zeros((worlds, 4, 7))
    q[..., :3] = rng.uniform([-0.06, -0.06, 0.05], [0.06, 0.06, 0.3], (worlds, 4, 3))
    q[..., 3:] = rng.normal(size=(worlds, 4, 4))
    q[..., 3:] /= np.linalg.norm(q[..., 3:], axis=-1, keepdims=True)
    order = rng.permutation(worlds)
    ends = []
    fields = (*STATE, *CONTACTS)
    with tl.launch(scene, worlds=worlds, precision=precision, fields=fields) as sim:
        for start in (q, q[order]):
            sim.reset()
            sim.write(joint_q=start.reshape(worlds, -1), joint_qd=np.zeros((worlds, 24)))
            frame = after(sim, 40)
            ends.append(frame.copy())
    plain, permuted = ends
    assert plain.contact_count.max() >= 6
    for name in fields:
        given, expected = getattr(permuted, name), getattr(plain, name)[order]
        assert np.array_equal(np.ascontiguousarray(given).view(np.uint8), expected.view(np.uint8)), name


@PRECISIONS
def test_fields_tell_what_touches_where_and_how_hard(precision):
    scene = tl.Scene(dt=1 / 480, substeps=48)
    scene.add_box(half_extents=(0.5, 0.5, 0.05), pos=(0, 0, -0.05), name="table")
    scene.add_body(name="cube", pos=(0.1, 0.2, 0.05))
    scene.add_box(body="cube", half_extents=(0.05, 0.05, 0.05), density=400, name="skin")
    scene.add_body(name="ball", pos=(0.1, 0.2, 0.13))
    scene.add_sphere(body="ball", radius=0.03, density=2000)
    scene.add_body(name="far", pos=(0, 0, 50))
    scene.add_sphere(body="far", radius=0.1)
    weights = GRAVITY * np.array([400 * 1e-3, 2000 * 4 / 3 * np.pi * 0.03**3])
    with tl.launch(scene, worlds=2, precision=precision, fields=(*STATE, *CONTACTS)) as sim:
        frame = after(sim, 10)
        names, bodies = sim.shape_names, sim.body_names
    table, cube, ball = (names.index(name) for name in ("table", "cube/skin", "ball/sphere"))
    for world in range(2):
        assert frame.contact_count[world] == 5
        pairs = frame.contact_pair[world]
        assert (pairs[5:] == -1).all(), "rows that are not in use"
        assert not frame.contact_force[world, 5:].any()
        found = [tuple(pair) for pair in pairs[:5].tolist()]
        assert sorted(tuple(sorted(pair)) for pair in found) == sorted(
            [tuple(sorted((table, cube)))] * 4 + [tuple(sorted((cube, ball)))]
        )
        carried = {cube: 0.0, ball: 0.0}
        for row, (first, second) in enumerate(found):
            normal, force = frame.contact_normal[world, row], frame.contact_force[world, row]
            # what is above stands second, or the normal points down
            up = 1.0 if second == max((first, second), key=(table, cube, ball).index) else -1.0
            np.testing.assert_allclose(normal, [0, 0, up], atol=1e-5)
            assert force[2] * up > 0, "the force is on the second shape"
            carried[ball if ball in (first, second) else cube] += abs(force[2])
            distance = frame.contact_distance[world, row]
            assert -1e-3 < distance < 0
            point = frame.contact_pos[world, row]
            height = 0.1 if ball in (first, second) else 0.0
            # the cube under the ball sinks, too
            assert abs(point[2] - height) < 2e-3
            if ball not in (first, second):
                np.testing.assert_allclose(np.abs(point[:2] - [0.1, 0.2]), 0.05, atol=1e-4)
        assert carried[ball] == pytest.approx(weights[1], rel=1e-3)
        assert carried[cube] == pytest.approx(weights.sum(), rel=1e-3)
        on = dict(zip(bodies, frame.body_contact_force[world], strict=True))
        np.testing.assert_allclose(on["cube/body"], [0, 0, weights[0]], atol=1e-3 * weights.sum())
        np.testing.assert_allclose(on["ball/body"], [0, 0, weights[1]], atol=1e-3 * weights.sum())
        assert not on["far/body"].any()


def test_a_gap_lists_contacts_without_force_and_a_margin_pushes_early():
    scene = tl.Scene(dt=1 / 480, substeps=1)
    scene.add_ground(margin=1e-3, gap=2e-3)
    scene.add_body(name="ball", pos=(0, 0, 0.1))
    scene.add_sphere(body="ball", radius=0.1, margin=2e-3, gap=3e-3)
    with tl.launch(scene, worlds=5, precision="f64", fields=(*STATE, *CONTACTS)) as sim:
        q = np.tile([0.0, 0, 0.1, 0, 0, 0, 1], (5, 1))
        q[:, 2] += [-1e-4, 2.9e-3, 3.1e-3, 7.9e-3, 8.1e-3]
        frame = sim.write(joint_q=q)
        assert frame.contact_count.tolist() == [1, 1, 1, 1, 0]
        assert ((frame.contact_force[:, 0, 2] != 0) == [True, True, False, False, False]).all()
        np.testing.assert_allclose(frame.contact_distance[:4, 0], q[:4, 2] - 0.1, atol=1e-15)


def one_of(kind: str) -> Callable[..., tl.Shape]:
    """Adds a shape of a kind, a tenth of a metre large."""
    sizes: dict[str, dict] = {
        "box": {"half_extents": (0.1, 0.1, 0.1)},
        "sphere": {"radius": 0.1},
        "capsule": {"radius": 0.05, "half_height": 0.05},
        "cylinder": {"radius": 0.1, "half_height": 0.1},
    }
    return lambda scene, **options: getattr(scene, f"add_{kind}")(**sizes[kind], **options)


@PRECISIONS
@pytest.mark.parametrize("mesh", [False, True], ids=["primitives", "hulls"])
def test_shapes_in_the_same_place_make_no_nan(tmp_path, precision, mesh):
    octahedron = tmp_path / "octahedron.obj"
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in (0.1 * np.vstack([np.eye(3), -np.eye(3)])).tolist())
    faces = "f 1 2 3\nf 2 4 3\nf 4 5 3\nf 5 1 3\nf 2 1 6\nf 4 2 6\nf 5 4 6\nf 1 5 6\n"
    octahedron.write_text(corners + faces)
    kinds = ["box", "sphere", "capsule", "cylinder"]
    scene = tl.Scene(dt=1 / 480, substeps=2)
    pairs = [(a, "mesh") for a in [*kinds, "mesh"]] if mesh else [*itertools.combinations_with_replacement(kinds, 2)]
    for number, pair in enumerate(pairs):
        for side, kind in zip("ab", pair, strict=True):
            body = f"{side}{number}"
            scene.add_body(name=body, pos=(2.0 * number, 0, 0))
            # each couple by itself, else every shape would be paired with all
            group = number + 1
            if kind == "mesh":
                scene.add_mesh(octahedron, body=body, group=group)
            else:
                one_of(kind)(scene, body=body, group=group)
    turns = [(0, 0, 0, 1), (np.sqrt(0.5), 0, 0, np.sqrt(0.5)), (0.5, 0.5, 0.5, 0.5)]
    # concentric, shifted by nothing but rounding, and touching face to face; turned by quarters
    places = [(shift, turn) for shift in ([0, 0, 0], [1e-9, 0, 0], [0, 0, 0.2], [0.2, 0, 0]) for turn in turns]
    with tl.launch(scene, worlds=len(places), precision=precision, fields=(*STATE, *CONTACTS)) as sim:
        q = sim.reset().joint_q.astype(float).reshape(len(places), len(pairs), 2, 7)
        for world, (shift, turn) in enumerate(places):
            q[world, :, 1, :3] += shift
            q[world, :, 1, 3:] = turn
        frame = sim.write(joint_q=q.reshape(len(places), -1))
        # six worlds are concentric: every pair of them touches
        assert (frame.contact_count[:6] >= len(pairs)).all()
        for _ in range(5):
            assert not (frame.status & FINITE).any()
            for name in (*STATE, *CONTACTS):
                assert np.isfinite(getattr(frame, name)).all(), name
            frame = sim.step()


def touching_pairs(scene: tl.Scene) -> set[frozenset[str]]:
    """Names of the shapes that touch at the scene's start."""
    with tl.launch(scene, worlds=1, fields=(*STATE, *CONTACTS)) as sim:
        frame = sim.reset()
        pairs = frame.contact_pair[0, : frame.contact_count[0]]
        return {frozenset(sim.shape_names[shape] for shape in pair) for pair in pairs}


def test_groups_say_which_shapes_touch():
    scene = tl.Scene()
    for group in (0, 1, 2, -1, -2):
        # Newton's rule; all five lie in one place
        scene.add_body(name=f"g{group}")
        scene.add_sphere(body=f"g{group}", radius=0.1, group=group, name=f"s{group}")
    scene.add_body(name="again")
    scene.add_sphere(body="again", radius=0.1, group=1, name="s1b")
    together = {(1, -1), (1, -2), (2, -1), (2, -2), (-1, -2)}
    expected = {frozenset((f"g{a}/s{a}", f"g{b}/s{b}")) for a, b in together}
    expected |= {frozenset(("again/s1b", other)) for other in ("g1/s1", "g-1/s-1", "g-2/s-2")}
    assert touching_pairs(scene) == expected


def test_what_is_filtered_or_stands_still_does_not_touch():
    def scene() -> tl.Scene:
        scene = tl.Scene()
        scene.add_box(half_extents=(1, 1, 0.1), name="table")
        scene.add_box(half_extents=(1, 1, 0.1), name="board")
        scene.add_body(name="post", fixed=True)
        scene.add_sphere(body="post", radius=0.1, name="knob")
        for name in "ab":
            scene.add_body(name=name)
            scene.add_sphere(body=name, radius=0.1, name=f"s{name}")
            scene.add_sphere(body=name, radius=0.1, name=f"t{name}", pos=(0.05, 0, 0))
        return scene

    still = ["table", "board", "post/knob"]
    moving = {name: [f"{name}/s{name}", f"{name}/t{name}"] for name in "ab"}
    every = {frozenset(pair) for pair in itertools.product(still, moving["a"] + moving["b"])}
    every |= {frozenset(pair) for pair in itertools.product(moving["a"], moving["b"])}
    assert touching_pairs(scene()) == every, "shapes of one body, and those that stand still, never touch"
    filtered = scene()
    filtered.filter_contacts("a", "table")
    filtered.filter_contacts("b/sb", "a/sa")
    filtered.filter_contacts("post", "b")
    gone = {frozenset((shape, "table")) for shape in moving["a"]} | {frozenset(("a/sa", "b/sb"))}
    gone |= {frozenset((shape, "post/knob")) for shape in moving["b"]}
    assert touching_pairs(filtered) == every - gone


@pytest.mark.parametrize("self_collisions", [False, True])
def test_links_touch_each_other_if_asked_and_neighbours_never(tmp_path, self_collisions):
    (tmp_path / "arm.urdf").write_text(ARM)
    scene = tl.Scene()
    scene.add_urdf(tmp_path / "arm.urdf", name="arm", self_collisions=self_collisions)
    other = scene.add_urdf(tmp_path / "arm.urdf", name="other", pos=(0, 0.15, 0), self_collisions=False)
    balls = [f"arm/{link}/ball" for link in ("upper", "lower", "hand")]
    others = [name.replace("arm/", "other/", 1) for name in balls]
    assert [f"other/{name}" for name in other.shape_names] == others
    # all balls of one arm reach those of the other, but upper and lower, which stand 0.21 m apart
    across = {frozenset(pair) for pair in itertools.product(balls, others)}
    across -= {frozenset(pair) for pair in ((balls[0], others[1]), (balls[1], others[0]))}
    own = {frozenset((balls[0], balls[2]))} if self_collisions else set()
    assert touching_pairs(scene) == across | own


WITH_FLOOR = """<robot name="w"><link name="base"/>
<link name="floor"><collision><origin xyz="0 0 -.05"/><geometry><box size="2 2 .1"/></geometry></collision></link>
<joint name="holds" type="fixed"><parent link="base"/><child link="floor"/></joint>
<link name="ball">{inertial}<collision><geometry><sphere radius=".1"/></geometry></collision></link>
<joint name="free" type="floating"><parent link="base"/><child link="ball"/><origin xyz="0 0 .3"/></joint></robot>
""".format(inertial=ARM[ARM.index("<inertial>") : ARM.index("</inertial>")] + "</inertial>")


@PRECISIONS
@pytest.mark.parametrize("self_collisions", [False, True])
def test_a_ball_rests_on_the_fixed_floor_of_its_own_file(tmp_path, self_collisions, precision):
    (tmp_path / "w.urdf").write_text(WITH_FLOOR)
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_urdf(tmp_path / "w.urdf", name="w", self_collisions=self_collisions)
    with tl.launch(scene, worlds=1, precision=precision, fields=STATE) as sim:
        frame = after(sim, 120)
    # MuJoCo C: 0.0996
    assert frame.joint_q[0, 2] == pytest.approx(0.0996, abs=1e-4)
    assert np.abs(frame.joint_qd[0]).max() < 1e-3


@PRECISIONS
def test_a_ball_far_from_the_origin_rests_as_one_at_the_origin(precision):
    # a pair is seen from its own shapes: a kilometre away f32 keeps no tenths of a millimetre of the world's axes
    scene = tl.Scene(dt=1 / 480, substeps=48)
    for name, x in (("near", 0.0), ("far", 1000.0)):
        scene.add_body(name=name, pos=(x, 0, 0.1))
        scene.add_sphere(body=name, radius=0.1, group=1 if x else 2)
        scene.add_box(half_extents=(0.5, 0.5, 0.1), pos=(x, 0, -0.1), name=f"{name}_table", group=1 if x else 2)
    with tl.launch(scene, worlds=1, precision=precision, fields=(*STATE, *CONTACTS)) as sim:
        frame = after(sim, 20)
    forces = frame.body_contact_force[0, :, 2]
    assert frame.contact_count[0] == 2
    np.testing.assert_allclose(forces, GRAVITY * 1000 * 4 / 3 * np.pi * 1e-3, rtol=1e-3)
