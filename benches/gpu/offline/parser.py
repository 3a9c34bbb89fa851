"""Reads a recorded kernel, as sim-core/record/src/wgsl prints it. Whatever else stands there is refused by its line."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from .expressions import Reader
from .tokens import Refused, tokens
from .tree import (
    Assign,
    Barrier,
    Binary,
    Binding,
    Break,
    Call,
    Cell,
    Define,
    Expression,
    For,
    If,
    Kernel,
    Name,
    Number,
    Return,
    Statement,
    Store,
)


def parse(text: str, file: str) -> Kernel:
    """The kernel of a text; `file` is for messages.

    Raises:
        Refused: Something that the recorder does not print.
    """
    reader = Reader(file, tokens(file, text))
    kernel = head(reader)
    reader.types = {"worlds": "u32"}
    line = reader.next.line
    if kernel.has_place:
        reader.types["place"] = "u32"
    kernel.body = block(reader, kernel, depth=0)
    if kernel.has_place:
        # a workgroup is a warp here
        place = Binary("%", Name("thread_x", "u32"), Number("32", "u32"), "u32")
        kernel.body = (Define(line, "place", place, changes=False), *kernel.body)
    if reader.next.kind != "end":
        raise reader.refuse(f"a second function begins with `{reader.next.text}`")
    kernel.types = reader.types
    return kernel


def head(reader: Reader) -> Kernel:
    """Takes everything up to the bracket that opens the function."""
    kernel = Kernel(reader.file, 0, [])
    while True:
        if reader.takes("enable"):
            reader.skip("subgroups", ";")
        elif reader.takes("override"):
            override(reader, kernel)
        elif reader.next.text == "@":
            if binding(reader, kernel):
                break
        else:
            raise reader.refuse(f"unknown declaration `{reader.next.text}`")
    reader.skip("fn")
    reader.name()
    reader.skip("(", "@", "builtin", "(", "global_invocation_id", ")", "thread", ":", "vec3<u32>")
    if reader.takes(","):
        reader.skip("@", "builtin", "(", "subgroup_invocation_id", ")", "place", ":", "u32")
        kernel.has_place = True
    reader.skip(")", "{")
    return kernel


def override(reader: Reader, kernel: Kernel) -> None:
    """Takes `worlds` or `workgroup`."""
    name = reader.name()
    reader.skip(":", "u32")
    if name == "workgroup":
        reader.skip("=")
        kernel.workgroup = int(reader.take().text.removesuffix("u"))
    elif name != "worlds":
        raise reader.refuse(f"unknown constant `{name}`")
    reader.skip(";")


def binding(reader: Reader, kernel: Kernel) -> bool:
    """Takes a buffer, or `@compute` with its size: true."""
    reader.skip("@")
    if reader.takes("compute"):
        reader.skip("@", "workgroup_size", "(", "workgroup", ")")
        return True
    reader.skip("group", "(", "0", ")", "@", "binding", "(")
    number = int(reader.take().text)
    reader.skip(")", "var", "<", "storage", ",")
    access = reader.name()
    reader.skip(">")
    name = reader.name()
    reader.skip(":")
    element = reader.name().removeprefix("array<").removesuffix(">")
    reader.skip(";")
    if element not in ("vec4<f32>", "f32", "u32"):
        raise reader.refuse(f"buffer of {element}")
    found = Binding(number, name, element, access == "read_write")
    kernel.bindings.append(found)
    reader.buffers[name] = found
    return False


def block(reader: Reader, kernel: Kernel, depth: int) -> tuple[Statement, ...]:
    """Takes statements up to the closing bracket, which goes too."""
    found: list[Statement] = []
    while not reader.takes("}"):
        if reader.next.text == "{":
            found += scope(reader, kernel, depth)
        else:
            found.append(statement(reader, kernel, depth))
    return tuple(found)


def scope(reader: Reader, kernel: Kernel, depth: int) -> tuple[Statement, ...]:
    """Takes statements in brackets of their own; the place of the bracket makes their names unique."""
    place = reader.at
    reader.skip("{")
    inside, end = 1, reader.at
    while inside:
        inside += {"{": 1, "}": -1}.get(reader.words[end].text, 0)
        end += 1
    words = reader.words[place:end]
    defined = {after.text for word, after in pairwise(words) if word.text in ("let", "var")}
    reader.words[place:end] = [
        replace(word, text=f"{word.text}_{place}") if word.text in defined else word for word in words
    ]
    return block(reader, kernel, depth)


def statement(reader: Reader, kernel: Kernel, depth: int) -> Statement:  # noqa: PLR0911 - a return per kind
    """Takes a statement; `depth` is the number of loops and conditions around it."""
    line = reader.next.line
    match reader.next.text:
        case "let" | "var":
            found = define(reader)
            note_lanes(reader, kernel, found)
            return found
        case "if":
            reader.skip("if", "(")
            mask = reader.expression()
            reader.skip(")", "{")
            if mask.type != "bool":
                raise reader.refuse(f"a condition of type {mask.type}", line)
            body = block(reader, kernel, depth + 1)
            if any(isinstance(part, Return) for part in body) and (depth > 0 or len(body) > 1):
                raise reader.refuse("`return` inside of other statements", line)
            return If(line, mask, body, reader.words[reader.at - 1].line)
        case "for":
            return loop(reader, kernel, depth)
        case "subgroupBarrier":
            reader.skip("subgroupBarrier", "(", ")", ";")
            return Barrier(line)
        case "break":
            reader.skip("break", ";")
            return Break(line)
        case "return":
            reader.skip("return", ";")
            return Return(line)
    return assignment(reader)


def define(reader: Reader) -> Define:
    """Takes `let` or `var`."""
    line, changes = reader.next.line, reader.take().text == "var"
    name = reader.name()
    reader.skip("=")
    value = reader.expression()
    reader.skip(";")
    reader.types[name] = value.type
    return Define(line, name, value, changes)


def note_lanes(reader: Reader, kernel: Kernel, found: Define) -> None:
    """Finds how many threads share a world: `let world = thread.x / 8u;` and `let lane = thread.x % 8u;`."""
    match found:
        case Define(name="world", value=Binary("/", Name("thread_x"), Number(text))):
            kernel.lanes = reader.lanes = int(text)
            if kernel.lanes not in (2, 4, 8, 16, 32):
                raise reader.refuse(f"{kernel.lanes} threads share a world", found.line)
        case Define(name="lane", value=Binary("%", Name("thread_x"), Number(text))):
            if int(text) != kernel.lanes:
                raise reader.refuse("world and lane disagree", found.line)
        case Define(name="world", value=Name("thread_x")):
            pass
        case Define(name="world"):
            raise reader.refuse("worlds from a list: dump the kernels of hardware", found.line)
        case Define(name="lane"):
            raise reader.refuse("unknown lane", found.line)


def loop(reader: Reader, kernel: Kernel, depth: int) -> For:
    """Takes `for (var i = first; i < limit; i++) { … }`."""
    line = reader.next.line
    reader.skip("for", "(", "var")
    name = reader.name()
    reader.skip("=")
    first = reader.expression()
    reader.types[name] = first.type
    reader.skip(";", name, "<")
    # a sum at most: `<` begins no comparison of its own here
    limit = reader.expression(level=3)
    reader.skip(";", name)
    step = 1
    if not reader.takes("++"):
        reader.skip("+=")
        step = int(reader.take().text.removesuffix("u"))
    reader.skip(")", "{")
    if (first.type, limit.type) != ("u32", "u32"):
        raise reader.refuse("a loop over something else than u32", line)
    body = block(reader, kernel, depth + 1)
    for part in body:
        if isinstance(part, If):
            check_breaks(reader, part, outer=True)
    return For(line, name, first, limit, step, body, reader.words[reader.at - 1].line)


def check_breaks(reader: Reader, condition: If, outer: bool) -> None:
    """A `break` must be all that stands in a condition of its loop's body."""
    for part in condition.body:
        if isinstance(part, Break) and not (outer and len(condition.body) == 1):
            raise reader.refuse("`break` beside or below other statements", part.line)
        if isinstance(part, If):
            check_breaks(reader, part, outer=False)


def assignment(reader: Reader) -> Statement:
    """Takes `name = value;` or `cell = value;`."""
    token = reader.next
    if token.kind != "name" or (token.text not in reader.buffers and token.text not in reader.types):
        raise reader.refuse(f"unknown statement `{token.text}`")
    target = reader.primary()
    line = token.line
    reader.skip("=")
    value = reader.expression()
    reader.skip(";")
    match target:
        case Name(name, kind) if kind == value.type:
            return Assign(line, name, value)
        case Cell(buffer, _, component, kind) if kind == value.type and reader.buffers[buffer].is_written:
            return Store(line, target, stored(reader, value, component is None, line))
    raise reader.refuse(f"{value.type} is assigned to what cannot take it", line)


def stored(reader: Reader, value: Expression, whole: bool, line: int) -> tuple[Expression, ...]:
    """The values that a store writes."""
    if not whole:
        return (value,)
    if isinstance(value, Call) and value.function == "vec4<f32>":
        return value.arguments
    raise reader.refuse("a vector is stored from four values", line)


__all__ = ["Refused", "parse"]
