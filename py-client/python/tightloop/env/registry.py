"""Finds tasks by name."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

from tightloop.checks.attributes import nearest
from tightloop.checks.signatures import unknown_argument
from tightloop.env.controls import Control
from tightloop.env.task import Task
from tightloop.errors import ArgumentError

#: Module and class of each task that comes with tightloop.
TASKS = {
    "CartPoleBalance": "tightloop.tasks.cartpole:CartPoleBalance",
    "CartPoleSwingUp": "tightloop.tasks.cartpole:CartPoleSwingUp",
    "FrankaReach": "tightloop.tasks.reach:FrankaReach",
    "FrankaPushCube": "tightloop.tasks.push_cube:FrankaPushCube",
    "FrankaPickCube": "tightloop.tasks.pick_cube:FrankaPickCube",
    "FrankaPickCubeDepth": "tightloop.tasks.pick_cube_depth:FrankaPickCubeDepth",
    "FrankaLift": "tightloop.tasks.lift:FrankaLift",
    "QuadrupedVelocityFlat": "tightloop.tasks.quadruped:QuadrupedVelocityFlat",
    "QuadrupedVelocityRough": "tightloop.tasks.quadruped_rough:QuadrupedVelocityRough",
    "HumanoidVelocityFlat": "tightloop.tasks.humanoid:HumanoidVelocityFlat",
    "AntRun": "tightloop.tasks.ant_run:AntRun",
}

#: gymnasium's MuJoCo tasks.
GYMNASIUM_TASKS = {
    "Ant-v5": "tightloop.tasks.gymnasium.ant:Ant",
    "HalfCheetah-v5": "tightloop.tasks.gymnasium.planar:HalfCheetah",
    "Hopper-v5": "tightloop.tasks.gymnasium.planar:Hopper",
    "Humanoid-v5": "tightloop.tasks.gymnasium.humanoids:Humanoid",
    "HumanoidStandup-v5": "tightloop.tasks.gymnasium.humanoids:HumanoidStandup",
    "InvertedDoublePendulum-v5": "tightloop.tasks.gymnasium.pendulums:InvertedDoublePendulum",
    "InvertedPendulum-v5": "tightloop.tasks.gymnasium.pendulums:InvertedPendulum",
    "Pusher-v5": "tightloop.tasks.gymnasium.arms:Pusher",
    "Reacher-v5": "tightloop.tasks.gymnasium.arms:Reacher",
    "Swimmer-v5": "tightloop.tasks.gymnasium.planar:Swimmer",
    "Walker2d-v5": "tightloop.tasks.gymnasium.planar:Walker2d",
}

#: Names by which classes of files were found.
_OF_FILES: dict[type, str] = {}


def gymnasium_id(name: str) -> str:
    """Return the name and version of a task in gymnasium's registry, ``tightloop/FrankaReach-v0``."""
    return f"tightloop/{name}" if name in GYMNASIUM_TASKS else f"tightloop/{name}-v0"


def name_of(task: Task) -> str:
    """Return the name of a task in gymnasium's registry, else ``FILE.py:CLASS`` if made by that, else its class's."""
    if type(task) in _OF_FILES:
        return _OF_FILES[type(task)]
    place = f"{type(task).__module__}:{type(task).__qualname__}"
    names = [gymnasium_id(name) for name, known in (TASKS | GYMNASIUM_TASKS).items() if known == place]
    return names[0] if names else type(task).__qualname__


def make_task(
    task: Task | type[Task] | str, options: Mapping[str, Any], environment: Callable[..., Any] | None = None
) -> Task:
    """Make a task from a task, a class, the name of one of `tightloop.tasks`, or ``FILE.py:CLASS``.

    Args:
        task: The task.
        options: Arguments of its class.
        environment: What the options were given to, whose own arguments are suggested for a wrong one.

    Raises:
        ArgumentError: There is no such task.
        SignatureError: It does not take these options.
    """
    of_environments = [] if environment is None else [*signature(environment).parameters][1:-1]
    if isinstance(task, Task):
        if options:
            what = f"environment of the task {type(task).__name__}, which is made already"
            raise unknown_argument(what, next(iter(options)), of_environments)
        return task
    if isinstance(task, str):
        task = _named(task)
    if not (isinstance(task, type) and issubclass(task, Task)):
        raise ArgumentError(f"task is {task!r}; give a Task, its class or a name")
    taken = signature(task).parameters
    if not any(parameter.kind is Parameter.VAR_KEYWORD for parameter in taken.values()):
        for name in options:
            if name not in taken:
                what = f"environment of the task {task.__name__}"
                raise unknown_argument(what, name, [*of_environments, *taken])
    return task(**options)


def controls_of(task: Task) -> list[Control]:
    """Return the controls of a task.

    Raises:
        ArgumentError: They are no list of controls.
    """
    controls = task.controls()
    own = f"{type(task).__name__}.controls"
    if not isinstance(controls, Sequence) or isinstance(controls, str):
        raise ArgumentError(f"{own}: got {type(controls).__name__}; return a list of controls")
    for control in controls:
        if isinstance(control, type) or not hasattr(control, "apply"):
            raise ArgumentError(f"{own}: got {control!r} in the list; return controls, such as JointTarget(dofs, 0.5)")
    return list(controls)


def _named(task: str) -> type[Task]:
    file, _, name = task.rpartition(":")
    if file.endswith(".py"):
        return _of_file(Path(file), name)
    # the name in gymnasium's registry
    task = task.removeprefix("tightloop/").removesuffix("-v0")
    tasks = TASKS | GYMNASIUM_TASKS
    if task not in tasks:
        known = ", ".join(tasks)
        near = "".join(f"did you mean {other!r}? " for other in nearest(task, tasks)[:1])
        raise ArgumentError(
            f"there is no task {task!r}; {near}there are: {known}, and those of your own, FILE.py:CLASS"
        )
    module, _, name = tasks[task].partition(":")
    return getattr(import_module(module), name)


def _of_file(path: Path, name: str) -> type[Task]:
    if not path.is_file():
        raise ArgumentError(f"there is no file {path}; give the task as FILE.py:CLASS")
    # no installed module has this name
    spec = spec_from_file_location(f"tightloop_task_{path.stem}", path)
    assert spec is not None and spec.loader is not None, "the name ends in .py"
    module = sys.modules[spec.name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    if not isinstance(found := getattr(module, name, None), type):
        raise ArgumentError(f"{path} has no class {name!r}")
    # a class that the file imports keeps its own name
    if found.__module__ == spec.name:
        _OF_FILES[found] = f"{path}:{name}"
    return found
