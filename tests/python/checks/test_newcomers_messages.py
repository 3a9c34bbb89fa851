"""What newcomers do wrong: each mistake is an error of ours that names the culprit and the cure, and nothing is silent.

A case is a line of Python, what the message says of it, and the error. `test_wrong_inputs.py` tries values of each
argument, and `test_wrong_calls.py` the arguments of each call.
"""

from __future__ import annotations

import contextlib
import copy
import pickle
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY, URDF
from tightloop import env, view

CASES = r"""
# orders of calls
closed.step()                                             | was closed; launch or attach again
closed.reset()                                            | was closed; launch
closed.forward()                                          | was closed; launch
closed.snapshot()                                         | was closed; launch
closed.restore(snapshot)                                  | was closed; launch
closed.latest()                                           | was closed; launch
closed.picture()                                          | was closed; launch
closed.view()                                             | was closed; launch
closed.record("run.tlrec")                                | was closed; launch
closed.write(joint_q=0)                                   | was closed; launch
second.step()                                             | controlled by process .*wait until it releases
second.reset()                                            | controlled by process .*wait
second.params.write(gravity=(0, 0, -1))                   | controlled by process .*wait
sim.recv()                                                | call send first
fresh.step(np.zeros((2, 1)))                              | no episode has begun; call reset first
fresh.recv()                                              | call send first
ended.step(np.zeros((1, 1)))                              | was closed
ended.reset()                                             | was closed
single.step([0.0])                                        | call reset first
tl.attach("nobody")                                       | no daemon named "nobody".*running: .*tightloop serve
tl.launch(scene(), worlds=1, name=sim.name)               | already running.*choose another name
pickle.dumps(sim)                                         | tightloop\.attach
copy.deepcopy(sim)                                        | tightloop\.attach
pickle.dumps(frame)                                       | frame\.copy\(\)
copy.copy(frame)                                          | frame\.copy\(\)
tl.Sim()                                                  | Sim: `tightloop\.launch` and `tightloop\.attach` make it
tl.Robot()                                                | Robot: `Scene\.add_urdf`
tl.Groups()                                               | Groups: `tightloop\.launch\(groups=…\)`
tl.Snapshot(b"x")                                         | Snapshot: `Sim\.snapshot` and `Snapshot\.load`
# worlds that are not there, masks, seeds
sim.reset(mask=[0])                                       | mask.*is not bool; give an array with True
sim.reset(mask=[True])                                    | mask: expected shape \(2,\)
sim.reset(mask=5)                                         | mask: 5 is not bool
sim.reset(seed=1.5)                                       | seed is 1\.5; give a whole number
sim.reset(seed=[1])                                       | seed: 1 seeds for 2 worlds
sim.restore("snapshot")                                   | restore: snapshot is str; give
sim.restore(snapshot, worlds=[7])                         | worlds.*is not bool; give
sim.restore(snapshot, from_world=9)                       | restore: from_world is 9; the snapshot has worlds 0 to 1
sim.picture(worlds=[9])                                   | no world 9.*there are 2
sim.picture(world=1)                                      | no argument `world`; did you mean `worlds`
sim.picture(camera="left")                                | camera is 'left'; give .*three-quarter
sim.picture(size=640)                                     | size is 640; give width and height
sim.picture(frame=frame.joint_q)                          | picture: frame is .*give a frame
envs.reset(seed=[1])                                      | seed has 1 entries for 2 environments
envs.reset(options={"mask": [True, False]})               | 'mask', which is unknown; there are: level, reset_mask
envs.reset(options={"reset_mask": [1, 0]})                | reset_mask: give .*bool
single.reset(seed=-1)                                     | seed is -1; give
# shapes, dtypes and units
sim.step(joint_target_q=0)                                | joint_target_q: expected shape \(2, 15\)
sim.step(joint_target_q=np.zeros((2, 8)))                 | joint_target_q: expected shape
sim.step(joint_target_q={"arm": np.zeros(7)})             | joint_target_q of robot `arm`: expected
sim.step(joint_target_q={"robot": np.zeros(9)})           | no robot `robot`; there are: `arm`
sim.step(joint_target_q=[90] * 15)                        | `joint_target_q` is 90 .*push it with joint_f
sim.step(joint_f="fast")                                  | joint_f: 'fast' .*give float32
sim.step(joint_f=np.zeros(15, complex))                   | joint_f: .*complex128.*give float32
sim.step(ctrl=[0] * 9)                                    | ctrl: nothing of this scene takes it; leave it out
sim.step(mocap_pos=[0, 0, 0])                             | mocap_pos: no model .*leave it out
sim.step(joint_targets=0)                                 | no argument `joint_targets`; did you mean `joint_target_q`
sim.write(joint_q=np.zeros(9))                            | joint_q: expected .*Robot `arm` has as many: give
sim.write(joint_q={"cube": np.zeros(6)})                  | joint_q of robot `cube`: expected shape
sim.write({"arm": np.zeros(9)})                           | Sim\.write: .*by name, such as joint_q=
sim.rays([0, 0, 0], [0, 0, 1])                            | no geoms.*add a MuJoCo model
sim.forward_kinematics(np.zeros((2, 9)))                  | joint_q has shape \(2, 9\); give
sim.latest(timeout=-1)                                    | timeout is -1; it must be
dynamics.mass_matrix(np.zeros(3))                         | joint_q has shape \(3,\); give
dynamics.mass_matrix(frame)                               | joint_q: .*give float32
envs.step(np.zeros(2))                                    | actions: expected .*shape \(2, 1\)
envs.step([[0], [1], [2]])                                | actions: expected
envs.step("left")                                         | actions: expected
single.step(0.5)                                          | action is 0\.5; give real numbers of shape \(1,\)
assets.policy("FrankaReach")(np.zeros(3))                 | policy: obs has shape \(3,\); give \(worlds, \d+\)
# single joints by name and pattern
sim.step(joint_target_q={"arm/fr3_jiont1": 0.1})          | nothing matches; did you mean `arm/fr3_joint1`
sim.step(joint_target_q={"amr/fr3_joint1": 0.1})          | there is no robot `amr`; did you mean `arm`
sim.step(joint_target_q={"fr3_joint1": 0.1})              | no robot `fr3_joint1`; did you mean `arm/fr3_joint1`
sim.step(joint_target_q={"arm/(": 0.1})                   | is no pattern .*give names or regular expressions
sim.step(joint_target_q={"arm": {"leg_.*": 0.1}})         | nothing matches; there are: arm/fr3_joint1
sim.step(joint_target_q={"arm": {1: 0.1}})                | robot `arm` has the key 1; give names or patterns
sim.step(joint_target_q={0: 0.1})                         | has the key 0; give names of robots or of joints
sim.step(joint_target_q={"arm/fr3_joint1": [1, 2, 3]})    | of `arm/fr3_joint1`: .* shape \(2,\); got \(3,\)
sim.step(joint_target_q={"arm/fr3_joint1": "far"})        | of `arm/fr3_joint1`: 'far' is not a real number
sim.step(joint_f={"arm/.*1": 1, "arm/fr3_joint[12]": 2})  | of `arm/fr3_joint1` has two values.*give one
sim.step(ctrl={"arm/fr3_joint1": 1})                      | ctrl: nothing of this scene takes it
sim.write(joint_q={"cube/free.qx": 0.1})                  | a part of a quaternion; give `cube/free\.qx` to `\.qw`
# parameters
sim.params.shape_mu                                       | `shape_mu`.*name it at launch: params=\("shape_mu",\)
sim.step(body_f=np.zeros((2, 12, 6)))                     | `body_f`.*name it at launch
sim.params.friction                                       | 'friction'; did you mean `shape_mu`
sim.params["gravity"]                                     | no entries, such as 'gravity'.*write params\.gravity
sim.step(joint_target_q=np.zeros((3, 9)))                 | got \(3, 9\)\. The first axis is the worlds, which are 2
sim.params.write(gravity=(0, 0, -9.81, 0))                | gravity: expected shape
# attributes and entries
sim.joint_q                                               | no attribute 'joint_q'; .*sim\.forward\(\)\.joint_q
setattr(sim, "joint_q", 0)                                | no attribute 'joint_q'; `write` and arguments of `step`
setattr(sim, "worlds", 5)                                 | `worlds` can only be read
sim.obs                                                   | 'obs'; did you mean `forward`
sim.render()                                              | 'render'; did you mean `picture` or `view`
sim.dofs["leg"]                                           | no robot 'leg'; there are: arm, cube
frame["joint_q"]                                          | no entries, such as 'joint_q'.*frame\.joint_q\[world\]
frame.joint_pos                                           | no field `joint_pos`; did you mean `joint_q`\?
frame.contact_force                                       | no `contact_force`; add .*`fields` at launch
frame.contact_forces                                      | did you mean `contact_force`\? Add it to `fields`
frame.copy().joint_pos                                    | no field `joint_pos`; did you mean `joint_q`
frame.joint_q.fill(0)                                     | read-only.*\.copy\(\)
frame.joint_q.sort()                                      | read-only.*\.copy\(\)
frame.joint_q.__setitem__(0, 1)                           | read-only.*sim\.write
frame.status.__ior__(1)                                   | read-only.*\.copy\(\)
mine.robots["am"]                                         | no robot 'am'; did you mean `arm`
mine.robots.arm                                           | robot by name has no attribute 'arm'; write \['arm'\]
mine.bodies["box"]                                        | no body 'box'; there are: cube
mine.sites["tip"]                                         | no site 'tip'; there is none yet
mine.arm                                                  | no attribute 'arm'; did you mean
mine.robots["arm"].kp                                     | 'kp'; did you mean `joint_target_ke`
envs.obs                                                  | VectorEnv has no attribute 'obs'; .*
envs.num_env                                              | 'num_env'; did you mean `num_envs`
tl.nothing                                                | `nothing`; there are: .*launch
view.flim                                                 | `flim`; did you mean `film`
env.VectorEnvs                                            | `VectorEnvs`; did you mean `VectorEnv`
# files
mine.add_urdf(folder / "hello.txt")                       | hello\.txt:1:1: broken XML: .*<robot>
mine.add_urdf(folder / "empty.urdf")                      | the file is empty; a URDF file holds
mine.add_urdf(folder)                                     | it is not a file; give
mine.add_urdf("robot.usd")                                | robot\.usd: cannot be read.*give the path
mine.add_urdf(CART)                                       | cart\.xml is MuJoCo's MJCF: Scene\.from_mujoco
mine.add_urdf(folder / "macro.urdf")                      | xacro.*run `xacro` on the file
mine.add_urdf(URDF, "arm")                                | `path` without a name and got 2; .*name=
mine.add_urdf(URDF, name="arm")                           | `arm` is taken; give another
mine.add_urdf(URDF, name="my arm")                        | 'my arm': use letters
mine.add_mesh(path=folder / "hello.txt")                  | `\.txt` is not read; convert it
mine.add_mesh(path=folder)                                | no ending; name the format
tl.Scene.load(folder)                                     | it is not a file; give
tl.Scene.load(folder / "hello.txt")                       | hello\.txt: .*give a scene file
tl.Scene.load(URDF)                                       | hand\.urdf is a URDF file: scene\.add_urdf
tl.Scene.load(CART)                                       | MJCF: Scene\.from_mujoco\(path\) or scene\.add_mujoco
tl.Scene.load(MESH)                                       | part\.stl is a mesh: scene\.add_mesh
mine.add_urdf(MESH)                                       | part\.stl is a mesh: scene\.add_mesh
mine.add_urdf(folder / "some.toml")                       | is a scene file: Scene\.load
mine.add_urdf(folder / "some.usda")                       | is USD: export the robot as URDF or MJCF
mine.add_urdf(folder / "some.sdf")                        | is SDFormat: convert it
mine.add_urdf("<robot name='a'/>")                        | is XML text; write it to a file
mine.add_urdf("<mujoco/>")                                | is XML text; .*mujoco\.MjSpec\.from_string
mine.add_mujoco(MESH)                                     | part\.stl is a mesh: scene\.add_mesh
mine.add_mujoco(folder / "some.toml")                     | is a scene file: Scene\.load
mine.add_mujoco(folder / "meshes.urdf")                   | is a URDF file: scene\.add_urdf
mine.add_mesh(path=URDF)                                  | is a URDF file: scene\.add_urdf
mine.add_mesh(path=CART)                                  | MJCF: Scene\.from_mujoco
tl.Scene.from_mujoco(folder / "hello.txt")                | hello\.txt: MuJoCo cannot compile it
tl.Scene.from_mujoco("<mujoco/>")                         | is XML text; give .* MJCF file.*from_xml_string
mine.save(folder)                                         | cannot be written: .*name a file
mine.save(folder / "no" / "scene.toml")                   | cannot be written: .*a folder that you may write to
snapshot.save(folder / "no" / "x")                        | cannot be written
tl.Snapshot.load(folder)                                  | it is not a file; give the path of a snapshot
tl.Snapshot.load(folder / "hello.txt")                    | no snapshot; give
view.Film(folder / "x.avi", sim)                          | 'x\.avi'; it ends in \.png
view.Film(folder / "x.gif", "sim")                        | film: sim is 'sim'; give a Sim
view.Film(sim, folder / "x.gif")                          | film: out is Sim.*give a path
view.film(folder / "hello.txt", folder / "x.gif")         | is no recording; give
env.VectorEnv("my_task.py:Task", 2)                       | no file my_task\.py; give
# scenes
tl.launch(scene(), worlds=1, params={"shape_mu": 0.1})    | params is a dict; .*sim\.params\.write
tl.Scene(decimation=4)                                    | did you mean `substeps`
mine.add_site(name="tcp", body="fr3_hand")                | no body .*A link of a robot is named with it, as in `arm/…`
tl.Scene(gravity=-9.81)                                   | gravity is -9\.81; give 3 numbers
tl.Scene(dt="1ms")                                        | dt is '1ms'; give a number
tl.Scene(timestep=0.01)                                   | `timestep`; did you mean `dt`
mine.add_box(half_extents=0.1)                            | half_extents is 0\.1; give 3 numbers
mine.add_box(size=(1, 1, 1))                              | `size`; `half_extents` are half of each edge
mine.add_box(half_extents=(1, 1, 1), body="cub")          | body is 'cub'.*there are: `cube`
mine.add_ground(pos=(0, 0, 1))                            | no argument `pos`.*add_ground\(\*, z=…
mine.robots["arm"].order(["fr3_joint1"])                  | order: names lacks
setattr(mine.robots["arm"], "joint_q", [1, 2, 3])         | joint_q has 3 values; expected 9
setattr(mine.robots["arm"], "joint_q", {"joint1": 0.5})   | 'joint1', .*did you mean `fr3_joint1`
mine.randomize(joint_q={"arm": (0, 1)})                   | \(0, 1\); give a tightloop\.Uniform
tl.Uniform((0, 1))                                        | Uniform: `high` is missing
tl.launch(scene(), worlds=1, fields=("joint_pos",))       | there is no such field; did you mean `joint_q`
tl.launch(scene(), worlds=1, params=("frictions",))       | no such parameter; did you mean .*`joint_friction`
tl.launch(scene(), worlds=1, seed=1)                      | no argument `seed`; `sim\.reset\(seed=…\)`
tl.launch(scene(), worlds=1, headless=True)               | no argument `headless`; leave it out: .*`sim\.view\(\)`
tl.launch(scene(), worlds=1, render=True)                 | no argument `render`; a simulation has no window
tl.launch(scene(), worlds=1, dt=0.01)                     | no argument `dt`; it is an argument of `tightloop\.Scene`
tl.Scene(worlds=4)                                        | `worlds`; it is an argument of `tightloop\.launch`
mine.add_urdf(URDF, joint_q=[0] * 9)                      | `joint_q`; set it on the robot .*`robot\.joint_q = …`
mine.add_urdf(URDF, stiffness=100)                        | set it on the robot .*`robot\.joint_target_ke = …`
mine.randomize(params={"shape_mus": tl.Uniform(0, 1)})    | no such parameter; did you mean `shape_mu`
mine.randomize(joint_q={"arm/fr3_jiont1": tl.Uniform(0, 1)}) | no joint 'fr3_jiont1'; did you mean `fr3_joint1`
mine.randomize(joint_q={"amr": tl.Uniform(0, 1)})         | no robot or body 'amr'; did you mean `arm`
mine.randomize(body_q={"cube": {"rz": tl.Uniform(0, 1)}}) | no part 'rz'; did you mean `yaw`
mine.filter_contacts("arm", "cub")                        | 'cub', which is no .*did you mean `cube`
tl.launch("scene.toml", worlds=1)                         | scene is str; give .*Scene\.load
tl.launch(tl.Scene, worlds=1)                             | scene is type; give
tl.launch(scene(), worlds=1, device="cuda")               | "cuda": unknown; use auto, cpu or gpu
tl.launch(scene(), worlds=1, precision="float32")         | "float32": unknown; use f32
tl.launch(scene(), worlds=1, fields="joint_q")            | fields is 'joint_q'; give a list
tl.launch(scene(), worlds=3, groups=2)                    | cannot be shared out evenly; ask for a number that divides
tl.launch(scene(), worlds=10**9)                          | are needed.*use fewer worlds
view.Camera((1, 1, 1), (1, 1, 1))                         | target is .*give another point
view.Camera((0, 0, 1), (0, 0, 0), up=(0, 0, 0))           | up has no direction; give one
# environments
env.VectorEnv("FrankaRech", 2)                            | no task 'FrankaRech'; did you mean 'FrankaReach'
env.VectorEnv("CartPoleBalance", 2, daemon=sim.name)      | runs another scene.*start it with
env.VectorEnv("CartPoleBalance", 2, render_mode="rgb")    | 'rgb'; give one of
env.VectorEnv(env.Task(), 2)                              | task Task has no `\w+`; .*define it
env.Env("CartPoleBalance", num_envs=2)                    | Env: num_envs is not taken.*leave it out
env.Env("CartPoleBalance", num_env=2)                     | Env: num_env is not taken.*leave it out
env.VectorEnv("CartPoleBalance", 2, seed=1)               | no argument `seed`; `envs\.reset\(seed=…\)`
env.make_groups("CartPoleBalance", 5, 2)                  | 5 environments .*give a divisor
env.JointTarget("arm/j", 1.0)                             | dofs is 'arm/j'; give a list
"""
TRIED = [
    tuple(part.strip() for part in line.split(" | ", 1))
    for line in CASES.strip().splitlines()
    if not line.startswith("#")
]


def scene() -> tl.Scene:
    made = tl.Scene(substeps=1)
    made.add_urdf(URDF, name="arm").joint_q = [0, 0, 0, -2.4, 0, 2.4, 0.8, 0.04, 0.04]
    made.add_cube()
    return made


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Any]]:
    folder = tmp_path_factory.mktemp("files")
    (folder / "hello.txt").write_text("hello")
    (folder / "empty.urdf").write_text("")
    (folder / "macro.urdf").write_text('<robot name="m"><link name="a"/><xacro:include filename="b"/></robot>')
    (folder / "meshes.urdf").write_text(
        '<robot name="m"><link name="a"><collision><geometry><mesh filename="none.stl"/></geometry></collision></link>'
        "</robot>"
    )
    (folder / "part.stl").write_bytes(bytes(84))
    (folder / "some.toml").write_text("dt = 0.01")
    (folder / "some.usda").write_text("#usda 1.0")
    (folder / "some.sdf").write_text('<?xml version="1.0"?><sdf version="1.6"/>')
    closed = tl.launch(scene(), worlds=1)
    closed.close()
    ended = env.VectorEnv("CartPoleBalance", 1)
    ended.reset()
    ended.close()
    with (
        tl.launch(scene(), worlds=2, params=("gravity",)) as sim,
        contextlib.closing(env.VectorEnv("CartPoleBalance", 2)) as envs,
        contextlib.closing(env.VectorEnv("CartPoleBalance", 2)) as fresh,
        contextlib.closing(env.Env("CartPoleBalance")) as single,
    ):
        envs.reset(seed=0)
        frame = sim.step()
        with tl.attach(sim.name) as second:
            made = {"sim": sim, "second": second, "closed": closed, "frame": frame, "snapshot": sim.snapshot()}
            made |= {"envs": envs, "fresh": fresh, "single": single, "ended": ended, "dynamics": tl.Dynamics(scene())}
            made |= {"np": np, "tl": tl, "env": env, "view": view, "assets": tl.assets, "pickle": pickle, "copy": copy}
            yield made | {"folder": folder, "scene": scene, "URDF": URDF, "CART": CART, "MESH": folder / "part.stl"}


CART = REPOSITORY / "examples/assets/cart/cart.xml"


@pytest.mark.parametrize(("line", "said"), TRIED, ids=[line for line, _ in TRIED])
def test_a_mistake_is_named_with_its_cure(line: str, said: str, names: dict[str, Any]) -> None:
    with pytest.raises(tl.TightloopError) as caught:
        eval(line, names | {"mine": scene()})
    assert re.search(said, str(caught.value), re.DOTALL), str(caught.value)


def test_there_are_a_hundred_mistakes() -> None:
    assert len({line for line, _ in TRIED}) >= 100


def test_a_robot_without_joints_is_served(tmp_path: Path) -> None:
    from tightloop.files.scenes import scene_of

    (tmp_path / "stone.urdf").write_text('<robot name="stone"><link name="only"/></robot>')
    made = scene_of(tmp_path / "stone.urdf")
    assert made.robots["stone"].joint_range.shape == (0, 2)


def test_dicts_by_name_are_dicts() -> None:
    for made in (scene().robots, copy.deepcopy(scene()).robots):
        assert made
    assert "leg" not in scene().robots and scene().robots.get("leg") is None
    with pytest.raises(KeyError, match=r"^there is no robot 'leg'; there are: arm$"):
        scene().robots["leg"]
