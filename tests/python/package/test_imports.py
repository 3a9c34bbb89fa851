"""The import law of the Python package: no circles, and no import against the order of its layers.

An edge runs from a module to each module of the package that it names in an ``import`` statement, wherever the
statement stands: at the top, inside a function, or under ``TYPE_CHECKING``. The compiled module has the edges of its
stub ``_core.pyi`` and of the Rust code, which imports Python modules by name. Modules that Python loads by a name in a
string are not edges: the tasks of `tightloop.env.registry`, and the subcommands of `tightloop.__main__`.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import pytest

from conftest import REPOSITORY

ROOT = REPOSITORY / "py-client/python/tightloop"
RUST = REPOSITORY / "py-client/src"

Graph = dict[str, set[str]]

#: Layers of modules, lowest first. A module imports from its own layer and from lower ones. The longest entry that is
#: the module or one of its packages decides.
LAYERS = (
    ("tightloop.errors", "tightloop.terminal"),
    (
        "tightloop.arrays",
        "tightloop.assets",
        "tightloop.checks",
        "tightloop.files",
        "tightloop.gpu",
        "tightloop.notebook",
        "tightloop.optional_imports",
        "tightloop.system",
        "tightloop.whole_files",
    ),
    ("tightloop._core",),
    ("tightloop.mujoco", "tightloop.checks.params_advice"),
    # what a scene is made of
    ("tightloop.scene", "tightloop.mujoco.model", "tightloop.mujoco.scene_models"),
    ("tightloop.scene.scene", "tightloop.terrain"),
    # what a running simulation is made of
    ("tightloop.planning", "tightloop.sim"),
    ("tightloop.sim.sim", "tightloop.sim.groups"),
    ("tightloop.sim.launching",),
    ("tightloop.planning.linearization",),
    ("tightloop.mujoco.batch",),
    # the names for users, `import tightloop as tl`
    ("tightloop",),
    ("tightloop.view", "tightloop.datasets"),
    ("tightloop.env",),
    ("tightloop.tasks", "tightloop.adapters"),
    ("tightloop.examples", "tightloop.mjlab"),
    ("tightloop.train",),
    ("tightloop.files.scenes",),
    ("tightloop.demo",),
    ("tightloop.__main__",),
)


#: A folder with more files hides what belongs together.
FILES_MAX = 20


def modules_of(root: Path) -> dict[str, Path]:
    """Return the modules below a package's folder by name; a stub stands for a compiled module."""
    files = [*root.rglob("*.py"), *(stub for stub in root.rglob("*.pyi") if not stub.with_suffix(".py").exists())]
    modules = {}
    for file in files:
        parts = file.relative_to(root.parent).with_suffix("").parts
        modules[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return modules


def imports_of(source: str, modules: Iterable[str]) -> set[str]:
    """Return the modules among ``modules`` that a source file imports, at any depth of its statements."""
    known, found = set(modules), set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "the package imports by full names"
            assert node.module is not None
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                found.add(submodule if submodule in known else node.module)
    return found & known


def imports_of_rust(source: str) -> set[str]:
    """Return the Python modules that a Rust source file imports, as in ``py.import("tightloop.arrays.inputs")``."""
    return set(re.findall(r'\.import\("(tightloop[\w.]*)"\)', source))


def circle_of(graph: Mapping[str, set[str]]) -> list[str] | None:
    """Return the modules of a circle, the first one again at the end; None if there is no circle."""
    done: set[str] = set()

    def visit(module: str, path: list[str]) -> list[str] | None:
        if module in path:
            return [*path[path.index(module) :], module]
        if module not in done:
            for target in sorted(graph[module]):
                if circle := visit(target, [*path, module]):
                    return circle
            done.add(module)
        return None

    return next((circle for module in sorted(graph) if (circle := visit(module, []))), None)


def layer_of(module: str, layers: tuple[tuple[str, ...], ...]) -> int:
    """Return the index of a module's layer.

    Raises:
        KeyError: The module is in no layer. A top-level module needs an entry of its own.
    """
    level = {entry: index for index, layer in enumerate(layers) for entry in layer}
    if module in level:
        return level[module]
    package = module.rpartition(".")[0]
    while "." in package:
        if package in level:
            return level[package]
        package = package.rpartition(".")[0]
    raise KeyError(f"`{module}` is in no layer of tests/python/package/test_imports.py; add it to LAYERS")


def upward_imports(graph: Mapping[str, set[str]], layers: tuple[tuple[str, ...], ...]) -> list[str]:
    """Return the imports from a lower layer to a higher one."""
    return [
        f"{module} -> {target}"
        for module, targets in sorted(graph.items())
        for target in sorted(targets)
        if layer_of(target, layers) > layer_of(module, layers)
    ]


@pytest.fixture(scope="module")
def graph() -> Graph:
    modules = modules_of(ROOT)
    found = {name: imports_of(file.read_text(), modules) - {name} for name, file in modules.items()}
    found["tightloop._core"] |= {name for file in RUST.rglob("*.rs") for name in imports_of_rust(file.read_text())}
    return found


def test_modules_import_in_no_circle(graph: Graph) -> None:
    circle = circle_of(graph)
    assert circle is None, f"import circle: {' -> '.join(circle or ())}"


def test_imports_follow_the_order_of_the_layers(graph: Graph) -> None:
    assert not upward_imports(graph, LAYERS)


def test_the_compiled_module_imports_what_its_rust_code_names(graph: Graph) -> None:
    assert {"tightloop.errors", "tightloop.arrays.frames"} <= graph["tightloop._core"]
    assert graph["tightloop._core"] <= set(graph), "each name is a module"


def test_rust_code_converts_no_argument_by_a_call_of_python(graph: Graph) -> None:
    assert graph["tightloop._core"].isdisjoint({"tightloop.arrays.inputs", "tightloop.arrays.named_columns"})


def test_every_layer_entry_is_a_module(graph: Graph) -> None:
    assert {entry for layer in LAYERS for entry in layer} <= set(graph)


def test_folders_of_the_package_hold_at_most_20_files() -> None:
    files = Counter(file.parent.relative_to(ROOT) for file in modules_of(ROOT).values())
    assert {str(folder): count for folder, count in files.items() if count > FILES_MAX} == {}


def test_the_law_finds_a_circle_inside_functions_and_type_checking() -> None:
    modules = ("p.a", "p.b", "p.c")
    made_up = {
        "p.a": imports_of("from p import b", modules),
        "p.b": imports_of("def f():\n    import p.c", modules),
        "p.c": imports_of("if TYPE_CHECKING:\n    from p.a import Name", modules),
    }
    assert circle_of(made_up) == ["p.a", "p.b", "p.c", "p.a"]
    assert circle_of(made_up | {"p.c": set()}) is None


def test_the_law_finds_an_import_of_a_higher_layer() -> None:
    layers = (("p.low",), ("p.high",))
    made_up: Graph = {"p.low": {"p.high.part"}, "p.high.part": set(), "p.high": {"p.low"}}
    assert upward_imports(made_up, layers) == ["p.low -> p.high.part"]
    with pytest.raises(KeyError, match=r"p\.new"):
        upward_imports({"p.new": {"p.low"}}, layers)
