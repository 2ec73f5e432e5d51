# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rooms of the package and the arrows between them, read from the import statements."""

import ast
import importlib
import re
import types
from collections import Counter
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import imu_sim_ros

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "imu_sim_ros"
LOW = {"__version__", "core", "inputs", "parameters", "recordings", "terminal"}
BODY = LOW | {"places", "trajectory", "sensors"}
ROOMS = {
    "__init__": LOW | {"jobs", "camera", "navigation", "sensors", "trajectory"},
    "camera": BODY | {"simulation", "jobs"},
    "core": set(),
    "inputs": {"core"},
    "parameters": {"core", "inputs"},
    "recordings": {"core"},
    "terminal": {"core", "parameters"},
    "places": LOW,
    "trajectory": LOW | {"places"},
    "sensors": BODY | {"bags"},
    "simulation": BODY | {"bags"},
    "bags": LOW,
    "datasets": BODY | {"simulation", "bags"},
    "formats": LOW | {"bags", "datasets"},
    # Of a sensor only its parameters: what it is, in numbers.
    "navigation": LOW | {"sensors"},
    "calibration": LOW | {"sensors", "simulation"},
    "plots": LOW | {"sensors", "navigation", "calibration"},
    "campaigns": BODY | {"simulation", "bags", "formats", "datasets", "navigation", "calibration"},
    "reports": LOW
    | {"sensors", "bags", "formats", "datasets", "navigation", "calibration", "campaigns"},
    "jobs": BODY
    | {"simulation", "bags", "datasets", "formats", "navigation", "calibration", "plots"}
    | {"campaigns", "reports"},
}
SEE_EVERYTHING = {"__main__", "nodes", "commands"}
ONLY_IN = {
    "rclpy": {"nodes"},
    "sensor_msgs": {"nodes"},
    "nav_msgs": {"nodes"},
    "geometry_msgs": {"nodes"},
    "rosbags": {"bags"},
    "mcap": {"bags"},
    "bvhio": {"bags"},
    "ezc3d": {"bags"},
    "pymavlink": {"bags"},
    "pyulog": {"bags"},
    "matplotlib": {"plots"},
    "cv2": {"sensors"},
    "numba": {"sensors"},
    "trimesh": {"places"},
    "embreex": {"places"},
    "distributed": {"campaigns"},
    "pyarrow": {"campaigns"},
}
PARAMETERS = {"parameters", "presets", "triads"}
# Reading a file of poses must not cost what only some commands need.
HEAVY = {"cv2", "numba", "distributed", "pyarrow", "scipy", "matplotlib", "rosbags", "mcap", "rich"}
HEAVY |= {"yaml"}
pytestmark = pytest.mark.usefixtures("uncollected")


def modules():
    return sorted(PACKAGE.rglob("*.py"))


def over(places):
    """Make one test of a check that is made for each of many places; all failures are told."""

    def decorate(check):
        def test():
            problems = []
            for place in places:
                try:
                    check(place)
                except AssertionError as error:
                    problems.append(f"{place.relative_to(ROOT)}: {error}")
            assert not problems, "\n".join(problems)

        test.check = check  # for one place, by the recipes
        test.__doc__ = check.__doc__
        return test

    return decorate


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def room_of(path):
    room = path.relative_to(PACKAGE).parts[0]
    return room.removesuffix(".py")


def imports(tree):
    """Return every module that a file imports, also inside functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@over(modules())
def test_imports_follow_the_arrows(path):
    room = room_of(path)
    allowed = ROOMS.get(room, LOW)
    for name in imports(parsed(path)):
        top, *rest = name.split(".")
        if top in ONLY_IN:
            assert room in ONLY_IN[top], f"{room} imports {name}"
        if top == "imu_sim_ros" and rest and room not in SEE_EVERYTHING:
            assert rest[0] in allowed | {room}, f"{room} imports {name}"
            of_a_sensor = rest[0] == "sensors" and room in {"navigation", "calibration"}
            assert not of_a_sensor or set(rest) & PARAMETERS, f"{room} imports {name}"


@over(modules())
def test_no_module_takes_what_is_private_to_another(path):
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("imu_sim_ros"):
            private = [alias.name for alias in node.names if alias.name[0] == "_" != alias.name[1]]
            assert not private, f"{node.module}: {private}"


def test_only_the_door_names_a_format():
    """All others read by the door, so that each takes every format."""
    formats = {path.stem for path in (PACKAGE / "formats").glob("*.py")}
    formats -= {"__init__", "choice", "door", "handling", "poses"}
    door = PACKAGE / "formats" / "door.py"
    for path in modules():
        named_formats = set(imports(parsed(path))) & {
            f"imu_sim_ros.formats.{name}" for name in formats
        }
        assert path == door or not named_formats, f"{path}: {named_formats}"


def rooms():
    return sorted(path.parent for path in PACKAGE.rglob("__init__.py") if path.parent != PACKAGE)


def importable_rooms():
    """Return every room; those of the nodes only if ROS is installed."""
    return [
        room
        for room in rooms()
        if find_spec("rclpy") or PACKAGE / "nodes" not in (room, *room.parents)
    ]


def dotted(folder):
    return ".".join(folder.relative_to(PACKAGE.parent).parts)


def exports(folder):
    return getattr(importlib.import_module(dotted(folder)), "__all__", ())


def own_files():
    """Return every module and room but the package's ``__init__``, by dotted name.

    Its list of names is for Python and the type checker; no room takes a name from it but the
    version.
    """
    files = {dotted(path.with_suffix("")): path for path in modules()}
    return {
        name.removesuffix(".__init__"): path
        for name, path in files.items()
        if path != PACKAGE / "__init__.py"
    }


def own_imports(tree, files):
    """Return every module of the package that a file imports, also in functions or for types."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in files)
        elif isinstance(node, ast.ImportFrom):
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            known_names = names & files.keys()
            yield from known_names
            if node.module in files and names != known_names:
                yield node.module


def circle_in(wants):
    """Return the modules that import each other, or that such ones import; none: no circle."""
    wants = {name: set(dependencies) - {name} for name, dependencies in wants.items()}
    while free := [name for name, dependencies in wants.items() if not dependencies]:
        for name in free:
            del wants[name]
        for dependencies in wants.values():
            dependencies.difference_update(free)
    return wants


def test_no_module_imports_itself_in_a_circle():
    files = own_files()
    circle = circle_in({n: own_imports(parsed(path), files) for n, path in files.items()})
    assert not circle, "these import each other"


@pytest.mark.parametrize(
    "text",
    [
        "from imu_sim_ros import b",
        "def f():\n    from imu_sim_ros.b import name",
        "if TYPE_CHECKING:\n    from imu_sim_ros.b import name",
        "class C:\n    def f(self):\n        import imu_sim_ros.b",
    ],
)
def test_every_kind_of_import_counts_in_a_circle(text):
    files = {"imu_sim_ros.a": "from imu_sim_ros.b import name", "imu_sim_ros.b": "", "x.c": ""}
    one_way = {name: own_imports(ast.parse(code), files) for name, code in files.items()}
    assert not circle_in(one_way)
    files["imu_sim_ros.b"] = text.replace("imu_sim_ros.b", "imu_sim_ros.a").replace(" b", " a")
    both = {name: own_imports(ast.parse(code), files) for name, code in files.items()}
    assert circle_in(both).keys() == {"imu_sim_ros.a", "imu_sim_ros.b"}


FEW = 5
"""So many modules of the package take less than 2 ms to load."""
SAVED = HEAVY | ONLY_IN.keys() | {"pandas", "PIL", "rerun", "sqlite3"}
"""Libraries that are worth an import in a function."""


LATE = {
    "imu_sim_ros.commands.start": "signals are handled before anything is imported",
    "imu_sim_ros.simulation.parameters": "sections of cameras are made only if something sees",
}
"""Modules that import late for another reason."""


def at_start(body):
    """Yield the import statements that run when a module is imported."""
    for node in body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            yield from at_start(node.orelse)
        elif not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            for field in ("body", "orelse", "handlers", "finalbody"):
                yield from at_start(getattr(node, field, []))


def packages(name):
    """Return a module's name and those of the packages that it is in."""
    parts = name.split(".")
    return {".".join(parts[:k]) for k in range(1, len(parts) + 1)}


def loads(names, direct):
    """Return every module of this package, and every library, that loading some modules loads.

    :param direct: names that each module of this package imports at its top.
    """
    loaded, waiting = set(), list(names)
    while waiting:
        name = waiting.pop()
        internal = name.partition(".")[0] == PACKAGE.name
        for part in (packages(name) if internal else {name.partition(".")[0]}) - loaded:
            loaded.add(part)
            waiting += direct.get(part, ())
    return loaded


def needless_imports(trees):
    """Return module and line of imports in functions that save no time at the start.

    What they load, and their module does not load by itself, is neither a heavy library nor more
    than a few modules of the package.

    :param trees: every module by name.
    """

    def names_of(statement):
        names = list(imports(ast.Module([statement], [])))
        return {name for name in names if name in trees or "." not in name or name in names[:1]}

    direct = {
        name: set().union(*map(names_of, at_start(tree.body)), ()) for name, tree in trees.items()
    }
    needless = []
    for name, tree in trees.items():
        loaded = loads([name], direct)
        functions = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
        for statement in {node for function in functions for node in ast.walk(function)}:
            if not isinstance(statement, ast.Import | ast.ImportFrom):
                continue
            imported = names_of(statement) & trees.keys()
            saved = loads(imported, direct) - loaded
            if imported and not saved & SAVED and len(saved & trees.keys()) < FEW:
                needless.append(f"{name}:{statement.lineno}")
    return needless


def test_an_import_in_a_function_saves_time_at_the_start():
    """All others stand at the top."""
    trees = {name: parsed(path) for name, path in own_files().items()}
    needless = [place for place in needless_imports(trees) if place.partition(":")[0] not in LATE]
    assert not needless, "these belong at the top"


def test_an_import_that_saves_nothing_is_found():
    heavy = {"imu_sim_ros.a": "def f():\n    import imu_sim_ros.b", "imu_sim_ros.b": "import cv2"}
    heavy_modules = {**heavy, "imu_sim_ros.a": f"import cv2\n{heavy['imu_sim_ros.a']}"}
    small = {**heavy, "imu_sim_ros.b": ""}
    for modules, lines in (
        (heavy, []),
        (heavy_modules, ["imu_sim_ros.a:3"]),
        (small, ["imu_sim_ros.a:2"]),
    ):
        assert needless_imports({n: ast.parse(code) for n, code in modules.items()}) == lines


@over(sorted((ROOT / "test").rglob("*.py")))
def test_tests_share_modules_that_only_they_have(path):
    """Python has a package named test, and every folder of tests may have a conftest."""
    nodes = list(ast.walk(parsed(path)))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [node.module for node in nodes if isinstance(node, ast.ImportFrom) and not node.level]
    assert not {name.split(".")[0] for name in names} & {"test", "conftest"}


@over(importable_rooms())
def test_rooms_say_what_they_are_and_export_what_exists(room):
    module = importlib.import_module(dotted(room))
    assert module.__doc__
    for name in exports(room):
        value = getattr(module, name)
        is_module = (room / f"{name}.py").exists() or (room / name).is_dir()
        assert is_module == isinstance(value, types.ModuleType), (
            f"{name}: a module and something else"
        )


def test_the_front_door_opens_every_name_of_its_stub():
    stub = parsed(PACKAGE / "__init__.pyi")
    names = [
        alias.name for node in stub.body if isinstance(node, ast.ImportFrom) for alias in node.names
    ]
    assert imu_sim_ros.__all__ == sorted(names)
    for name in names:
        assert getattr(imu_sim_ros, name) is not None


@over(modules())
def test_no_heavy_import_at_the_top_of_what_a_node_starts_with(path):
    if room_of(path) in {"calibration", "plots"} or path.stem == "yaml_loader":  # by the first text
        return
    tree = parsed(path)
    top_level = [node for node in tree.body if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {name.split(".")[0] for name in imports(ast.Module(top_level, []))}
    if room_of(path) == "bags":
        names -= {"rosbags", "mcap"}
    assert not names & HEAVY


@over(modules())
def test_distributions_are_of_scipy_special(path):
    """``scipy.stats`` has the same numbers and takes half a second to import."""
    assert not {name for name in imports(parsed(path)) if name.startswith("scipy.stats")}


NOT_FOR_OTHERS = {"campaigns/plan.py"}  # the text of which a digest is made


@over(modules())
def test_json_is_written_in_one_place(path):
    """JSON has no NaN; terminal/json_text.py sees to that."""
    name = str(path.relative_to(PACKAGE))
    calls = {
        node.func.attr
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "json"
    }
    assert name in {"terminal/json_text.py", *NOT_FOR_OTHERS} or not calls & {"dump", "dumps"}


def manifest():
    return ElementTree.parse(ROOT / "package.xml").getroot()


def test_versions_are_equal_everywhere():
    version = manifest().findtext("version")
    assert imu_sim_ros.__version__ == version
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"version = {{{version}}}," in readme
    changelog = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8")
    assert re.search(r"^(\d+\.\d+\.\d+) \(", changelog, re.MULTILINE).group(1) == version


def test_dependencies_of_package_xml_and_setup_py_are_the_same():
    keys = {element.text for element in manifest().iter("exec_depend")}
    rosdep = {
        "numpy": "python3-numpy",
        "scipy": "python3-scipy",
        "matplotlib": "python3-matplotlib",
        "pillow": "python3-pil",
        "PyYAML": "python3-yaml",
        "rich": "python3-rich",
        "rosbags": "python3-rosbags-pip",
        "mcap": "mcap-ros2-support",  # no key of its own; comes with this one
        "lz4": "python3-rosbags-pip",  # these two have no key either; rosbags brings them
        "zstandard": "python3-rosbags-pip",
    }
    text = (ROOT / "setup.py").read_text(encoding="utf-8")
    block = text.split("install_requires=[")[1].split("]")[0]
    required = {re.split(r"[<>=]", name)[0] for name in re.findall(r'"([^"]+)"', block)}
    assert required - {"setuptools"} == set(rosdep)
    assert {rosdep[name] for name in rosdep} <= keys


def test_every_key_of_package_xml_is_known_to_rosdep():
    """Against the list of what resolved on the day that it names; a new key is looked up first."""
    rosdep_keys = yaml.safe_load((ROOT / "test/data/rosdep_keys.yaml").read_text(encoding="utf-8"))
    tags = ("exec_depend", "depend", "build_depend", "buildtool_depend", "test_depend")
    keys = {element.text for tag in tags for element in manifest().iter(tag)}
    assert keys <= {*rosdep_keys["ros"], *rosdep_keys["system"]}


HEADER = "# Copyright 2026 imu_sim_ros maintainers\n# SPDX-License-Identifier: Apache-2.0\n"
OF_THE_BUILD = {"build", "install", "log"}


def sources():
    """Return every file of code, without the folders that a build makes."""
    for entry in sorted(ROOT.iterdir()):
        if entry.is_dir() and not entry.name.startswith(".") and entry.name not in OF_THE_BUILD:
            yield from sorted(entry.rglob("*.py"))
        elif entry.suffix == ".py" or entry.name == "Makefile":
            yield entry
    yield ROOT / ".ci" / "run"


@over(list(sources()))
def test_every_source_file_names_copyright_and_license_at_the_top(path):
    text = path.read_text(encoding="utf-8")
    if text.startswith("#!"):
        text = text.partition("\n")[2]
    assert text.startswith(HEADER), f"{path} must begin with\n{HEADER}"


def test_the_header_names_the_license_of_the_package():
    assert HEADER.rstrip().endswith(manifest().findtext("license"))


def test_no_two_public_classes_have_the_same_name() -> None:
    """One name, one meaning."""
    class_names = [
        node.name
        for path in sorted(PACKAGE.rglob("*.py"))
        for node in parsed(path).body
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    ]
    assert [name for name, count in Counter(class_names).items() if count > 1] == []
