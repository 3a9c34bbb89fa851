"""Rigid bodies of a scene: what they weigh, where they start, how they fall, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl

TURN = (0.0, 0.6, 0.0, 0.8)
FIELDS = ("joint_q", "joint_qd", "body_q", "body_qd", "mass_matrix")


def mass_matrix(scene: tl.Scene) -> np.ndarray:
    """Of the bodies of a scene at its start, in double precision."""
    with tl.launch(scene, worlds=1, precision="f64", fields=FIELDS) as sim:
        return np.array(sim.reset().mass_matrix[0])


def test_a_mass_alone_is_a_ball_of_water():
    scene = tl.Scene()
    scene.add_body(pos=(0, 0, 1), quat=(0, 0, 0, 1), mass=1.5)
    radius = (1.5 / (1000 * 4 / 3 * np.pi)) ** (1 / 3)
    expected = np.diag([1.5] * 3 + [0.4 * 1.5 * radius**2] * 3)
    np.testing.assert_allclose(mass_matrix(scene), expected, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    "shape, sizes, volume, moments",
    [
        ("box", {"half_extents": (0.1, 0.2, 0.3)}, 0.048, [(0.4**2 + 0.6**2) / 12, (0.2**2 + 0.6**2) / 12, 0.2 / 12]),
        ("sphere", {"radius": 0.1}, 4e-3 / 3 * np.pi, [0.004] * 3),
        ("ellipsoid", {"radii": (0.1, 0.2, 0.3)}, 8e-3 * np.pi, [0.13 / 5, 0.1 / 5, 0.05 / 5]),
        ("cylinder", {"radius": 0.1, "half_height": 0.3}, 6e-3 * np.pi, [0.01 / 4 + 0.36 / 12] * 2 + [0.005]),
    ],
)
def test_a_shape_gives_mass_and_inertia(shape, sizes, volume, moments):
    scene = tl.Scene()
    body = scene.add_body()
    getattr(scene, f"add_{shape}")(body=body, **sizes, density=400)
    mass = 400 * volume
    np.testing.assert_allclose(
        mass_matrix(scene), np.diag([mass] * 3 + [mass * m for m in moments]), rtol=1e-12, atol=1e-14
    )


def test_several_shapes_move_the_centre_and_a_given_mass_scales_them():
    scene = tl.Scene()
    hammer = scene.add_body(name="hammer", mass=2.0)
    scene.add_cylinder(body=hammer, radius=0.02, half_height=0.2, density=600)
    scene.add_box(body="hammer", half_extents=(0.03, 0.03, 0.06), pos=(0, 0, 0.2), density=7800)
    with tl.launch(scene, worlds=1, precision="f64", fields=FIELDS) as sim:
        frame = sim.write(joint_qd=[0, 0, 0, 1, 0, 0])
        handle, head = 600 * np.pi * 4e-4 * 0.4, 7800 * 0.06 * 0.06 * 0.12
        centre = 0.2 * head / (handle + head)
        # joint_qd moves the centre of mass, so the frame's origin swings about it
        np.testing.assert_allclose(np.diagonal(frame.mass_matrix[0])[:3], 2.0)
        own = handle * (4e-4 / 4 + 0.16 / 12 + centre**2)
        own += head * ((0.06**2 + 0.12**2) / 12 + (0.2 - centre) ** 2)
        np.testing.assert_allclose(frame.mass_matrix[0, 3, 3], own * 2.0 / (handle + head), rtol=1e-12)


def test_mass_centre_and_inertia_as_given():
    scene = tl.Scene()
    tensor = [[0.3, 0.01, 0.0], [0.01, 0.2, 0.02], [0.0, 0.02, 0.25]]
    scene.add_body(mass=3, com=(0.1, 0, 0), inertia=tensor)
    scene.add_body(mass=1, inertia=(0.1, 0.2, 0.25))
    matrix = mass_matrix(scene)
    np.testing.assert_allclose(matrix[3:6, 3:6], tensor, rtol=1e-12)
    np.testing.assert_allclose(np.diagonal(matrix)[6:], [1, 1, 1, 0.1, 0.2, 0.25], rtol=1e-12)


def test_free_bodies_fall_and_fixed_ones_stand():
    scene = tl.Scene(dt=1e-3, substeps=10)
    scene.add_body(name="cube", pos=(1, 2, 3), quat=TURN, mass=0.05)
    scene.add_box(body="cube", half_extents=(0.025,) * 3)
    post = scene.add_body(name="post", pos=(0, 0, 1), quat=TURN, fixed=True)
    scene.add_cylinder(body=post, radius=0.1, half_height=1)
    with tl.launch(scene, worlds=3, precision="f64", fields=FIELDS) as sim:
        assert sim.dof_names == [f"cube/free.{part}" for part in ("vx", "vy", "vz", "wx", "wy", "wz")]
        assert sim.body_names == ["cube/body", "post/body"]
        assert sim.dofs == {"cube": slice(0, 6), "post": slice(6, 6)}
        np.testing.assert_allclose(sim.reset().joint_q, [[1, 2, 3, *TURN]] * 3, atol=1e-15)
        frame = sim.step()
        for _ in range(9):
            frame = sim.step()
        # semi-implicit Euler: g h² n (n + 1) / 2
        np.testing.assert_allclose(frame.body_q[:, 0, 2], 3 - 9.81e-6 * 100 * 101 / 2, rtol=1e-12)
        np.testing.assert_allclose(frame.body_q[:, 1], [[0, 0, 1, *TURN]] * 3, atol=1e-15)
        frame = sim.write(joint_q={"cube": [0, 0, 5, 0, 0, 0, 1]})
        assert (frame.body_q[:, 0, 2] == 5).all()


def test_robots_come_first_and_many_bodies_keep_their_names(pendulum):
    for k in range(3):
        pendulum.add_body(pos=(k, 0, 0), mass=1.0)
    with tl.launch(pendulum, worlds=2) as sim:
        assert [*sim.dofs] == ["arm", "body", "body_2", "body_3"]
        assert sim.dofs["body_2"] == slice(8, 14)
        sim.step(joint_f={"body_2": [0, 0, 9.81, 0, 0, 0]})
        frame = sim.step()
        np.testing.assert_allclose(frame.joint_qd[:, sim.dofs["body_2"]], 0.0, atol=1e-6)


def test_a_scene_file_keeps_bodies(tmp_path, pendulum):
    pendulum.add_body(name="cube", pos=(0, 0, 1), mass=0.2, com=(0, 0, 0.01))
    pendulum.add_box(body="cube", half_extents=(0.1, 0.1, 0.1))
    ball = pendulum.add_body(name="ball", quat=TURN)
    pendulum.add_sphere(body=ball, radius=0.05, density=400)
    pendulum.add_capsule(body=ball, radius=0.01, half_height=0.1, pos=(0, 0, 0.1))
    pendulum.add_box(half_extents=(1, 1, 0.1), name="table")
    pendulum.add_body(name="flywheel", mass=1, inertia=(0.1, 0.1, 0.15), fixed=False)
    pendulum.add_body(name="wall", fixed=True)
    file = tmp_path / "scene.toml"
    pendulum.save(file)
    again = tl.Scene.load(file)
    assert again.to_toml() == pendulum.to_toml()
    assert [*again.bodies] == ["cube", "ball", "flywheel", "wall"]
    np.testing.assert_array_equal(mass_matrix(again), mass_matrix(pendulum))


@pytest.mark.parametrize(
    "arguments, says",
    [
        ({"mass": 0.0}, "body `cube`: mass is 0"),
        ({"mass": -1}, "mass is -1"),
        ({"mass": float("nan")}, "mass is nan"),
        ({"inertia": (1, 1, 1)}, "inertia but no mass"),
        ({"mass": 1, "inertia": (1, 1)}, r"inertia has shape \(2,\)"),
        ({"mass": 1, "inertia": [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]}, "not symmetric"),
        ({"mass": 1, "com": (1, 2)}, "com has 2 values"),
        ({"quat": (0, 0, 0, 2)}, "quat"),
        ({"pos": "abc"}, "pos"),
        ({"name": "a/b"}, "name 'a/b'"),
    ],
)
def test_wrong_arguments_are_refused_by_name(arguments, says):
    with pytest.raises(tl.SceneError, match=says):
        tl.Scene().add_body(**({"name": "cube"} | arguments))


def test_names_are_unique_among_robots_bodies_and_shapes(pendulum):
    pendulum.add_body(name="cube", mass=1)
    for name in ("arm", "cube"):
        with pytest.raises(tl.SceneError, match="taken"):
            pendulum.add_body(name=name, mass=1)
    with pytest.raises(tl.SceneError, match="taken"):
        pendulum.add_box(name="cube", half_extents=(1, 1, 1))


@pytest.mark.parametrize(
    "arguments, says",
    [
        ({}, "body `cube` weighs nothing; give its mass, give it a shape, or fix it"),
        ({"mass": 1, "inertia": (1, 1, 3)}, "1.5000 times"),
        ({"mass": 1, "inertia": (1, 1, -1)}, "negative principal moment"),
    ],
)
def test_what_cannot_be_simulated_is_refused_at_launch(arguments, says):
    scene = tl.Scene()
    scene.add_body(name="cube", **arguments)
    with pytest.raises(tl.SceneError, match=says):
        tl.launch(scene, worlds=1)


def test_a_shape_of_a_body_is_refused_by_name():
    scene = tl.Scene()
    body = scene.add_body(name="cube")
    with pytest.raises(tl.SceneError, match="box `box`: smallest of half_extents is 0"):
        scene.add_box(body=body, half_extents=(0.1, 0.0, 0.1))
    with pytest.raises(tl.SceneError, match="sphere `sphere`: density is -1"):
        scene.add_sphere(body="cube", radius=0.1, density=-1)
    with pytest.raises(tl.SceneError, match=r"sphere `sphere`: body is 'cub', which is no body .* there are: `cube`"):
        scene.add_sphere(body="cub", radius=0.1)
    with pytest.raises(tl.SceneError, match="sphere `sphere` is static and has no density"):
        scene.add_sphere(radius=0.1, density=400)
    stranger = tl.Scene().add_body(name="cube", mass=1)
    with pytest.raises(tl.SceneError, match="body `cube` is of another scene"):
        scene.add_sphere(body=stranger, radius=0.1)
    assert not scene.shapes
    with pytest.raises(AttributeError):
        setattr(body, "masss", 1)  # noqa: B010 (a checker refuses the plain form too)
