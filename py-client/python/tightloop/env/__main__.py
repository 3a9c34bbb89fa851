"""``python -m tightloop.env serve TASK``: the worlds of a task in a daemon that outlives those who train in it."""

from __future__ import annotations

import argparse
import signal
from collections.abc import Mapping, Sequence
from typing import Any

from tightloop import _core, system
from tightloop.env.registry import TASKS, make_task
from tightloop.env.rendering import FIELDS
from tightloop.env.simulation import DAEMON_OPTIONS, fields_of
from tightloop.env.task_checks import scene_of
from tightloop.errors import ArgumentError


def arguments_of(
    task: str, options: Mapping[str, Any], extra: Sequence[str], fields: Sequence[str] = ()
) -> tuple[str, list[str]]:
    """Return the scene of a task as TOML, and the arguments of ``tightloop serve`` for it."""
    made = make_task(task, options)
    read = fields_of(made, made.controls())
    arguments = ["--fields", ",".join(dict.fromkeys([*read, *fields]))]
    own = DAEMON_OPTIONS | made.launch_options
    for bound, value in own.pop("bounds", {}).items():
        arguments += [f"--{bound.replace('_', '-')}-max", f"{value}"]
    for name, value in own.items():
        if isinstance(value, bool):
            arguments += [f"--{name.replace('_', '-')}"] if value else []
            continue
        text = value if isinstance(value, str) else ",".join(value) if isinstance(value, Sequence) else f"{value}"
        arguments += [f"--{name.replace('_', '-')}", text]
    return scene_of(made).to_toml(), [*arguments, *extra]


def main() -> int:
    """Serve a task until stopped; returns the exit code of ``tightloop serve``."""
    parser = argparse.ArgumentParser(
        prog="python -m tightloop.env", description="Run environments in a daemon of their own."
    )
    serve = parser.add_subparsers(required=True).add_parser(
        "serve",
        help="run the worlds of a task for trainers that come and go",
        epilog="Example: python -m tightloop.env serve FrankaReach --num-envs 2048 --name reach; then "
        'VectorEnv("FrankaReach", daemon="reach"). `tightloop stop reach` ends it.',
    )
    serve.add_argument("task", help=f"{', '.join(TASKS)}, or your own class as FILE.py:CLASS")
    serve.add_argument("--num-envs", type=int, default=1, help="number of worlds (default 1)")
    serve.add_argument("--name", required=True, help="name under which trainers find the daemon")
    serve.add_argument(
        "--option",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="option of the task, such as control=torque; can be repeated",
    )
    serve.add_argument("--device", default="auto", help="where the physics runs: cpu, gpu or auto (default auto)")
    serve.add_argument("--precision", default="f32", help="f32 or f64 (default f32)")
    serve.add_argument("--threads", type=int, help="threads of a step (default: one per core)")
    serve.add_argument("--render", action="store_true", help="export the fields that trainers with a render_mode need")
    args = parser.parse_args()
    options = dict(option.partition("=")[::2] for option in args.option)
    extra = [
        "--worlds",
        f"{args.num_envs}",
        "--name",
        args.name,
        "--device",
        args.device,
        "--precision",
        args.precision,
    ]
    extra += [] if args.threads is None else ["--threads", f"{args.threads}"]
    try:
        scene, arguments = arguments_of(args.task, options, extra, FIELDS if args.render else ())
    except ArgumentError as problem:
        parser.exit(2, f"error: {problem}\n")
    # `tightloop serve -` reads the scene from standard input
    system.give_standard_input(scene.encode())
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.command_line(["tightloop", "serve", "-", *arguments])


if __name__ == "__main__":
    raise SystemExit(main())
