# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The one description of a parameter: parsing, ranges, nesting, and all problems at once."""

from dataclasses import dataclass, fields, is_dataclass

import pytest

from imu_sim_ros.core.errors import ConfigurationError
from imu_sim_ros.navigation.parameters import IntegratorParameters
from imu_sim_ros.parameters.kinds import (
    EMPTY_LIST,
    IDENTITY_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Parameter,
    Vector,
    choice,
    flag,
    integer,
    matrix,
    number,
    numbers,
    text,
    texts,
    vector,
)
from imu_sim_ros.parameters.sections import (
    build,
    flatten,
    parameters,
    section,
    sections_by_name,
    variant,
)
from imu_sim_ros.sensors import sensor_declarations
from imu_sim_ros.sensors.camera.rig_parameters import OneCameraParameters, RigParameters
from imu_sim_ros.simulation.error_parameters import ErrorNodeParameters
from imu_sim_ros.simulation.parameters import load_simulation
from imu_sim_ros.simulation.playback import SimulatorParameters
from imu_sim_ros.trajectory.parameters import TYPES


@dataclass(frozen=True)
class Near:
    kind: str = text("near", "which")
    reach: float = number(1.0, "how far", unit="m", minimum=0.0, above_minimum=True)


@dataclass(frozen=True)
class Far:
    kind: str = text("far", "which")
    points: tuple[float, ...] = numbers((), "corners", group=3, unit="m")


KINDS = {"near": Near, "far": Far}


def find(name):
    if name not in KINDS:
        raise ConfigurationError(f"place.kind = {name!r}: must be one of near, far")
    return KINDS[name]


@dataclass(frozen=True)
class Sensor:
    bias: Vector = vector(0.0, "offset", unit="rad/s")
    low: float = number(0.0, "lower end")
    high: float = number(1.0, "upper end")

    def problems(self, prefix):
        if self.low >= self.high:
            yield f"{prefix}low = {self.low:g}: must be below {prefix}high = {self.high:g}"


@dataclass(frozen=True)
class Whole:
    rate: float = number(200.0, "rate", unit="Hz", minimum=0.0, above_minimum=True, maximum=1e4)
    seed: int = integer(0, "seed", minimum=0)
    loop: bool = flag(False, "again and again")
    method: str = choice("euler", ("euler", "midpoint"), "integration")
    turn: Matrix = matrix(IDENTITY_MATRIX, "rotation")
    topics: tuple[str, ...] = texts((), "topics")
    sensor: Sensor = section(Sensor)
    place: Near = variant("kind", "near", find, KINDS)


def test_defaults_build_and_round_trip():
    whole = build(Whole, {})
    assert whole == Whole()
    assert build(Whole, flatten(whole)) == whole


def test_values_take_the_parameters_type():
    whole = build(
        Whole,
        {
            "rate": 100,
            "seed": 3.0,
            "sensor.bias": 0.5,
            "turn": list(range(9)),
            "topics": ["/a"],
            "place.kind": "far",
            "place.points": [1, 2, 3],
        },
    )
    assert (whole.rate, whole.seed) == (100.0, 3)
    assert isinstance(whole.rate, float)
    assert isinstance(whole.seed, int)
    assert whole.sensor.bias == (0.5, 0.5, 0.5)
    assert whole.place == Far("far", (1.0, 2.0, 3.0))
    assert whole.topics == ("/a",)


def test_large_seeds_keep_every_digit():
    assert build(Whole, {"seed": 2**53 + 1}).seed == 2**53 + 1


BAD = [
    ("rate", 0.0, "above 0 and at most 10000 [Hz]"),
    ("rate", -1, "above 0"),
    ("rate", float("nan"), "a finite number"),
    ("rate", float("inf"), "a finite number"),
    ("rate", 1e9, "at most 10000"),
    ("rate", 1e-300, "must be 0 or of a size from 1e-30 to 1e+30"),
    ("rate", True, "a finite number"),
    ("rate", "fast", "a finite number"),
    ("rate", None, "a finite number"),
    ("rate", 10**400, "a finite number"),
    ("seed", 1.5, "an integer"),
    ("seed", -1, "at least 0"),
    ("loop", 1, "true or false"),
    ("method", "rk9", "one of euler, midpoint"),
    ("method", ["euler"], "one of euler, midpoint"),
    ("sensor.bias", [1.0, 2.0], "a list of three"),
    ("sensor.bias", [1.0, 2.0, float("nan")], "a finite number or a list of three"),
    ("sensor.bias", [1.0, 2.0, -1e200], "must be 0 or of a size from 1e-30 to"),
    ("sensor.bias", "xyz", "a list of three"),
    ("turn", [1, 2, 3], "nine finite numbers"),
    ("topics", "imu", "a list of strings"),
    ("topics", [1], "a list of strings"),
    ("place.reach", 0.0, "above 0 [m]"),
    ("nonsense", 1, "unknown parameter"),
    ("sensor.bais", 1, "did you mean sensor.bias?"),
    ("place.points", [1.0], "unknown parameter of place.kind near; far has it"),
    ("place.kind", "nowhere", "one of near, far"),
]


@pytest.mark.parametrize(("name", "value", "allowed"), BAD)
def test_a_bad_value_is_one_line_with_name_and_what_is_allowed(name, value, allowed):
    with pytest.raises(ConfigurationError) as error:
        build(Whole, {name: value})
    (line,) = error.value.problems
    assert line.startswith(name)
    assert allowed in line
    assert "\n" not in line
    assert len(line) < 200


def test_groups_of_numbers_are_whole():
    with pytest.raises(ConfigurationError, match="3 for each entry"):
        build(Whole, {"place.kind": "far", "place.points": [1.0, 2.0]})


def test_all_problems_are_reported_together():
    values = {"rate": -1.0, "sed": 1, "method": "x", "place.kind": "nowhere", "place.reach": -1}
    with pytest.raises(ConfigurationError) as error:
        build(Whole, values)
    names = sorted(line.split(" =")[0].split(":")[0] for line in error.value.problems)
    assert names == ["method", "place.kind", "rate", "sed"]


def test_rules_over_several_parameters_name_them_in_full():
    with pytest.raises(ConfigurationError, match=r"^sensor\.low = 2: must be below sensor\.high"):
        build(Whole, {"sensor.low": 2.0})


def test_parameters_follow_the_variant():
    assert "place.reach" in parameters(Whole)
    assert "place.points" in parameters(Whole, {"place.kind": "far"})


def test_ros_gives_an_empty_list_as_a_text():
    values = {"topics": "[]", "place.kind": "far", "place.points": EMPTY_LIST}
    whole = build(Whole, values)
    assert (whole.topics, whole.place.points) == ((), ())


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[0.1, 0, 0]", (0.1, 0.0, 0.0)),
        (" [1,2,3]", (1.0, 2.0, 3.0)),
        ("[5e-4, 0, 0]", (5e-4, 0, 0)),
    ],
)
def test_a_list_may_come_as_a_string(text, expected):
    assert Parameter("vector", ZERO_VECTOR, "").parse("bias", text) == expected


@pytest.mark.parametrize("text", ["[1, 2", "[[1], 2, 3]", "[1, 2, .nan]", "1, 2, 3", "[a: b]", ""])
def test_a_malformed_list_in_a_string_is_refused(text):
    with pytest.raises(ConfigurationError, match=r"^bias = .*: must be a finite number or a list"):
        Parameter("vector", ZERO_VECTOR, "").parse("bias", text)


@dataclass(frozen=True)
class Side:
    offset: Vector = vector(0.0, "offset of the {side}", unit="{unit}", minimum=0.0)
    tilt: float = number(2.0, "tilt of the {side}")

    def problems(self, prefix):
        if self.tilt > max(self.offset) > 0.0:
            yield f"{prefix}tilt = {self.tilt:g}: must be at most the offset"


@dataclass(frozen=True)
class Both:
    left: Side = section(Side, joint="_", substitutions={"side": "left", "unit": "m"})
    right: Side = section(
        Side, joint="_", substitutions={"side": "right", "unit": "mm"}, without=["tilt"]
    )


@dataclass(frozen=True)
class Owner:
    sides: Both = section(Both)


def test_one_description_serves_two_sections():
    described = parameters(Owner)
    assert list(described) == ["sides.left_offset", "sides.left_tilt", "sides.right_offset"]
    assert [d.text for d in described.values()][::2] == [
        "offset of the left",
        "offset of the right",
    ]
    assert [d.unit for d in described.values()] == ["m", "", "mm"]
    owner = build(Owner, {"sides.left_offset": 3.0, "sides.right_offset": [1.0, 2.0, 3.0]})
    assert (owner.sides.left.offset, owner.sides.right.offset) == ((3.0,) * 3, (1.0, 2.0, 3.0))
    assert owner.sides.right.tilt == 2.0
    assert list(flatten(owner)) == list(described)
    assert build(Owner, flatten(owner)) == owner


def test_problems_of_two_sections_bear_their_names():
    values = {"sides.left_offset": -1.0, "sides.right_tilt": 1.0}
    with pytest.raises(ConfigurationError) as caught:
        build(Owner, values)
    assert list(caught.value.problems) == [
        "sides.right_tilt: unknown parameter; did you mean sides.left_tilt?",
        "sides.left_offset = -1.0: must be a finite number or a list of three, each at least 0 [m]",
    ]
    with pytest.raises(ConfigurationError, match=r"^sides\.left_tilt = 2: must be at most"):
        build(Owner, {"sides.left_offset": 1.0})


def test_the_largest_seed_is_a_seed():
    """A large integer as a float would be one too large."""
    assert load_simulation({"seed": 2**63 - 1}).seed == 2**63 - 1
    for seed in (2**63, -1, 1.5, True, float("nan"), float("inf"), 10**400):
        with pytest.raises(ConfigurationError, match="seed = "):
            load_simulation({"seed": seed})


@pytest.mark.parametrize(
    ("unit", "possible", "impossible"),
    [
        ("rad/s", 1e5, 9.2e18),
        ("rad/s/sqrt(Hz)", 1.0, 2e5),
        ("m/s^2", 1e7, 1e8),
        ("m/s^3/sqrt(Hz)", 1.0, 1e8),
        ("m/s", 3e5, 1e9),
        ("m", 1e10, 1e20),
        ("T", 1.0, 1e4),
        ("1", 1e20, 1e31),
    ],
)
def test_a_number_that_no_quantity_of_its_unit_has_is_refused(unit, possible, impossible):
    parameter = Parameter("vector", ZERO_VECTOR, "", unit=unit)
    assert parameter.parse("bias", [possible, -possible, 0.0]) == (possible, -possible, 0.0)
    with pytest.raises(ConfigurationError, match="bias = .*: must be 0 or of a size from 1e-30 to"):
        parameter.parse("bias", impossible)


def nested(instance):
    """Yield the sections in a section, and those in them."""
    for field in fields(instance):
        value = getattr(instance, field.name)
        for inner in value.values() if isinstance(value, dict) else [value]:
            if is_dataclass(inner):
                yield inner
                yield from nested(inner)


def test_defaults_fit_each_other():
    """So that a section in which nothing is given need not be asked."""
    classes = [SimulatorParameters, ErrorNodeParameters, IntegratorParameters, RigParameters]
    classes += [OneCameraParameters, *TYPES.values()]
    classes += [sensor.section for sensor in sensor_declarations().values()]
    asked = [inner for cls in classes for inner in nested(cls()) if hasattr(inner, "problems")]
    assert len(asked) > 20
    assert [line for inner in asked for line in inner.problems("")] == []


def test_a_section_that_is_named_is_asked_though_nothing_is_given_in_it():
    @dataclass(frozen=True)
    class Strict:
        file: str = text("", "a file")

        def problems(self, prefix):
            if not self.file:
                yield f"{prefix}file = '': must name a file"

    @dataclass(frozen=True)
    class Several:
        names: tuple[str, ...] = texts((), "names")
        sections: dict = sections_by_name("names", lambda *_: Strict)

    assert build(Several, {}) == Several()
    with pytest.raises(ConfigurationError, match=r"^a\.file = '': must name a file$"):
        build(Several, {"names": ["a", "b"], "b.file": "x"})
