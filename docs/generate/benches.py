"""Words of the performance page: what each bench measures, which columns stand on the page, what to keep in mind."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Bench:
    """One bench on the page.

    Attributes:
        title: Heading of its section.
        text: What it measures, and its caveats.
        columns: Columns of the file that are shown, with their headings; all where it is empty.
        words: Cells of the file, and what the page says for them.
    """

    title: str
    text: str
    columns: dict[str, str] = field(default_factory=dict)
    words: dict[str, str] = field(default_factory=dict)


_COMMANDS = {"one": "identical", "own": "independent", "yes": "identical", "no": "independent"}
_BESIDE_MUJOCO = {
    "mujoco_steps_per_s": "MuJoCo steps/s",
    "tightloop_steps_per_s": "tightloop steps/s",
    "median_ratio": "ratio",
    "asked_ratio": "asked",
}

BENCHES = {
    "peers": Bench(
        "Arm without contacts, beside MuJoCo C on one thread",
        """The bench runs the two demos of the lesson. `sixteen` (AVX-512) and `eight` (AVX2) are worlds per register.

- Both sides use one model, one time step, one solver and the same commands.
- Over the 3 s of the target demo, tightloop stays within 2·10⁻⁶ rad of MuJoCo. Rounding MuJoCo's own state to float32
  moves it as far. `tests/python/docs/test_newton_lesson.py` checks this.
""",
        {
            "demo": "demo",
            "commands": "commands",
            "side": "side",
            "lanes": "lanes",
            "precision": "precision",
            "worlds": "worlds",
            "median_steps_per_s": "steps/s",
            "median_ratio": "ratio",
        },
        _COMMANDS,
    ),
    "realtime": Bench(
        "A loop of 1 kHz in real time",
        """A Franka arm above its table, with frames of 2 substeps. Controllers answer at once. The bare loop has two
threads that sleep until shortly before a frame is due, and spin; it computes nothing. All sides take turns.

- `missed_percent` counts frames that left more than 0.1 ms after they were due, or whose command was late.
- The other columns are from when a frame was due until the controller had it.
""",
    ),
    "planner": Bench(
        "A planner beside a loop of 1 kHz",
        """A Franka arm with frames of 2 substeps. Its daemon and its controller share one core, at real-time
priority. Predictive sampling with 128 worlds and 25 frames plans all the time on the other core. Both sides take turns.

- A deadline is missed where a frame left more than 0.1 ms after it was due, or where its command was late.
- Times are from when a frame was due until the controller had it.
""",
        {
            "side": "side",
            "frames": "frames",
            "missed_percent": "missed [%]",
            "late": "late commands",
            "p50_us": "median [µs]",
            "p99_us": "99 % [µs]",
            "p999_us": "99.9 % [µs]",
            "worst_us": "worst [µs]",
            "plans_per_s": "plans/s",
            "more_missed_points": "more missed [points]",
            "asked_points": "asked [points]",
        },
    ),
    "contacts": Bench(
        "Arm with contacts, beside MuJoCo C on one thread",
        """The arm is an FR3. `robot` below a table says which: the published one has its meshes as convex hulls, the
project's own one has boxes, cylinders and spheres. The demos:

- `torque`: recorded torques above a table
- `grasp`: a recorded grasp of a cube
- `random`: random targets around that grasp

Keep in mind:

- MuJoCo keeps all vertices of a hull, tightloop at most 64. So the two find different contact points on meshes.
- The solver dominates under random targets. A SIMD register waits for the slowest of its 16 worlds, and each world can
  need a dozen Newton iterations when contacts begin or slide.
- For that reason, tightloop groups worlds with similar contacts in the same registers.
""",
        {"demo": "demo", "worlds_alike": "commands", "worlds": "worlds", **_BESIDE_MUJOCO},
        _COMMANDS,
    ),
    "legged": Bench(
        "Floating robots, beside MuJoCo C on one thread",
        """The project's own quadruped and humanoid, in `benches/robots`, have position targets, joint limits
and damping, but no contacts. All commands are independent. `dofs` includes the 6 of the base.

- Without dry friction, the solver runs only where a joint meets its limit. With it, the solver runs in every step.
""",
        {"robot": "robot", "dofs": "dofs", "worlds": "worlds", **_BESIDE_MUJOCO},
    ),
    "mujoco_models": Bench(
        "MuJoCo models, beside mjbatch on one thread",
        """Published robots as MuJoCo models, with independent random controls. All sides begin with robots that
stand or lie on the ground. mjbatch runs MuJoCo C.

- `steps per call` is 1, or the physics steps per control step of the model's own task.
- `contacts` and `iterations` are means over tightloop's worlds, as MuJoCo C finds them. Its solver starts cold there.
- The range shows the smallest and the largest ratio of a turn. `CPU ratio` compares steps per second of CPU time.
- `Batch` is `tightloop.mujoco.Batch`, which has the interface of mjbatch.
- mjbatch computes in double precision with its own release of MuJoCo, tightloop in single precision.
- gymnasium's models use RK4, with four evaluations per step. Its Humanoid asks for PGS with 50 iterations. MuJoCo runs
  that. tightloop solves the same problem with Newton's method.
- The Shadow hand asks for one iteration of the solver. So the solver has not converged, on any side.
- tightloop keeps up to four points per pair of meshes, and so has more contacts in the rows of the Shadow hand.
- No side evaluates sensors. In the row `mjlab Go1, feet only`, no other part collides.
- In rows with `heap`, all parts of a robot collide. It falls, lies on the ground and moves about under small random
  controls. `pyramidal` has an `impratio` of 1. `elliptic 1000` has elliptic cones and an `impratio` of 1000.
""",
        {
            "model": "model",
            "dofs": "dofs",
            "steps_per_call": "steps per call",
            "worlds": "worlds",
            "contacts": "contacts",
            "mujoco_iterations": "iterations",
            "mjbatch_steps_per_s": "mjbatch steps/s",
            "tightloop_steps_per_s": "tightloop steps/s",
            "median_ratio": "ratio",
            "ratio_min": "from",
            "ratio_max": "to",
            "cpu_ratio": "CPU ratio",
            "batch_steps_per_s": "Batch steps/s",
            "batch_ratio": "ratio of Batch",
            "faulted": "faulted worlds",
        },
    ),
    "ik": Bench(
        "Inverse kinematics, beside mink on one core",
        """Random reachable poses of the FR3's hand, to 1 mm and 0.1°. Both start at one position and restart at random.

- MuJoCo's kinematics check the solutions of both sides.
- mink solves one pose after another, with daqp and the best of several parameters. tightloop takes all poses in one
  call.
- tightloop's `f32` has 8 or 16 poses in a register, `f64` has one.
""",
        {
            "side": "side",
            "median_solves_per_s": "solves/s",
            "reached_percent": "reached [%]",
            "iterations": "iterations",
            "restarts": "restarts",
            "median_ratio": "× mink",
            "asked_ratio": "asked ×",
        },
    ),
    "round_trip": Bench(
        "Latency of one world",
        """The time of one control frame of 8 physics steps, for one world on one thread.

- Each side had a core of its own. The time grows where another program uses one of the two cores.
""",
        {"side": "side", "p50_us": "median [µs]", "p99_us": "99 % [µs]", "p999_us": "99.9 % [µs]"},
    ),
    "clients": Bench(
        "Round trip of each client",
        """The time from a command of a client to its frame, for one free body. The daemon has one thread.
""",
        {"client": "client", "p50_us": "median [µs]", "p99_us": "99 % [µs]", "asked_p50_us": "asked median [µs]"},
    ),
    "ray_cluster": Bench(
        "Environments on a Ray cluster",
        """A step of an environment, and the data that crosses for it. [Many machines](../use/clusters.md) describes it.

- The three nodes of the cluster are on one machine, so no network is measured. Daemons have one thread each.
- Other programs used the machine as well.
""",
        {
            "task": "task",
            "worlds": "worlds",
            "side": "side",
            "sent_kB": "sent [kB]",
            "received_kB": "received [kB]",
            "p50_ms": "median [ms]",
            "p99_ms": "99 % [ms]",
            "learner_share": "learner's share",
        },
    ),
    "env": Bench(
        "Environments, beside EnvPool and gymnasium",
        """All sides step a pick-and-place task with random actions, on all cores, with NumPy in and out. Resets count.

- The EnvPool task is its nearest one, not the same. Of its arm, only the hand and the fingers collide. Its solver stops
  after 5 iterations.
- The `AsyncVectorEnv` steps the same scene, observations and rewards over MuJoCo C.
- `ring` is `copy=False`: results are views of a ring of buffers.
- tightloop runs two groups of worlds. One steps while the other receives its actions.
- Ratios compare physics steps per second by the clock. The last two columns compare them per second of CPU time.
""",
        {
            "side": "side",
            "environments": "environments",
            "env_steps_per_s": "env steps/s",
            "physics_steps_per_s": "physics steps/s",
            "physics_ratio": "ratio",
            "asked_physics_ratio": "asked",
            "physics_steps_per_core_s": "physics steps per CPU second",
            "physics_ratio_per_core_s": "ratio per CPU second",
        },
    ),
    "gymnasium_tasks": Bench(
        "gymnasium's MuJoCo tasks, beside EnvPool and gymnasium on one core",
        """Each side has one core for all of its processes. It steps random actions with NumPy in and out, and episodes
that end begin anew.

- Observations are gymnasium's, in float64. The physics of tightloop is in float32.
- EnvPool's tasks are versions 4: its `Ant-v4` observes 27 numbers, tightloop's `Ant-v5` 105.
- Most of these models use RK4, so a step of an environment evaluates forces 20 times.
- The solver takes half of the time of tightloop. A SIMD register waits for the slowest of its 16 worlds.
- Ratios compare environment steps by the clock, and per second of CPU time.
""",
        {
            "task": "task",
            "side": "side",
            "environments": "environments",
            "env_steps_per_s": "env steps/s",
            "ratio": "ratio",
            "asked_ratio": "asked",
            "env_steps_per_core_s": "env steps per CPU second",
            "ratio_per_core_s": "ratio per CPU second",
        },
    ),
    "mjlab_tasks": Bench(
        "mjlab's tasks, beside MuJoCo-Warp and mjbatch on two cores",
        """mjlab's own environments and managers with another class of simulations behind them, on the CPU. Actions are
random, and episodes that end begin anew.

- MuJoCo C, behind mjbatch, computes in double precision. tightloop and MuJoCo-Warp compute in single precision.
- A control step is four physics steps and an evaluation of all fields. The rest is mjlab's managers, in torch.
- MuJoCo-Warp has few worlds only: a control step of 4096 takes it seconds.
- `ratio` compares tightloop with the most worlds, the other ratio tightloop with as many worlds.
""",
        {
            "task": "task",
            "side": "side",
            "worlds": "worlds",
            "env_steps_per_s": "env steps/s",
            "physics_ms": "physics [ms]",
            "forward_ms": "evaluation [ms]",
            "rest_ms": "managers [ms]",
            "ratio_same_worlds": "ratio, same worlds",
            "ratio": "ratio",
            "asked_ratio": "asked",
        },
    ),
    "jax_steps": Bench(
        "Steps in a program of JAX, beside a loop of Python",
        """A cart with a pole, physics on one thread. A side makes its steps in a row, and its fastest turn counts.

- `sim.step` and `JaxSim` are a simulation under random forces, `VectorEnv` and `JaxEnv` the task CartPoleBalance.
- JAX runs the steps of a side as one program, a `lax.scan`.
""",
        {"worlds": "worlds", "side": "side", "us_a_step": "step [µs]", "more_us": "more than Python [µs]"},
    ),
    "policy_rollout": Bench(
        "A policy inside of the daemon, beside a loop of an environment",
        """The quadruped follows commands by its trained policy, physics on one thread. The fastest turn counts.

- Without a policy the targets are held, and the robot stands.
- The environment draws commands, and computes rewards and ends of episodes, too.
""",
        {"worlds": "worlds", "side": "side", "us_a_frame": "control frame [µs]"},
    ),
    "terrain": Bench(
        "Rough ground, beside MuJoCo on one thread",
        """gymnasium's ant with random controls, on a plane and on a height field. Its cells are 25 cm wide, and its
elevations differ by up to 15 cm. Both sides use one thread.

- A shape touches each prism of a height field alone, on both sides. So rough ground has more contacts.
- MuJoCo steps one ant. Its mean number of contacts differs with the random controls.
""",
        {
            "ground": "ground",
            "worlds": "worlds",
            "steps_per_s": "steps/s",
            "contacts": "contacts",
            "mujoco_steps_per_s": "MuJoCo, steps/s",
            "mujoco_contacts": "contacts of MuJoCo",
            "median_ratio": "ratio",
        },
    ),
    "quadruped_task": Bench(
        "A quadruped task, beside mjbatch on one core",
        """`QuadrupedVelocityFlat` with random actions. mjbatch steps the same robot in MuJoCo C, and NumPy computes the
task there: observations, rewards, ends and resets. All processes of a side share one core.

- The goal of 15 times is missed. Of our time, about 60 % is physics, and 20 % are resets and observations.
- Each side has the number of worlds at which it is fastest.
""",
        {
            "side": "side",
            "environments": "worlds",
            "env_steps_per_s": "env steps/s",
            "ratio": "ratio",
            "asked_ratio": "asked",
            "env_steps_per_core_s": "env steps per CPU second",
            "ratio_per_core_s": "ratio per CPU second",
        },
    ),
    "groups": Bench(
        "Two groups of worlds and a policy",
        """One environment of 4096 worlds waits for the policy. Two groups of 2048 worlds do not: one steps while NumPy
evaluates the policy of the other. Rates count control frames of single worlds.

- The policy is also faster on half of the rows. So part of the gain is not due to the overlap.
""",
        {
            "what": "what",
            "worlds": "worlds",
            "threads": "threads",
            "policy_ms": "policy [ms]",
            "one": "one group, steps/s",
            "two_groups": "two groups, steps/s",
            "ratio": "ratio",
        },
    ),
    "tasks": Bench(
        "Observations and rewards",
        """The time that a task's Python functions take for one step of 4096 worlds, on one core.

- The parts and their sum are the fastest of many runs. `median` is the median of the sum.
""",
        {
            "task": "task",
            "worlds": "worlds",
            "observe_us": "observation [µs]",
            "reward_us": "reward [µs]",
            "success_us": "success [µs]",
            "terminated_us": "termination [µs]",
            "sum_us": "sum [µs]",
            "median_us": "median [µs]",
            "asked_us": "asked [µs]",
        },
    ),
    "libraries": Bench(
        "Training with libraries of reinforcement learning",
        """Each run trains a policy on two cores. `load` is the load of other programs when a run began: these
machines were busy.

- CPU time is that of the trainer. It excludes the daemon.
- Success and error come from an evaluation after training.
""",
        {
            "library": "library",
            "task": "task",
            "seed": "seed",
            "steps_M": "env steps [10⁶]",
            "seconds": "time [s]",
            "cpu_s": "CPU time [s]",
            "success": "success",
            "error_cm": "mean error [cm]",
            "load": "load",
        },
    ),
    "gpu": Bench(
        "GPU backend",
        """`benches/gpu/run.sh --adapter NAME --csv FILE` runs on any machine with a Vulkan driver.

1. It compares the lesson and the grasp with MuJoCo's runs.
2. It requires equal bits for 1, 7 and 4031 worlds.
3. Only then it prints rates, beside those of the CPU.

`make bench-gpu` measures MuJoCo-Warp and MJX too, where they are installed.

- The table of its source names each adapter. Mesa's llvmpipe is a software driver: it runs on the CPU.
- In the results of llvmpipe, `device="gpu"` is slower than `device="cpu"` on the same cores. `GPU/CPU` shows the ratio.
- A rate is of the median frame. `whole run` is of all frames: the grasp touches its cube in a third of them.
- `cold` is the first build of a model, `cached` a later build.
""",
        {
            "scene": "scene",
            "worlds": "worlds",
            "dofs": "dofs",
            "cold_s": "cold [s]",
            "cached_s": "cached [s]",
            "steps_per_s": "GPU steps/s",
            "steps_per_s_whole": "whole run",
            "cpu_steps_per_s": "CPU steps/s",
            "gpu_over_cpu": "GPU/CPU",
            "frame_p50_ms": "frame, median [ms]",
            "frame_p99_ms": "frame, 99 % [ms]",
        },
    ),
    "gpu_peers": Bench(
        "Other engines on a GPU",
        """`benches/gpu/gpu_peers.py` runs scenes of the GPU backend's table in MuJoCo-Warp and MJX, where they are
installed.

- The same: model, time step, substeps, solver, iterations, cone, single precision, and the commands of world 0.
- Not the same: all of their worlds are identical, and each engine finds contacts by its own means.
- `cold` includes compiling where the kernels were not kept. The first grasp of all did not end within 150 s.
""",
        {
            "side": "engine",
            "scene": "scene",
            "worlds": "worlds",
            "cold_s": "cold [s]",
            "steps_per_s": "steps/s",
            "steps_per_s_whole": "whole run",
            "frame_p50_ms": "frame, median [ms]",
            "frame_p99_ms": "frame, 99 % [ms]",
        },
    ),
    "gpu_tensors": Bench(
        "Tensors on the GPU",
        """A policy of one matrix product in torch steps arms in the daemon. With views, positions are sent to the card
and targets are fetched from it. With tensors, both stay there.

- The card takes turns between the two processes. With few worlds this costs more than the copies.
""",
        {"worlds": "worlds", "views_us": "frame with views [µs]", "tensors_us": "with tensors [µs]"},
    ),
    "gpu_cuts": Bench(
        "Threads per world and sizes of kernels on a GPU",
        "The time of a frame's programs by time stamps of the device, with other cuts than those that are built in.\n",
        {"options": "options", "scene": "scene", "worlds": "worlds", "device_us": "frame [µs]"},
    ),
    "gpu_kernels": Bench(
        "Programs of a frame on a GPU",
        "`gpu_bench --kernel-times FILE` notes when each program of a frame ends, by time stamps of the device.\n",
        {
            "scene": "scene",
            "worlds": "worlds",
            "program": "program",
            "dispatches": "dispatches",
            "mean_us": "mean [µs]",
            "p50_us": "median [µs]",
            "max_us": "longest [µs]",
        },
    ),
    "cameras": Bench(
        "Cameras",
        """Images of 64 × 64 pixels per second, drawn on one core. Sides take turns.

- `panda`: the Panda of MuJoCo Menagerie over a table, from the other side. `g1`: the G1 of mjlab on rough ground.
- The models have all of their meshes. Colours have the shadows of one light.
- tightloop draws 1024 worlds in its daemon: the time of a frame with images, less that of one without.
- MuJoCo's renderer draws with Mesa, one world after the other. Its shadow map of 4096² pixels takes most of the time of
  an image in colour. MuJoCo-Warp draws 32 worlds on Warp's CPU device.
""",
        {
            "scene": "scene",
            "image": "image",
            "side": "side",
            "images_per_second": "images/s",
            "least": "least",
            "most": "most",
            "asked": "asked",
        },
    ),
    "viewer": Bench(
        "Overhead of a viewer",
        """A loop steps 4096 worlds as fast as it can. A viewer shows 256 of them. `±` is one standard error.

- The browser's drawing is not part of the measurement: on real machines it runs on the GPU.
""",
        {
            "what": "what",
            "worlds": "worlds",
            "step_ms": "step [ms]",
            "slower_percent": "slower [%]",
            "slower_error": "± [%]",
            "asked_percent": "asked [%]",
            "daemon_cost_percent": "daemon CPU [%]",
            "daemon_cost_error": "± [%]",
            "viewer_cpu_percent": "viewer CPU [%]",
            "shown_hz": "shown [Hz]",
        },
    ),
    "newcomer": Bench(
        "From a clean checkout to the first picture",
        """`cold` is `git clone` and `make demo` with empty caches, and `warm` is `make demo` again in the same
checkout. `wheel` installs the built wheel into a new environment, and runs its demo. Rust and Python were there before.
""",
        {
            "caches": "caches",
            "first_picture_s": "first picture [s]",
            "whole_demo_s": "whole demo [s]",
            "asked_s": "asked [s]",
        },
    ),
    "newcomer_start": Bench(
        "Import and first step",
        """The time of `import tightloop`, and from the start of Python to the first step of 4096 arms. Each sample is
a process of its own.
""",
        {
            "what": "what",
            "median_s": "median [s]",
            "least_s": "least [s]",
            "most_s": "most [s]",
            "asked_s": "asked [s]",
        },
    ),
    "rollout": Bench(
        "Rollouts",
        """The time of 4096 rollouts of 20 frames with 4 substeps each, and of its parts. `physics` evaluates no field,
`steps` also evaluates the fields, `rollout` also copies them.
""",
        {
            "case": "case",
            "part": "part",
            "median_ms": "median [ms]",
            "p99_ms": "99 % [ms]",
            "asked_ms": "asked [ms]",
        },
    ),
    "snapshot": Bench(
        "Snapshots",
        """The time to keep and to restore 4096 worlds of the grasp, through the daemon and Python.
""",
        {
            "what": "what",
            "worlds": "worlds",
            "megabytes": "size [MB]",
            "median_ms": "median [ms]",
            "p99_ms": "99 % [ms]",
            "asked_ms": "asked [ms]",
        },
    ),
    "recording": Bench(
        "Overhead of a recorder",
        """The CPU time of the daemon per frame of the target demo, with and without `tightloop record`.

- The clock of the machine varies between runs. A negative overhead is such noise.
""",
        {
            "what": "what",
            "worlds": "worlds",
            "daemon_cpu_ms": "daemon CPU [ms]",
            "recorded_cpu_ms": "while recorded [ms]",
            "cost_percent": "overhead [%]",
            "asked_percent": "asked [%]",
            "recorder_cpu_ms": "recorder CPU [ms]",
            "frames": "frames",
            "lost": "lost",
            "kB_a_frame": "kB per frame",
        },
    ),
}
