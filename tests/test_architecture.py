"""Imports go downwards only: faces, tasks, simulator, library, kernels."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "python" / "motorprime"
KERNELS = ROOT / "rust" / "src"

FACES = {
    "training",
    "babble_face",
    "bench",
    "cli",
    "demo",
    "album",
    "viz",
    "video",
    "recording",
    "report",
    "evaluate",
    "summary",
}
UPPER = FACES | {"tasks", "sim"}
MODULES = sorted(PACKAGE.rglob("*.py"))
MAX_LINES = 450


def floor(path: Path) -> str:
    top = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    return "faces" if top in FACES else top if top in ("tasks", "sim") else "library"


def imported(path: Path) -> set[str]:
    """Absolute names of everything that a module imports at run time, at its top or within a function.

    Names imported from a package count as modules too: ``from .. import viz`` is ``motorprime.viz``.
    """
    package = ["motorprime", *path.relative_to(PACKAGE).parts[:-1]]
    names: set[str] = set()
    skipped: set[ast.AST] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            skipped.update(part for child in node.body for part in ast.walk(child))
        if node in skipped:
            continue
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            names.add(module)
            names.update(f"{module}.{alias.name}" for alias in node.names)
    return names


def parts(path: Path) -> set[str]:
    """The parts of motorprime that a module imports."""
    return {name.split(".")[1] for name in imported(path) if name.startswith("motorprime.")}


def of(*floors: str) -> list[Path]:
    return [path for path in MODULES if floor(path) in floors]


def name(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


def test_the_floors_are_there():
    """An empty list would make every rule below hold."""
    assert {floor(path) for path in MODULES} == {"faces", "tasks", "sim", "library"}
    assert len(of("library")) > 15 and len(of("sim")) > 4 and len(of("tasks")) > 3
    assert parts(PACKAGE / "attention.py") >= {"detectors", "errors", "landscape", "peripersonal"}
    assert "sim" in parts(PACKAGE / "demo.py")


@pytest.mark.parametrize("path", of("library"), ids=name)
def test_the_library_knows_no_simulator_no_task_and_no_face(path):
    assert not parts(path) & UPPER
    assert not {n.split(".")[0] for n in imported(path)} & {"pybullet", "pybullet_utils", "icub_models"}


@pytest.mark.parametrize("path", of("library"), ids=name)
def test_the_library_prints_nothing_draws_no_windows_and_reads_no_clock(path):
    """Clock and progress are parameters; messages are exceptions."""
    roots = {n.split(".")[0] for n in imported(path)}
    assert not roots & {"rich", "typer", "matplotlib", "time", "logging"}
    called = {ast.unparse(n.func) for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)}
    assert not called & {"print", "cv2.imshow", "cv2.waitKey", "sys.stdout.write", "sys.exit"}


@pytest.mark.parametrize("path", of("sim"), ids=name)
def test_the_simulator_knows_no_task_and_no_face(path):
    assert not parts(path) & (FACES | {"tasks"})


@pytest.mark.parametrize("path", of("tasks"), ids=name)
def test_tasks_know_no_face(path):
    assert not parts(path) & FACES


@pytest.mark.parametrize("path", of("library", "tasks", "faces"), ids=name)
def test_only_the_simulator_s_folder_imports_pybullet(path):
    """Not even by way of the simulator's own import of it."""
    assert not {part for n in imported(path) for part in n.split(".")} & {"pybullet", "pybullet_utils"}
    attributes = {n.attr for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Attribute)}
    assert "bullet" not in attributes


@pytest.mark.parametrize("path", of("library"), ids=name)
def test_what_the_library_needs_beyond_numpy_and_opencv_it_imports_where_it_needs_it(path):
    """Extras are imported in the function that needs them, so that the rest works without."""
    top = {
        alias.name.split(".")[0] if isinstance(node, ast.Import) else (node.module or "").split(".")[0]
        for node in ast.parse(path.read_text()).body
        if isinstance(node, (ast.Import, ast.ImportFrom)) and not getattr(node, "level", 0)
        for alias in node.names
    }
    extras = {
        "scipy",
        "trimesh",
        "fast_simplification",
        "matplotlib",
        "icub_models",
        "safetensors",
        "onnxruntime",
    }
    assert not top & (
        extras | {"pyarrow", "duckdb", "joblib", "distributed", "dask", "cvxpy", "clarabel", "sklearn"}
    )


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_modules_name_each_other_by_relative_imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and not node.level:
            assert (node.module or "").split(".")[0] != "motorprime", ast.unparse(node)


def test_library_and_kernels_draw_from_no_global_generator():
    for path in MODULES:
        calls = re.findall(r"np\.random\.(\w+)", path.read_text())
        assert set(calls) <= {"Generator", "default_rng"}, path


@pytest.mark.parametrize(
    "path",
    [p for p in KERNELS.rglob("*.rs") if "python" not in p.relative_to(KERNELS).parts],
    ids=lambda p: p.name,
)
def test_the_kernels_have_no_python_in_them(path):
    """rust/src/python/ is the only border; lib.rs only declares it."""
    code = re.sub(r"//.*", "", path.read_text())
    assert not re.search(r"\b(pyo3|numpy|PyResult|PyErr|Py<)", code)


@pytest.mark.parametrize("path", MODULES, ids=name)
def test_no_module_is_too_long_to_read(path):
    assert len(path.read_text().splitlines()) <= MAX_LINES


def _texts() -> list[Path]:
    kinds = {".py", ".pyi", ".rs", ".toml", ".md", ".yml", ".yaml", ".css", ".js", ".html", ".txt", ""}
    skipped = {".git", ".venv", "target", "runs", "dist", "__pycache__"}
    found = [
        path
        for path in ROOT.rglob("*")
        if path.suffix in kinds and path.is_file() and not skipped & set(path.relative_to(ROOT).parts)
    ]
    return [p for p in found if not any(part.startswith(".") for part in p.relative_to(ROOT).parts[:-1])]


def test_no_file_names_a_path_of_somebody_s_machine():
    """Nor a home folder: what is written down must work on any machine."""
    homes = re.compile(rf"(?<![\w.])({re.escape(str(ROOT))}|/root|/home/\w+|/Users/\w+)/")
    for path in _texts():
        if path == Path(__file__) or path.name.startswith("."):
            continue
        text = path.read_text(encoding="utf-8", errors="ignore")
        found = homes.search(text)
        assert not found, f"{path.relative_to(ROOT)}: {text[found.start() : found.start() + 40]!r}"
