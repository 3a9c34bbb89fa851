"""Constants of the model, each with its unit and source. Change none without printing all predictions before and after.

Sources by letter. None was measured for this model. Those with † are quoted without the text at hand.

- A: NVIDIA's documents: CUDA C++ Programming Guide (throughput, limits), white papers, data sheets
- B†: Luo et al. 2024, arXiv 2402.13499: latencies and throughputs of A100, H100 and RTX 4090
- C†: Jarmusch et al. 2025, arXiv 2507.10789: latencies of H100 and RTX 5080
- D†: Jia et al. 2018, arXiv 1804.06826: caches, latencies and control bits of Volta
- E†: Huerta et al. 2025, arXiv 2503.20481: fetch and issue of recent cores
- F: assumption of this model, with its reason
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Card:
    """A card."""

    name: str
    multiprocessors: int
    clock: float
    """[Hz]"""
    warps: int
    """Warps that a multiprocessor may hold."""
    groups: int
    """Workgroups that a multiprocessor may hold."""
    l1: int
    """[bytes] Level-1 cache of a multiprocessor, less what is reserved."""
    l2: int
    """[bytes] Level-2 cache."""
    l1_rate: float
    """[bytes/cycle] of a multiprocessor."""
    l2_rate: float
    """[bytes/s] of the card."""
    memory_rate: float
    """[bytes/s] of device memory."""
    l1_latency: int
    """[cycles] of a load that hits level 1."""
    l2_latency: int
    """[cycles] of a load that hits level 2."""
    memory_latency: int
    """[cycles] of a load from device memory."""
    float_interval: int
    """[cycles] for which a warp's single-precision operation holds its pipe in a quarter."""
    bus_rate: float
    """[bytes/s] of PCIe, one way, as copies reach it."""


MODEL = "1"
"""Counts changes of these constants and of what `model.py` and `frame_ends.py` make of them. Results keep it."""

KB = 1024
CARDS = {
    # A: 108 multiprocessors of 64 FP32 lanes, 1.41 GHz, 192 kB, 40 MB, 2.0 TB/s, PCIe 4; B: latencies
    "sm_80": Card(
        "A100 80 GB",
        multiprocessors=108,
        clock=1.41e9,
        warps=64,
        groups=32,
        l1=(192 - 8) * KB,
        l2=40 * KB * KB,
        l1_rate=128,
        l2_rate=3.9e12,
        memory_rate=2.0e12,
        l1_latency=38,
        l2_latency=262,
        memory_latency=466,
        float_interval=2,
        bus_rate=25e9,
    ),
    # A: 132, 1.755 GHz (H100 SXM under load), 256 kB, 50 MB, 4.8 TB/s, PCIe 5; B: levels 1 and 2; C: device memory
    "sm_90": Card(
        "H200",
        multiprocessors=132,
        clock=1.755e9,
        warps=64,
        groups=32,
        l1=(256 - 8) * KB,
        l2=50 * KB * KB,
        l1_rate=128,
        l2_rate=5.5e12,
        memory_rate=4.8e12,
        l1_latency=41,
        l2_latency=263,
        memory_latency=659,
        float_interval=1,
        bus_rate=50e9,
    ),
    # A: 170, 2.41 GHz boost, 128 kB, 96 MB, 1.79 TB/s, PCIe 5; C: latencies of the RTX 5080
    "sm_120": Card(
        "RTX 5090",
        multiprocessors=170,
        clock=2.41e9,
        warps=48,
        groups=24,
        l1=(128 - 8) * KB,
        l2=96 * KB * KB,
        l1_rate=128,
        l2_rate=7.0e12,
        memory_rate=1.79e12,
        l1_latency=40,
        l2_latency=358,
        memory_latency=877,
        float_interval=1,
        bus_rate=50e9,
    ),
}
"""By the architecture that nvcc compiles for. Rates of level 2: B for A100 and H100, F for the RTX 5090."""

QUARTERS = 4
"""Parts of a multiprocessor that issue one instruction a cycle each. A."""
REGISTERS = 65536
"""32-bit registers of a multiprocessor. A."""
REGISTER_UNIT = 256
"""Registers are given to a warp in units of this many. A."""
ISSUE_EFFICIENCY = 0.8
"""Share of cycles in which a full quarter issues. F: well-fed kernels reach 0.7 to 0.9."""

INTEGER_INTERVAL = 2
"""[cycles] for which an integer, comparison or selection holds its pipe of 16 lanes. A."""
SPECIAL_INTERVAL = 8
"""[cycles] for reciprocals, roots, conversions and rounding: 4 lanes a quarter. A."""
MEMORY_INTERVAL = 4
"""[cycles] for which a load, store or shuffle of a warp holds the memory pipe: 8 lanes a quarter. A."""

SPECIAL_LATENCY = 24
"""[cycles] until a reciprocal or root can be used. D."""
CONVERSION_LATENCY = 20
"""[cycles] until a converted or rounded number can be used. D."""
SHUFFLE_LATENCY = 24
"""[cycles] until another lane's value can be used. D."""
CONSTANT_LATENCY = 30
"""[cycles] of constants and special registers. D."""
OTHER_LATENCY = 16
"""[cycles] of whatever else sets a scoreboard. F."""
OPERANDS_LATENCY = 12
"""[cycles] until a store or a load has read its operands. E."""

CODE_CACHE = 128 * KB
"""[bytes] of instructions that a multiprocessor keeps (level 1.5). D, E."""
CODE_RATE = 4.0
"""[bytes/cycle] of code from level 2. F: 8 lines of 128 bytes under way (E: a stream buffer), 263 cycles each."""

DISPATCH = 2.5e-6
"""[s] between dependent dispatches: last warp done, caches written back, next grid launched. F: CUDA graphs take 1.0 to
1.6 µs a node, and Vulkan's full barriers flush and invalidate more."""
SUBMISSION = 15e-6
"""[s] from a submission until the card begins. F: doorbell and context of a queue, 5 to 20 µs by traces of games."""
WAKE = 20e-6
"""[s] from the last dispatch until the waiting thread runs: interrupt, driver, scheduler. F."""
HOST_SUBMIT = 40e-6
"""[s] of the thread that submits recorded batches. Measured with lavapipe: 39 µs for 1000 dispatches."""
BUS_LATENCY = 1.2e-6
"""[s] of a load from host memory by a kernel. F: 1.0 to 1.5 µs round trip over PCIe 4 and 5."""
HOST_COPY_RATE = 10e9
"""[bytes/s] of one thread that copies a frame from staging memory. F: a core's memcpy of what lies in DRAM."""
HOST_WORLD = 2e-9
"""[s] of the host for a world and frame: steps and status are read. F: two cache lines per eight worlds, a loop."""
COUNTERS = 9000
"""[cycles] of the kernel `counters`: some 2000 instructions that depend on each other, counted from its loops."""
BINDING = 2**31 - 4
"""[bytes] that a binding may hold: wgpu's limit."""
