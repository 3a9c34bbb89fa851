"""Reads the expressions of a recorded kernel, and checks their types.

Memory of worlds must be written as the recorder does, `buffer[PLACE * worlds + world]`: so a place is known apart from
the world.
"""

from __future__ import annotations

from .tokens import Refused, Token
from .tree import Binary, Binding, Call, Cell, Component, Entry, Expression, Name, Number, Part, Type, Unary

# the loosest first
LEVELS = (("||",), ("&&",), ("==", "!=", "<", ">", "<=", ">="), ("+", "-"), ("*", "/", "%"))
COMPARISONS = LEVELS[2]
COMPONENTS: dict[str, Component] = {"x": "x", "y": "y", "z": "z", "w": "w"}
# types of arguments and result; T is any of f32, u32, bool, the same everywhere
FUNCTIONS: dict[str, tuple[tuple[str, ...], str]] = {
    "sqrt": (("f32",), "f32"),
    "abs": (("f32",), "f32"),
    "round": (("f32",), "f32"),
    "fma": (("f32", "f32", "f32"), "f32"),
    "min": (("T", "T"), "T"),
    "max": (("T", "T"), "T"),
    "select": (("T", "T", "bool"), "T"),
    "subgroupShuffleXor": (("T", "u32"), "T"),
    "subgroupShuffle": (("T", "u32"), "T"),
    "subgroupAdd": (("T",), "T"),
    "vec4<f32>": (("f32", "f32", "f32", "f32"), "vec4"),
}


class Reader:
    """A place in the words of a file, and the types of the names so far."""

    def __init__(self, file: str, words: list[Token]) -> None:
        self.file = file
        self.words = words
        self.at = 0
        self.types: dict[str, Type] = {}
        self.buffers: dict[str, Binding] = {}
        self.lanes = 1

    def refuse(self, reason: str, line: int | None = None) -> Refused:
        """An error at the next word, or at a line."""
        return Refused(self.file, self.words[self.at].line if line is None else line, reason)

    @property
    def next(self) -> Token:
        """The next word, which stays."""
        return self.words[self.at]

    def take(self) -> Token:
        """The next word, which goes."""
        token = self.words[self.at]
        self.at += 1
        return token

    def skip(self, *texts: str) -> Token:
        """Takes words that must come next; returns the last."""
        token = self.next
        for text in texts:
            if self.next.text != text:
                raise self.refuse(f"`{text}` expected, found `{self.next.text}`")
            token = self.take()
        return token

    def takes(self, text: str) -> bool:
        """Takes the next word if it is this one."""
        if self.next.text == text:
            self.at += 1
            return True
        return False

    def name(self) -> str:
        """Takes a name."""
        if self.next.kind != "name":
            raise self.refuse(f"a name expected, found `{self.next.text}`")
        return self.take().text

    def expression(self, level: int = 0) -> Expression:
        """Takes an expression."""
        if level == len(LEVELS):
            return self.unary()
        a = self.expression(level + 1)
        while self.next.text in LEVELS[level]:
            operator = self.take().text
            a = self.binary(operator, a, self.expression(level + 1))
            if LEVELS[level] is COMPARISONS:
                break
        return a

    def binary(self, operator: str, a: Expression, b: Expression) -> Binary:
        """An operation on values of one type."""
        is_logical = operator in ("&&", "||")
        allowed = ("bool",) if is_logical else ("f32", "u32")
        if a.type != b.type or a.type not in allowed:
            raise self.refuse(f"`{operator}` of {a.type} and {b.type}")
        return Binary(operator, a, b, "bool" if operator in COMPARISONS else a.type)

    def unary(self) -> Expression:
        """Takes a value with its signs."""
        for sign, types in (("-", ("f32",)), ("!", ("bool",))):
            if self.takes(sign):
                a = self.unary()
                if a.type not in types:
                    raise self.refuse(f"`{sign}` of {a.type}")
                return Unary(sign, a, a.type)
        a = self.primary()
        while self.takes("."):
            part = COMPONENTS.get(self.next.text)
            if part is None or a.type != "vec4":
                raise self.refuse(f"component `{self.next.text}` of {a.type}")
            self.take()
            a = Part(a, part)
        return a

    def primary(self) -> Expression:  # noqa: PLR0911 - a row per kind
        """Takes a literal, a name, a call, a read or something in brackets."""
        token = self.next
        if self.takes("("):
            inner = self.expression()
            self.skip(")")
            return inner
        if token.kind == "number":
            self.take()
            if token.text[-1] not in "fu":
                raise self.refuse(f"number `{token.text}` without a suffix", token.line)
            return Number(token.text[:-1], "f32" if token.text[-1] == "f" else "u32")
        name = self.name()
        if name in ("true", "false"):
            return Number(name, "bool")
        if name in self.buffers:
            return self.memory(self.buffers[name])
        if self.next.text == "(":
            return self.call(name)
        if name == "thread":
            self.skip(".", "x")
            return Name("thread_x", "u32")
        if name not in self.types:
            raise self.refuse(f"unknown name `{name}`", token.line)
        return Name(name, self.types[name])

    def call(self, function: str) -> Expression:
        """Takes the arguments of a function."""
        self.skip("(")
        arguments = [self.expression()]
        while self.takes(","):
            arguments.append(self.expression())
        self.skip(")")
        types = [a.type for a in arguments]
        if function in ("f32", "u32"):
            if len(types) != 1 or types[0] not in ("f32", "u32"):
                raise self.refuse(f"`{function}` of {types}")
            return Call(function, tuple(arguments), "f32" if function == "f32" else "u32")
        if function not in FUNCTIONS:
            raise self.refuse(f"unknown function `{function}`")
        if function == "subgroupAdd" and self.lanes < 32:
            raise self.refuse("`subgroupAdd` sums over the worlds of a subgroup")
        expected, result = FUNCTIONS[function]
        free = types[0] if "T" in expected else None
        wanted = [free if t == "T" else t for t in expected]
        if types != wanted:
            raise self.refuse(f"`{function}` of {types}")
        kind: Type = arguments[0].type if result == "T" else "vec4" if result == "vec4" else "f32"
        return Call(function, tuple(arguments), kind)

    def memory(self, buffer: Binding) -> Expression:
        """Takes what follows the name of a buffer."""
        self.skip("[")
        index = self.expression()
        self.skip("]")
        if buffer.element in ("f32", "u32"):
            return Entry(buffer.name, index, "f32" if buffer.element == "f32" else "u32")
        place = self.place(index)
        if self.takes("["):
            component = self.expression()
            self.skip("]")
            return Cell(buffer.name, place, component, "f32")
        if self.next.text == ".":
            self.take()
            part = COMPONENTS.get(self.next.text)
            if part is None:
                raise self.refuse(f"component `{self.next.text}`")
            self.take()
            return Cell(buffer.name, place, part, "f32")
        return Cell(buffer.name, place, None, "vec4")

    def place(self, index: Expression) -> Expression:
        """PLACE of `PLACE * worlds + world`."""
        match index:
            case Binary("+", Binary("*", place, Name("worlds", _)), Name("world", _)):
                return place
        raise self.refuse("memory of a world must be indexed as `PLACE * worlds + world`")
