# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sections behave as the frozen dataclasses that they look like, without code of their own."""

import copy
import dataclasses
import importlib
import pickle
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import imu_sim_ros.config
from imu_sim_ros.config.parameter import section_class

ROOM = Path(imu_sim_ros.config.__file__).parent
DECORATORS = (dataclass, section_class)


def pair(decorate):
    """Return a section and one derived from it, made by a decorator."""

    @decorate(frozen=True)
    class Base:
        x: float
        y: str = "a"
        z: list = field(default_factory=list, metadata={"unit": "m"})

    @decorate(frozen=True)
    class Derived(Base):
        y: str = "b"
        w: float = 1.0

    return Base, Derived


@pytest.fixture(params=[0, 1], ids=["base", "derived"])
def both(request):
    """Return the same class as a plain dataclass and as a section."""
    return [pair(decorate)[request.param] for decorate in DECORATORS]


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ((1.0,), {}),
        ((1.0, "c"), {}),
        ((1.0,), {"z": [2]}),
        ((), {"z": [3], "x": 2.0}),
        ((), {}),
        ((1.0,), {"x": 2.0}),
        ((1.0,), {"v": 2.0}),
        ((1.0, "c", [], 1.0, 2.0), {}),
    ],
)
def test_a_section_is_built_as_a_dataclass_is(both, values, named):
    found = []
    for cls in both:
        try:
            found.append(dataclasses.asdict(cls(*values, **named)))
        except TypeError:
            found.append("refused")
    assert found[0] == found[1]


def test_a_section_is_shown_compared_and_changed_as_a_dataclass_is(both):
    plain, section = both
    assert repr(plain(1.0)) == repr(section(1.0))
    assert section(1.0) == section(1.0) != section(2.0)
    assert section(1.0) != plain(1.0)
    assert hash(section(1.0, z=())) == hash(section(1.0, z=())) == hash(plain(1.0, z=()))
    assert dataclasses.replace(section(1.0), y="c") == section(1.0, "c")
    assert section(1.0).z is not section(1.0).z
    with pytest.raises(dataclasses.FrozenInstanceError):
        section(1.0).x = 2.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        del section(1.0).x


def test_a_plain_dataclass_may_be_derived_from_a_section():
    """A trajectory of another package is one."""
    base = pair(section_class)[0]

    @dataclass(frozen=True)
    class Own(base):
        v: float = 3.0

    assert Own(1.0) == Own(1.0, "a", []) != base(1.0)
    assert repr(Own(1.0)).endswith("Own(x=1.0, y='a', z=[], v=3.0)")


def sections():
    """Return every class of parameters."""
    for path in sorted(ROOM.rglob("*.py")):
        if path.parent.name != "parameter":
            name = ".".join(path.relative_to(ROOM.parents[1]).with_suffix("").parts)
            module = importlib.import_module(name.removesuffix(".__init__"))
            for cls in vars(module).values():
                own = getattr(cls, "__module__", "") == module.__name__
                if own and dataclasses.is_dataclass(cls):
                    yield cls


def test_every_section_shares_its_methods():
    found = list(sections())
    assert len(found) > 50
    own = [cls for cls in found if len({cls.__init__, found[0].__init__}) > 1]
    assert not own, "decorate them with section_class: a dataclass costs every start 0.4 ms"


def test_sections_are_copied_and_pickled():
    for cls in sections():
        needed = {f.name: "x" for f in dataclasses.fields(cls) if f.default is f.default_factory}
        made = cls(**needed)  # what has neither a default nor a factory: both are MISSING
        assert pickle.loads(pickle.dumps(made)) == copy.deepcopy(made) == made
