"""A recorded kernel as CUDA C. Each statement has its `#line` of WGSL, so that machine code leads back to it."""

from __future__ import annotations

from .tree import (
    Assign,
    Barrier,
    Binary,
    Break,
    Call,
    Cell,
    Define,
    Entry,
    Expression,
    For,
    If,
    Kernel,
    Name,
    Number,
    Part,
    Return,
    Statement,
    Store,
    Unary,
)

TYPES = {"f32": "float", "u32": "unsigned", "bool": "bool", "vec4": "float4"}
FUNCTIONS = {"sqrt": "sqrtf", "abs": "fabsf", "round": "rintf", "fma": "fmaf", "f32": "(float)", "u32": "(unsigned)"}
ARGUMENTS = (
    "float4* __restrict__ fields, float4* __restrict__ scratch, "
    "const float* __restrict__ numbers, const unsigned* __restrict__ indices"
)
NAME = "kernel_main"
"""Name of the function."""


def cuda(kernel: Kernel, worlds: int, names_peers: bool) -> str:
    """The kernel for a number of worlds, which it has as a constant.

    CUDA's shuffles name the lanes that take part. Where these are a world's, found at run time, ptxas adds checks.
    Vulkan's shuffles name none, so what is timed names all lanes, and would be wrong where worlds diverge.
    """
    share = kernel.lanes
    whole = share == 32 or not names_peers
    peers = "0xffffffffu" if whole else f"{(1 << share) - 1}u << (threadIdx.x % 32u / {share}u * {share}u)"
    lines = [
        f"#define worlds {worlds}u",
        f'extern "C" __global__ void __launch_bounds__({kernel.workgroup}) {NAME}({ARGUMENTS}) {{',
        f"const unsigned thread_x = blockIdx.x * {kernel.workgroup}u + threadIdx.x;",
        f"const unsigned peers = {peers};" if share > 1 else "",
    ]
    block(kernel.body, kernel.file, lines)
    return "\n".join([*lines, "}", ""])


def block(body: tuple[Statement, ...], file: str, lines: list[str]) -> None:
    """Adds the lines of statements."""
    for part in body:
        lines.append(f'#line {part.line} "{file}"')
        match part:
            case Define(_, name, value, changes):
                lines.append(f"{'' if changes else 'const '}{TYPES[value.type]} {name} = {text(value)};")
            case Assign(_, name, value):
                lines.append(f"{name} = {text(value)};")
            case Store(_, cell, values):
                what = ", ".join(text(x) for x in values)
                lines.append(f"{text(cell)} = {f'make_float4({what})' if cell.component is None else what};")
            case If(_, mask, inner, end):
                lines.append(f"if ({text(mask)}) {{")
                block(inner, file, lines)
                lines.append(f'#line {end} "{file}"\n}}')
            case For(_, i, first, limit, step, inner, end):
                head = f"unsigned {i} = {text(first)}; {i} < {text(limit)}; {i} += {step}u"
                lines.append(f'_Pragma("unroll 1") for ({head}) {{')
                block(inner, file, lines)
                lines.append(f'#line {end} "{file}"\n}}')
            case Barrier():
                lines.append("__syncwarp(peers);")
            case Break():
                lines.append("break;")
            case Return():
                lines.append("return;")


def text(x: Expression) -> str:  # noqa: PLR0911 - a row per kind
    """An expression in C."""
    match x:
        case Number(digits, kind):
            return digits + {"f32": "f", "u32": "u"}.get(kind, "")
        case Name(name):
            return name
        case Unary(operator, a):
            return f"({operator}{text(a)})"
        case Binary(operator, a, b):
            return f"({text(a)} {operator} {text(b)})"
        case Part(vector, component):
            return f"{text(vector)}.{component}"
        case Entry(buffer, index):
            return f"{buffer}[{text(index)}]"
        case Cell(buffer, place, None):
            return f"{buffer}[{text(place)} * worlds + world]"
        case Cell(buffer, place, str(component)):
            return f"{buffer}[{text(place)} * worlds + world].{component}"
        case Cell(buffer, place, component) if component is not None and not isinstance(component, str):
            return f"((float*){buffer})[({text(place)} * worlds + world) * 4u + {text(component)}]"
        case Call(function, arguments, kind):
            return call(function, [text(a) for a in arguments], kind)
    raise AssertionError(x)


def call(function: str, a: list[str], kind: str) -> str:  # noqa: PLR0911 - a row per function
    """A function of WGSL in C."""
    match function:
        case "select":
            return f"({a[2]} ? {a[1]} : {a[0]})"
        case "min" | "max" if kind == "f32":
            return f"f{function}f({a[0]}, {a[1]})"
        case "min" | "max":
            return f"({a[0]} {'<' if function == 'min' else '>'} {a[1]} ? {a[0]} : {a[1]})"
        case "subgroupShuffleXor":
            return shuffled(f"__shfl_xor_sync(peers, {a[0]}, {a[1]})", kind)
        case "subgroupShuffle":
            return shuffled(f"__shfl_sync(peers, {a[0]}, {a[1]})", kind)
        case "subgroupAdd":
            return f"sum_of_warp({a[0]})"
    return f"{FUNCTIONS[function]}({', '.join(a)})"


def shuffled(exchange: str, kind: str) -> str:
    """The value of another lane; a truth travels as a number."""
    return f"({exchange} != 0)" if kind == "bool" else exchange


PRELUDE = """template <class T> __device__ __forceinline__ T sum_of_warp(T x) {
for (unsigned k = 16u; k > 0u; k /= 2u) x += __shfl_xor_sync(0xffffffffu, x, k);
return x; }
"""
"""Stands before the kernels of a file."""
