"""The public callables of environments, of the viewer and of datasets, as `public_calls.py` lists them."""

from __future__ import annotations

from public_call import Call

from tightloop import datasets, env, view

STATES = "this task defines no states: tests/python/tasks/test_gymnasium_tasks.py has one that does"
ENV_CALLS: dict[str, Call] = {
    "VectorEnv": Call(
        lambda _: env.VectorEnv,
        {
            "task": "task",
            "num_envs": "count",
            "autoreset_mode": "choice",
            "copy": "flag",
            "slots": "slots",
            "device": "choice",
            "precision": "choice",
            "threads": "count",
            "max_episode_steps": "steps",
            "on_nan": "choice",
            "dict_observations": "flag",
            "daemon": "label",
            "first_env": "index",
            "render_mode": "choice",
        },
        {"task": "CartPoleBalance"},
    ),
    "VectorEnv.reset": Call(lambda world: world.envs.reset, {"seed": "env seed", "options": "options"}),
    "VectorEnv.send": Call(lambda world: world.envs.send, {"actions": "actions"}),
    "VectorEnv.step": Call(lambda world: world.envs.step, {"actions": "actions"}),
    "VectorEnv.set_state": Call(
        lambda world: world.envs.set_state, {}, {}, dict.fromkeys(("qpos", "qvel", "mask"), STATES)
    ),
    "Env": Call(lambda _: env.Env, {"task": "task"}),
    "Env.set_state": Call(lambda world: world.single.set_state, {}, {}, dict.fromkeys(("qpos", "qvel"), STATES)),
    "Env.reset": Call(lambda world: world.single.reset, {"seed": "single seed", "options": "options"}),
    "Env.step": Call(lambda world: world.single.step, {"action": "action"}),
    "JointTorque": Call(
        lambda _: env.JointTorque,
        {"dofs": "dofs", "scale": "per dof", "hold": "flag"},
        {"dofs": ["arm/fr3_joint1"], "scale": 1.0},
    ),
    "JointTarget": Call(
        lambda _: env.JointTarget,
        {"dofs": "dofs", "scale": "per dof", "limit": "positive"},
        {"dofs": ["arm/fr3_joint1"], "scale": 1.0},
    ),
    "JointDelta": Call(
        lambda _: env.JointDelta,
        {"dofs": "dofs", "scale": "per dof", "lead": "positive"},
        {"dofs": ["arm/fr3_joint1"], "scale": 1.0},
    ),
    "Gripper": Call(
        lambda _: env.Gripper,
        {"dofs": "dofs", "low": "number", "high": "number", "binary": "flag"},
        {"dofs": ["arm/fr3_joint1"], "low": 0.0, "high": 1.0},
    ),
    "EndEffectorDelta": Call(
        lambda _: env.EndEffectorDelta,
        {"site": "text", "dofs": "dofs", "pos_scale": "number", "rot_scale": "number"},
        {"site": "tip", "dofs": ["arm/fr3_joint1"], "pos_scale": 1.0},
    ),
    "ActuatorTarget": Call(
        lambda _: env.ActuatorTarget,
        {"start": "actuators", "scale": "per dof", "limit": "positive"},
        {"start": [0.0], "scale": 1.0},
    ),
    "ActuatorControl": Call(
        lambda _: env.ActuatorControl, {"ranges": "action ranges", "clips": "flag"}, {"ranges": [(-1.0, 1.0)]}
    ),
    "Observed": Call(
        lambda _: env.Observed,
        {
            "name": "text",
            "low": "observed bound",
            "high": "observed bound",
            "size": "count",
            "unit": "text",
            "history": "count",
        },
        {"name": "angle", "low": -1.0, "high": 1.0},
        {
            "source": "terms, which planning/test_policy_rollout.py tries",
            "shape": "lengths, which cameras/test_dict_observations.py tries",
            "delay": "steps, which env/test_delayed_parts.py tries",
        },
    ),
    "Push": Call(
        lambda _: env.Push,
        {"body": "text", "impulse": "positive", "interval": "interval"},
        {"body": "arm/hand", "impulse": 1.0, "interval": (1.0, 2.0)},
    ),
    "make_groups": Call(
        lambda _: env.make_groups,
        {
            "task": "task",
            "num_envs": "count",
            "groups": "count",
            "device": "choice",
            "precision": "choice",
            "threads": "count",
        },
        {"task": "CartPoleBalance", "num_envs": 4},
    ),
}
ENV_LEFT = {
    "AutoresetMode": "gymnasium's",
    "Mirror": "environments check it; test_task_features.py tries wrong ones",
    "Names": "environments make it",
    "policy_metadata": "its argument is an environment; test_policy_metadata.py tries others",
    "Task": "users derive from it; test_env_tasks.py tries wrong ones",
    "Worlds": "environments make it",
}
VIEW_CALLS: dict[str, Call] = {
    "Film": Call(
        lambda _: view.Film,
        {
            "out": "path",
            "size": "size",
            "fps": "positive",
            "worlds": "some worlds",
            "world": "index",
            "camera": "camera",
            "kind": "choice",
            "contacts": "flag",
            "speed": "positive",
        },
    ),
    "film": Call(
        lambda _: view.film,
        {
            "out": "path",
            "seconds": "positive",
            "at": "least 0",
            "worlds": "some worlds",
            "world": "index",
            "camera": "camera",
        },
        {},
        {"progress": "a function of the caller's"},
    ),
    "Picture.anew": Call(
        lambda world: world.picture.anew, {"width": "count", "height": "count"}, {"width": 64, "height": 48}
    ),
    "Picture.render": Call(
        lambda world: world.picture.render,
        {"worlds": "some worlds", "camera": "camera", "world": "index", "contacts": "flag"},
        {},
        {name: "test_picture.py tries them" for name in ("shown", "ghost", "goals")},
    ),
    "Camera": Call(
        lambda _: view.Camera,
        {"position": "triple", "target": "triple", "fov": "positive", "up": "triple"},
        {"position": (1.0, 0.0, 0.0), "target": (0.0, 0.0, 0.0)},
    ),
}
VIEW_LEFT = {"Picture": "its parts are made by tightloop.view.parts"}

EPISODES = {
    "recording": "path",
    "fields": "names",
    "action": "names",
    "joints": "names",
    "worlds": "some worlds",
    "fps": "positive",
    "min_steps": "count",
    "cameras": "optional scene",
}
DATASET_CALLS: dict[str, Call] = {
    "episodes": Call(lambda _: datasets.episodes, EPISODES),
    "export": Call(
        lambda _: datasets.export,
        EPISODES | {"out": "path", "to": "choice", "task": "text"},
        {"to": "hdf5"},
        {
            "rewards": "test_export_command.py tries them",
            "dones": "test_export_command.py tries them",
            "progress": "a function of the caller's",
        },
    ),
}
DATASET_LEFT = {"Episode": "episodes() makes them", "Export": "export() makes it"}
