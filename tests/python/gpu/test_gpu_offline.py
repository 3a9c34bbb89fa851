"""The bench that judges recorded kernels without a card: its translations compute what is written, or are refused."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "benches"))

from gpu.offline import (
    bytecode,
    check,
    constants,
    costs,
    cuda_on_cpu,
    dump,
    emulate,
    loops,
    model,
    parser,
    sass,
    slots,
    timing,
    toolchain,
)
from gpu.offline.tokens import Refused

BINARY = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target")) / "release/examples/gpu_bench"
HEAD = """override worlds: u32;
override workgroup: u32 = 32u;
@group(0) @binding(0) var<storage, read_write> fields: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read_write> scratch: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> numbers: array<f32>;
@group(0) @binding(3) var<storage, read> indices: array<u32>;

@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) thread: vec3<u32>, @builtin(subgroup_invocation_id) place: u32) {
"""
# eight lanes of a world share its rows, add up, and the first writes the sum and what the fourth has
SHARED = """    let world = thread.x / 8u;
    let lane = thread.x % 8u;
    let first_lane = place - lane;
    if (world >= worlds) { return; }
    let x0 = fields[0u * worlds + world].x;
    let end5 = min(u32(x0), 20u);
    var v1 = 0.0f;
    for (var i5 = lane; i5 < end5; i5 += 8u) {
        let t1 = scratch[(i5 * 2u + 1u) * worlds + world];
        let t2 = numbers[indices[i5] * 3u + 1u];
        let t3 = select(t1.y * t2, (-t1.x), t1.z < 0.0f);
        v1 = v1 + t3;
        scratch[(i5 * 2u + 160u) / 4u * worlds + world][(i5 * 2u + 160u) % 4u] = t3;
    }
    let t4 = v1;
    v1 = v1 + subgroupShuffleXor(v1, 1u);
    v1 = v1 + subgroupShuffleXor(v1, 2u);
    v1 = v1 + subgroupShuffleXor(v1, 4u);
    subgroupBarrier();
    let t5 = subgroupShuffle(t4, first_lane + 3u);
    if (lane == 0u) {
        fields[1u * worlds + world] = vec4<f32>(v1, t5, f32(end5), 0.5f);
    }
}
"""
WORLDS, ROWS = 16, 20
Array = NDArray[Any]


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """For what is compiled."""
    return tmp_path_factory.mktemp("cache")


def shared() -> parser.Kernel:
    return parser.parse(HEAD + SHARED, "shared.wgsl")


def memory() -> tuple[emulate.Worlds, tuple[Array, Array]]:
    """Worlds with 0 to 20 rows, each at a vector of its own."""
    random = np.random.default_rng(0)
    fields = np.zeros((2, WORLDS, 4), np.float32)
    fields[0, :, 0] = np.arange(WORLDS) * 1.5
    scratch = random.normal(size=(3 * ROWS, WORLDS, 4)).astype(np.float32)
    ever = tuple(np.zeros((len(values), WORLDS // 2), np.uint8) for values in (fields, scratch))
    indices = random.permutation(ROWS).astype(np.uint32)
    return emulate.Worlds(fields, scratch, ever), (random.normal(size=3 * ROWS).astype(np.float32), indices)


def wanted(scratch: Array, tables: tuple[Array, Array]) -> Array:
    """What the kernel writes to the second vector, `(worlds, 4)`; lanes add in turns, then by pairs."""
    numbers, indices = tables
    found = np.zeros((WORLDS, 4), np.float32)
    for world in range(WORLDS):
        rows = min(int(world * 1.5), ROWS)
        sums = np.zeros(8, np.float32)
        for i in range(rows):
            x, y, z, _ = scratch[2 * i + 1, world]
            sums[i % 8] += -x if z < 0 else y * numbers[indices[i] * 3 + 1]
        fourth = sums[3]
        for step in (1, 2, 4):
            sums = sums + sums[np.arange(8) ^ step]
        found[world] = [sums[0], fourth, rows, 0.5]
    return found


def test_lanes_that_share_a_world_do_in_both_translations_what_is_written(cache: Path):
    kernel = shared()
    assert kernel.lanes == 8
    worlds, tables = memory()
    result = wanted(worlds.scratch.copy(), tables)
    other = worlds.fields.copy(), worlds.scratch.copy()
    emulator = emulate.Emulator({0: kernel}, tables, cache)
    tally = emulator.run(0, worlds)
    cuda_on_cpu.run({0: kernel}, [0], (*other, *tables), cache)
    assert np.array_equal(worlds.fields, other[0]) and np.array_equal(worlds.scratch, other[1])
    assert np.array_equal(worlds.fields[1].view(np.uint32), result.view(np.uint32))
    # 4 warps of 4 worlds: a warp goes round as often as its longest world needs, with as many lanes as have a row
    rows = np.minimum((np.arange(WORLDS) * 1.5).astype(int), ROWS)
    body = emulator.programs[0].stretches.of_line[HEAD.count("\n") + 8]
    assert tally.visits[:, body].tolist() == (-(-rows.reshape(4, 4).max(axis=1) // 8)).tolist()
    assert tally.lanes[body] == rows.sum()
    assert tally.loaded[body] == 16 * rows.sum() and tally.stored[body] == 4 * rows.sum()


@pytest.mark.parametrize(
    ("line", "statement", "reason"),
    [
        (3, "    loop { break; }", "unknown statement `loop`"),
        (3, "    let t1 = sin(1.0f);", "unknown function `sin`"),
        (3, "    let t1 = 1.0f + 1u;", "`+` of f32 and u32"),
        (3, "    let t1 = t0;", "unknown name `t0`"),
        (3, "    let t1 = fields[world];", "must be indexed as"),
        (3, "    numbers[0u] = 1.0f;", "cannot take it"),
        (3, "    let t1 = 1.0f ^ 2.0f;", "unknown character '^'"),
        (3, "    let t1 = subgroupAdd(1.0f);", "sums over the worlds"),
        (5, "    for (var i0 = 0u; i0 < 4u; i0++) {\n        if (true) {\n            if (true) { break; }", "break"),
    ],
)
def test_an_unknown_statement_is_refused_by_its_line(line: int, statement: str, reason: str):
    first = "    let world = thread.x;\n    if (world >= worlds) { return; }\n"
    closing = "\n    }" * (statement.count("{") - statement.count("}"))
    text = HEAD + first + statement + closing + "\n}\n"
    with pytest.raises(Refused, match=re.escape(reason)) as refused:
        parser.parse(text, "kernel.wgsl")
    assert str(refused.value).startswith(f"kernel.wgsl:{HEAD.count(chr(10)) + line}: ")


def test_a_lane_that_reads_one_of_another_world_is_refused(cache: Path):
    text = HEAD + SHARED.replace("subgroupShuffleXor(v1, 4u)", "subgroupShuffleXor(v1, 8u)")
    worlds, tables = memory()
    with pytest.raises(SystemExit, match="128 reads of lanes that do not take part, 0 accesses"):
        emulate.Emulator({0: parser.parse(text, "kernel.wgsl")}, tables, cache).run(0, worlds)


def test_no_two_values_that_are_needed_share_a_slot():
    program = bytecode.program(shared())
    assert program.slots < 40
    assert slots.last_uses(shared().body)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> dump.Scene:
    """A dumped scene, of the binary that is built."""
    if not BINARY.exists():
        pytest.skip("build it with `cargo build --release --workspace --example gpu_bench`")
    folder = tmp_path_factory.mktemp("dump")
    command = [str(BINARY), "--dump", str(folder), "--worlds", "64", "--frames", "7,40", "--scenes", "torque_free"]
    subprocess.run(command, check=True)
    return dump.read(folder / "torque_free")


def test_a_dumped_frame_ends_in_the_state_that_the_cpu_has(scene: dump.Scene, cache: Path):
    found = check.check(scene, cache)
    assert [(one.name, one.frame) for one in found] == [("lockstep", 7), ("lockstep", 40), ("CUDA C", 40)]
    # the same operations, all rounded as written
    assert all(one.holds and one.same == 1.0 for one in found), [str(one) for one in found]
    assert sum(scene.weights().values()) == scene.frames == 180


def test_a_frame_with_another_torque_is_noticed(scene: dump.Scene, cache: Path):
    emulator = emulate.emulator(scene, cache)
    program = emulator.programs[0]
    constants = program.constants.copy()
    # the constant that most operations read, times 1.01
    counts = np.bincount(program.code[:, 2:].ravel(), minlength=program.slots)
    most = max(range(len(constants)), key=lambda k: counts[constants[k, 0]] if constants[k, 1] > 2**24 else 0)
    constants[most, 1] = np.float32(1.01 * constants[most : most + 1, 1].view(np.float32)[0]).view(np.uint32)
    emulator.programs[0] = replace(program, constants=constants)
    assert not check.lockstep(scene, 40, emulator).holds


# nvdisasm of a loop over rows for sm_90: what a thread has loaded is squared and added up, then stored
SASS = """
	//## File "/out/kernel.wgsl", line 10
        /*0090*/                   LDC.64 R4, c[0x0][0x210] ;   /* 0x00008400ff047b82 */
                                                                /* 0x000e220000000a00 */
	//## File "/out/kernel.wgsl", line 12
        /*00d0*/                   MOV R0, RZ ;                 /* 0x000000ff00007202 */
                                                                /* 0x000fc00000000f00 */
.L_x_2:
	//## File "/out/kernel.wgsl", line 12
        /*0100*/                   IMAD.WIDE.U32 R2, R3, 0x10, R4 ;  /* 0x0000001003027825 */
                                                                /* 0x001fca00078e0004 */
        /*0110*/                   LDG.E.64 R12, desc[UR4][R2.64] ;  /* 0x00000004020c7981 */
                                                                /* 0x000ea4000c1e9b00 */
        /*0120*/                   FADD.FTZ R11, R12, R12 ;     /* 0x0000000c0c0b7221 */
                                                                /* 0x004fc80000010000 */
	//## File "/out/kernel.wgsl", line 11
        /*01f0*/              @!P0 BRA `(.L_x_2) ;              /* 0xfffffffc00bc8947 */
                                                                /* 0x000fea000383ffff */
.L_x_1:
	//## File "/out/kernel.wgsl", line 14
        /*0230*/                   STG.E desc[UR4][R2.64], R11 ;  /* 0x0000000b02007986 */
                                                                /* 0x000fe2000c101904 */
        /*0240*/                   EXIT ;                       /* 0x000000000000794d */
                                                                /* 0x000fea0003800000 */
.L_x_3:
        /*0250*/                   BRA `(.L_x_3);               /* 0xfffffffc00fc7947 */
                                                                /* 0x000fc0000383ffff */
        /*0260*/                   NOP;                         /* 0x0000000000007918 */
                                                                /* 0x000fc00000000000 */
"""


def test_machine_code_runs_as_often_as_the_lines_in_as_many_loops():
    # lines 10, then 11 and 12 in a loop, then 14
    stretches = bytecode.Stretches([10, 11, 14], [0, 1, 0], {10: 0, 11: 1, 12: 1, 14: 2})
    found = sass.blocks(SASS, stretches)
    assert [[one.operation for one in block.instructions] for block in found] == [
        ["LDC", "MOV"],
        ["IMAD", "LDG", "FADD", "BRA"],
        ["STG", "EXIT"],
        ["BRA"],
    ]
    # MOV comes from a line in the loop, but stands before it
    assert [block.stretch for block in found[:3]] == [0, 1, 2] and [block.depth for block in found] == [0, 1, 0, 0]
    assert [block.agreeing for block in found[:3]] == [1, 4, 2]
    # nothing leads behind the end
    assert [block.is_aside for block in found] == [False, False, False, True]
    load, add = found[1].instructions[1:3]
    assert (load.result_barrier, add.waits, add.stall) == (2, 1 << 2, 4)


def test_code_that_was_put_aside_closes_no_loop():
    # block 3 stands behind the end and jumps back
    assert loops.depths([[1, 3], [2], [], [1]]) == [0, 0, 0, 0]
    # the same in a loop of 1 and 2, with a loop of 5 in it
    assert loops.depths([[1], [2, 4], [1, 5, 3], [], [2], [5, 1]]) == [0, 1, 1, 0, 1, 2]


def test_a_warp_waits_for_its_loads():
    stretches = bytecode.Stretches([10, 11, 14], [0, 1, 0], {10: 0, 11: 1, 12: 1, 14: 2})
    found, card = sass.blocks(SASS, stretches), constants.CARDS["sm_90"]
    near, far = (timing.cycles(found, card, load) for load in (40, 263))
    # the block ends 4 + 5 cycles after the sum is issued, and that waits for the load
    assert far[1] - near[1] == 223 and near[1] > 40 + 4 + 5
    assert far[0] == near[0] and far[2] == near[2]


def counted(visits: list[list[int]]) -> emulate.Tally:
    """A dispatch of warps that load 1024 bytes each."""
    array = np.array(visits, np.uint32)
    nothing = np.zeros(array.shape[1], np.uint64)
    sectors = np.full(array.shape[1], 32 * len(visits) // array.shape[1], np.uint64)
    first = np.tile(np.array([32, 0], np.uint64), (len(visits), 1))
    return emulate.Tally(array, 0 * array, nothing, nothing, nothing, sectors, nothing, first)


def test_few_warps_are_bound_by_the_slowest_and_many_by_what_fits():
    card = constants.CARDS["sm_90"]
    compiled = toolchain.Compiled("", registers=255, stack=0, spilled=0, code=4096, seconds=0.0)
    cycles = np.array([1e4, 1e5])
    cost = costs.Costs(compiled, np.array([1e3, 1e4]), cycles, cycles, cycles, 0 * cycles, 0 * cycles, 0.0)
    tally = counted([[1, 0], [1, 1], [1, 0], [1, 0]])

    def dispatch(worlds: int) -> model.Dispatch:
        return model.dispatch(tally, cost, 32, model.Setting(card, worlds, 128, 0, 1000.0))

    few, many = dispatch(128), dispatch(128 * 1000)
    assert model.resident(cost, 32, card) == 8
    assert few.bound == "slowest" and few.seconds == pytest.approx(1.1e5 / card.clock + constants.DISPATCH)
    assert few.mean == 3.5e4 and few.worst == 1.1e5
    # 4000 warps, of which 8 fit a multiprocessor
    assert many.bound == "warps"
    assert many.seconds == pytest.approx(4000 * 3.5e4 / (8 * 132) / card.clock + constants.DISPATCH)
