"""The layers of the package: imports run one way, and no subpackage uses the private modules of another."""

import ast
import functools
from pathlib import Path

import pytest

import fractalcontact

ROOT = Path(fractalcontact.__file__).parent
# what each subpackage may import, beside itself
ALLOWED = {
    "base": set(),
    "surfaces": {"base"},
    "dimensions": {"base"},
    "contact": {"base"},
    "domains": {"base"},
    "plotting": {"base"},
    "joints": {"base", "surfaces", "dimensions", "contact", "domains"},
    "accuracy": {"base", "surfaces", "dimensions", "contact", "domains", "joints"},
    "scenes": {"base", "surfaces", "dimensions", "contact", "domains", "joints", "accuracy", "plotting"},
}


@functools.cache
def imported_modules(path):
    """Return the absolute names of the modules of this package that a file imports, wherever it does so."""
    package, names = ".".join(path.relative_to(ROOT.parent).with_suffix("").parts[:-1]), []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0 or path.suffix == ".pyi", f"{path}: write absolute imports"
            names += [f"{node.module or package}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    return names


def imports_of(subpackage):
    for path in sorted((ROOT / subpackage).rglob("*.py")):
        for name in imported_modules(path):
            parts = name.split(".")
            if parts[0] == "fractalcontact" and len(parts) > 1:
                yield path.relative_to(ROOT), parts[1:]


@pytest.mark.parametrize("subpackage", ALLOWED)
def test_imports_run_one_way(subpackage):
    wrong = [
        f"{path}: {'.'.join(parts)}"
        for path, parts in imports_of(subpackage)
        if parts[0] in ALLOWED and parts[0] not in ALLOWED[subpackage] | {subpackage}
    ]
    assert wrong == []


@pytest.mark.parametrize("subpackage", ALLOWED)
def test_no_private_name_of_another_subpackage_is_imported(subpackage):
    wrong = [
        f"{path}: {'.'.join(parts)}"
        for path, parts in imports_of(subpackage)
        if parts[0] != subpackage and any(part.startswith("_") for part in parts if part != "__version__")
    ]
    assert wrong == []


def test_no_import_cycle():
    graph = {}
    for subpackage in ALLOWED:
        for path in (ROOT / subpackage).rglob("*.py"):
            if path.name == "__init__.py":
                continue
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            graph[module] = set()
            for name in imported_modules(path):
                parts = name.removeprefix("fractalcontact.").split(".")
                graph[module] |= {".".join(parts[:2]), ".".join(parts)}
    done, path = set(), []

    def visit(module):
        assert module not in path, " -> ".join([*path, module])
        if module in done:
            return
        path.append(module)
        for other in graph[module] & graph.keys() - {module}:
            visit(other)
        path.pop()
        done.add(module)

    for module in graph:
        visit(module)


# what two subpackages need is not private: the contact solver on plain arrays, which the joints call, and the
# page of the datasheet
SHARED = ("contact/solver.py", "plotting/joint_page.py")


def test_subpackage_modules_are_private():
    public = [
        str(path.relative_to(ROOT))
        for subpackage in ALLOWED
        if subpackage != "base"
        for path in (ROOT / subpackage).rglob("*.py")
        if not path.name.startswith("_")
    ]
    assert sorted(public) == sorted(SHARED)
